/// Watches a clock with another that needs nothing from outside.
///
/// Invariant: `alive` falls within 36 clocks of `clk` after the last edge of `watched`, whatever state
/// that one stopped in. It also starts the PLL anew while there is no lock: the ADC may come up later than the FPGA.
module clock_guard (
    input  logic clk,
    input  logic watched,
    input  logic locked,
    output logic alive   = 1'b0,
    output logic restart = 1'b1
);
    // A beat every eight clocks of the watched one: 64 ns at 125 MHz.
    logic [3:0] divided = '0;
    always_ff @(posedge watched) divided <= divided + 1;

    logic [2:0] beat   = '0;
    logic [4:0] silent = '0;
    always_ff @(posedge clk) begin
        beat <= {beat[1:0], divided[3]};
        if (beat[2] != beat[1]) begin
            silent <= '0;
            alive  <= 1'b1;
        end else if (silent == '1) begin
            alive <= 1'b0;
        end else begin
            silent <= silent + 1;
        end
    end

    // 16 clocks of PLL reset, then 2^18 (2.5 ms) to find lock in.
    logic [1:0]  lock  = '0;
    logic [18:0] waits = '0;
    always_ff @(posedge clk) begin
        lock    <= {lock[0], locked};
        restart <= waits[18:4] == '0;
        if (lock[1]) begin
            waits <= 19'd16;
        end else if (waits[18]) begin
            waits <= '0;
        end else begin
            waits <= waits + 1;
        end
    end
endmodule
