/// Brings the level of a pin into step with this clock, and leaves out glitches.
///
/// Invariant: one wrong sample among three in a row changes nothing. A pulse shorter than one period of the clock is
/// one sample at most, so it never comes out.
module nirspi_glitch_filter (
    input  var logic clk ,
    input  var logic rst ,
    input  var logic from,
    output var logic to   /// Three clocks later
);
    logic level  ;
    logic last   ;
    logic earlier;

    nirspi_synchroniser to_level (
        .clk  (clk  ),
        .rst  (rst  ),
        .from (from ),
        .to   (level)
    );

    always_comb to = level && last || last && earlier || level && earlier;

    always_ff @ (posedge clk) begin
        if (rst) begin
            last    <= 0;
            earlier <= 0;
        end else begin
            last    <= level;
            earlier <= last;
        end
    end
endmodule
