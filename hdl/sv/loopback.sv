/// A detector for a bring-up without ADC: the light that the levels at the LED pins would make.
///
/// Invariant: `code` is `loopback` of `mcu/wire` of what was at the pins four clocks before. Only the LEDs of the
/// diagonal reach this detector, so that each line has a pixel of its own.
module nirspi_loopback
    import nirspi_register_map::*;
(
    input  var logic          clk    ,
    input  var logic          rst    ,
    input  var logic [32-1:0] rows   ,
    input  var logic [32-1:0] columns,
    input  var logic          enable ,
    output var logic [14-1:0] code
);


    logic [32-1:0] lit      ;
    logic [3-1:0]  some  [8];
    logic [6-1:0]  total    ;

    for (genvar i = 0; i < 8; i++) begin :g_four
        always_ff @ (posedge clk) begin
            if (rst) begin
                some[i] <= 0;
            end else begin
                some[i] <= (3'(lit[4 * i])) + (3'(lit[4 * i + 1])) + (3'(lit[4 * i + 2])) + (3'(lit[4 * i + 3]));
            end
        end
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            lit   <= 0;
            total <= 0;
            code  <= 0;
        end else begin
            lit   <= ~(rows ^ columns) & {32{enable}};
            total <= (6'(some[0])) + (6'(some[1])) + (6'(some[2])) + (6'(some[3])) + (6'(some[4])) + (6'(some[5]))
                + (6'(some[6])) + (6'(some[7]));
            code <= 14'((LOOPBACK_DARK + LOOPBACK_COUNTS * 32'(total)));
        end
    end
endmodule
