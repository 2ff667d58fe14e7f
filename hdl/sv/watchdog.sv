/// Ends a run when the host has been silent for too long.
///
/// Invariant: only clocks of a run count, and any access starts the count again.
module nirspi_watchdog (
    input  var logic          clk    ,
    input  var logic          rst    ,
    input  var logic [27-1:0] less_1 , /// The setting less 1; changes only between runs
    input  var logic          arrives, /// The next clock is the first of a run
    input  var logic          feed   , /// An access comes before this clock
    output var logic          barks   /// With this clock, if it is one of a run
);
    logic [27-1:0] left   ;
    logic          last   ;
    logic          renewed;
    logic          at_once;

    // The setting may be new: it is taken when the run begins, of which no clock has counted before.
    logic first  ;
    always_comb renewed = feed || first;
    always_comb barks   = ((renewed) ? ( at_once ) : ( last ));

    always_ff @ (posedge clk) begin
        if (rst) begin
            first   <= 0;
            left    <= 0;
            last    <= 0;
            at_once <= 0;
        end else begin
            first   <= arrives;
            at_once <= less_1 == 0;
            left    <= (((renewed) ? ( less_1 ) : ( left ))) - 1;
            last    <= (((renewed) ? ( less_1 ) : ( left ))) == 1;
        end
    end
endmodule
