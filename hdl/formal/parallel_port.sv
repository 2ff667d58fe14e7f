/// The parallel port sends every byte that it takes once and in order, none later than four clocks after its receiver
/// was last ready, a zero before each packet and three behind its delimiter, and the lines stand around each rise of the
/// strobe.
///
/// `ready` is the level at the pin: the core's synchroniser is here too. The packer may have a byte in any clock, of any
/// value. `on` changes with a start alone, as the register behind it does.
module parallel_port (
    input logic       clk,
    input logic       wanted,
    input logic       restart,
    input logic       frame,
    input logic       ready,
    input logic [7:0] octet,
    input logic       valid
);
    logic on;
    always_ff @(posedge clk) if (restart) on <= wanted;

    logic       receives;
    logic       open;
    logic       taken;
    logic       give_back;
    logic [1:0] strobe;
    logic [7:0] lines;
    logic       enable;
    nirspi_synchroniser to_receives (
        .clk,
        .rst (1'b0),
        .from(ready),
        .to  (receives)
    );
    nirspi_parallel_port dut (
        .rst  (1'b0),
        .ready(receives),
        .*
    );

    logic rises;
    assign rises = strobe == 2'b01;

    // Clocks since the receiver was last ready, and bytes that it has got since.
    logic [2:0] since;
    logic [1:0] late;
    always_ff @(posedge clk) begin
        since <= ready ? 3'd1 : since == 7 ? 3'd7 : since + 3'd1;
        late  <= ready ? 2'd0 : rises && enable && late != 3 ? late + 2'd1 : late;
    end

    // The byte that was taken last and has not been sent.
    logic       due;
    logic [7:0] content;
    always_ff @(posedge clk) begin
        if (taken) begin
            due     <= 1'b1;
            content <= octet;
        end else if (rises) begin
            due <= 1'b0;
        end
    end

    // Zeros that went out last, up to four, at the moment in which a byte is put on the lines; and whether the packet
    // that is open has had a byte.
    logic [2:0] zeros;
    logic       begun;
    logic       whole; // the delimiter has gone
    always_ff @(posedge clk) begin
        if (dut.puts) zeros <= taken && octet != 0 ? 3'd0 : zeros == 4 ? 3'd4 : zeros + 3'd1;
        if (open || restart) begin
            begun <= 1'b0;
            whole <= 1'b0;
        end else if (taken) begin
            begun <= 1'b1;
            whole <= octet == 0;
        end
    end

    // What was there in the clock before.
    logic [1:0] strobe_before;
    logic [7:0] lines_before;
    logic       enable_before;
    logic [1:0] off;
    always_ff @(posedge clk) begin
        strobe_before <= strobe;
        lines_before  <= lines;
        enable_before <= enable;
        off           <= on ? 2'd0 : off == 3 ? 2'd3 : off + 2'd1;
    end

    always_comb begin
        taken_if_there: assert (!taken || valid);
        sent_once:      assert (!rises || (due ? enable && lines == content : !enable || lines == 0));
        none_lost:      assert (!taken || !due);
        ready_when_sent: assert (!(rises && enable) || since <= 4);
        at_most_two:    assert (late <= 2);
        zero_before:    assert (!taken || begun || zeros != 0);
        zeros_behind:   assert (!give_back || whole && zeros == 4);
        stands:         assert (strobe == 0 || lines == lines_before && enable == enable_before);
        no_short_level: assert (strobe_before == 2'b01 ? strobe == 2'b11 : strobe_before == 2'b11 ? strobe == 2'b00 : !strobe[1]);
        off_is_still:   assert (on || off != 3 || strobe == 0 && !enable && !open);
`ifdef INDUCTION
        invariant_phase:  assert (dut.phase != 3 && dut.part <= 4);
        invariant_strobe: assert (strobe == (!dut.runs || dut.phase == 0 ? 2'b00 : dut.phase == 1 ? 2'b01 : 2'b11));
        invariant_byte:   assert (enable ? dut.runs : lines == 0);
        invariant_due:    assert (!due || enable && lines == content && dut.phase != 2);
        invariant_else:   assert (due || dut.phase == 2 || !enable || lines == 0);
        invariant_on:     assert (on || dut.part == 0);
        invariant_before: assert (dut.part != 2 || begun || zeros != 0);
        invariant_whole:  assert (whole ? dut.part == 0 || dut.part == 3 || dut.part == 4 : dut.part <= 2);
        invariant_behind: assert (dut.part != 3 || zeros + dut.left >= 3);
        invariant_sent:   assert (dut.part != 4 || zeros == 4);
        invariant_fresh:  assert (dut.part != 1 || !begun);
        invariant_range:  assert (zeros <= 4 && (dut.part != 3 || dut.left <= 2));
        invariant_off:    assert (on || !dut.runs || off <= dut.phase);
        invariant_ready:  assert ((!to_receives.first || since <= 1) && (!receives || since <= 2)
            && (!enable || dut.phase != 0 || since <= 3) && (!enable || dut.phase != 1 || since <= 4));
        invariant_late:   assert ((late != 1 || since >= 2 && (since != 2 || dut.phase == 2) && (since != 3 || dut.phase != 1))
            && (late != 2 || since >= 5));
`endif
    end
endmodule
