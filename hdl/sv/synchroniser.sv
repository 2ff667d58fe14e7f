/// Brings one bit from another clock, or from none, into step with this one.
module nirspi_synchroniser (
    input  var logic clk ,
    input  var logic rst ,
    input  var logic from,
    output var logic to   /// Two clocks later
);
    logic first;

    always_ff @ (posedge clk) begin
        if (rst) begin
            first <= 0;
            to    <= 0;
        end else begin
            first <= from;
            to    <= first;
        end
    end

endmodule
