/// Measures the frequency of another clock.
///
/// Invariant: `count` is the number of times that `beat` changed in the last whole window, and 0 before the
/// first window is over. It is true of any `beat` that stands for two clocks or more, and of one that stands still.
module nirspi_clock_meter
    import nirspi_register_map::*;
(
    input  var logic          clk  ,
    input  var logic          rst  ,
    input  var logic          beat , /// The other clock, divided
    output var logic [16-1:0] count
);


    logic          level  ;
    logic          last   ;
    logic [16-1:0] left   ; // clocks of the window after this one
    logic [16-1:0] so_far ;
    logic [16-1:0] changes;

    nirspi_synchroniser to_level (
        .clk  (clk  ),
        .rst  (rst  ),
        .from (beat ),
        .to   (level)
    );

    always_comb changes = so_far + (((level != last) ? ( 1 ) : ( 0 )));

    always_ff @ (posedge clk) begin
        if (rst) begin
            last   <= 0;
            left   <= 16'((CLOCKS_WINDOW - 1));
            so_far <= 0;
            count  <= 0;
        end else begin
            last <= level;
            if (left == 0) begin
                left   <= 16'((CLOCKS_WINDOW - 1));
                so_far <= 0;
                count  <= changes;
            end else begin
                left   <= left - 1;
                so_far <= changes;
            end
        end
    end
endmodule
