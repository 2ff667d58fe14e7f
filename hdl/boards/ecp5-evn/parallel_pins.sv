/// The pins of the parallel port.
///
/// Clock, lines and enable leave by output cells of one kind, so that all are equally late: the lines change when the
/// clock falls, and the receiver takes them when the clock rises, 12 ns later at 125 MHz.
module parallel_pins (
    input  logic       clk,
    input  logic [1:0] strobe, /// In the first and in the second half of the period of `clk`
    input  logic [7:0] lines,
    input  logic       enable,
    output logic       pdck,
    output logic [7:0] data,
    output logic       de
);
    ODDRX1F clock_out (
        .SCLK(clk),
        .RST (1'b0),
        .D0  (strobe[1]),
        .D1  (strobe[0]),
        .Q   (pdck)
    );
    ODDRX1F lines_out [7:0] (
        .SCLK(clk),
        .RST (1'b0),
        .D0  (lines),
        .D1  (lines),
        .Q   (data)
    );
    ODDRX1F enable_out (
        .SCLK(clk),
        .RST (1'b0),
        .D0  (enable),
        .D1  (enable),
        .Q   (de)
    );
endmodule
