/// The LED enable falls at most 36 clocks of the watch after the ADC's clock has stopped, in whatever state.
///
/// The watched clock never ticks here, and the guard begins in any state: that is the moment of the stop.
module clock_guard_proof (
    input logic clk,
    input logic locked
);
    logic alive;
    logic restart;
    clock_guard dut (
        .watched(1'b0),
        .*
    );

    logic [5:0] since = '0;
    always_ff @(posedge clk) if (since != '1) since <= since + 1;

    always_comb begin
        dead_when_stopped: assert (since < 36 || !alive);
`ifdef INDUCTION
        invariant_seen:   assert (since < 1 || dut.beat[0] == dut.divided[3]);
        invariant_seen_1: assert (since < 2 || dut.beat[1] == dut.divided[3]);
        invariant_seen_2: assert (since < 3 || dut.beat[2] == dut.divided[3]);
        invariant_silent: assert (since < 3 || !alive || 6'(dut.silent) >= 6'(since - 6'd3) || dut.silent == '1);
`endif
    end
endmodule
