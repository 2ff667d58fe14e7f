/// The light budget: half-arrays lit in the fixed windows of 2^20 clocks.
///
/// The one law: what is spent is counted in and out of runs alike, so no start renews the budget. What the
/// limit leaves is kept beside it, with its signs after 0, 1 and 2 more worked out a clock before they are
/// asked for.
module nirspi_duty (
    input  var logic          clk         ,
    input  var logic          rst         ,
    input  var logic [21-1:0] limit       , /// Changes only between runs
    input  var logic          window_first, /// This clock is the first of a window
    input  var logic          running     ,
    input  var logic          spends      , /// This clock is one of a run and counts
    input  var logic [2-1:0]  half_arrays , /// Lit in this clock: 0, 1 or 2
    output var logic          exceeded     /// With this clock, were it to count
);
    logic [22-1:0] spent  ;
    logic [22-1:0] rest   ; // two's complement
    logic          below_0;
    logic          below_1;
    logic          below_2;
    logic [22-1:0] after  ;
    logic [22-1:0] less_1 ;
    logic [22-1:0] less_2 ;
    logic [22-1:0] base   ;
    logic [22-1:0] cost   ;

    always_comb begin
        if (window_first) begin
            exceeded = 21'(half_arrays) > limit;
        end else if (half_arrays[1]) begin
            exceeded = below_2;
        end else if (half_arrays[0]) begin
            exceeded = below_1;
        end else begin
            exceeded = below_0;
        end
    end

    always_comb begin
        // A limit set anew is taken between runs, from what is spent by then.
        base   = ((window_first || !running) ? ( 22'(limit) ) : ( rest ));
        cost   = ((running) ? ( 22'(half_arrays) ) : ( (((window_first) ? ( 0 ) : ( spent ))) ));
        after  = base - cost;
        less_1 = after - 1;
        less_2 = after - 2;
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            spent   <= 0;
            rest    <= 0;
            below_0 <= 0;
            below_1 <= 0;
            below_2 <= 0;
        end else begin
            spent   <= (((window_first) ? ( 0 ) : ( spent ))) + (((spends) ? ( 22'(half_arrays) ) : ( 0 )));
            rest    <= after;
            below_0 <= after[21];
            below_1 <= less_1[21];
            below_2 <= less_2[21];
        end
    end
endmodule
