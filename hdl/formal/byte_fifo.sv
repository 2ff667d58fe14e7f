/// The byte FIFO never overflows, never underflows and keeps order, for two clocks in any relation.
///
/// One word of those in flight is picked (`picked`, any of them) and followed; since it may be any, all keep
/// their order and their content. Pointer bits cross together here; that the crossing stands a bit arriving
/// late rests on the Gray code, of which a step changes one bit: `codes_agree`. It begins in the state of reset,
/// all 0, in which the board holds both sides together.
module byte_fifo (
    input logic       clk_write,
    input logic       push,
    input logic [8:0] push_data,
    input logic       clk_read,
    input logic       pop
);
    logic       full;
    logic       empty;
    logic [8:0] pop_data;
    nirspi_byte_fifo dut (
        .rst_write(1'b0),
        .rst_read (1'b0),
        .*
    );

    function automatic logic [4:0] binary(input logic [4:0] gray);
        logic [4:0] word;
        word[4] = gray[4];
        for (int i = 3; i >= 0; i--) word[i] = word[i + 1] ^ gray[i];
        return word;
    endfunction

    // Pointers on their way.
    logic [4:0] write_1, write_2, read_1, read_2;
    for (genvar i = 0; i < 5; i++) begin : g_on_the_way
        assign write_1[i] = dut.g_pointers[i].to_read.first;
        assign read_1[i]  = dut.g_pointers[i].to_write.first;
    end
    assign write_2 = dut.written_there;
    assign read_2  = dut.taken_there;

    // How far each is ahead of the last one, modulo 32.
    logic [4:0] ahead_read_1, ahead_taken, ahead_write_2, ahead_write_1, ahead_written;
    assign ahead_read_1  = binary(read_1) - binary(read_2);
    assign ahead_taken   = dut.taken - binary(read_2);
    assign ahead_write_2 = binary(write_2) - binary(read_2);
    assign ahead_write_1 = binary(write_1) - binary(read_2);
    assign ahead_written = dut.written - binary(read_2);

    // The word that is followed: a register that never changes, of any value.
    logic [4:0]                picked;
    always_ff @(posedge clk_read) picked <= picked;
    logic                      in_flight;
    logic [8:0]                content;
    logic [4:0]                distance;
    assign distance  = picked - dut.taken;
    assign in_flight = distance < 5'(dut.written - dut.taken);
    always_ff @(posedge clk_write) if (push && !full && dut.written == picked) content <= push_data;

    always_comb begin
        never_over_full:  assert (5'(dut.written - dut.taken) <= 16);
        never_under_empty: assert (empty || dut.written != dut.taken);
        order_kept:       assert (empty || dut.taken != picked || pop_data == content);
        codes_agree:      assert (dut.written_gray == (dut.written ^ dut.written >> 1) && dut.taken_gray == (dut.taken ^ dut.taken >> 1));
`ifdef INDUCTION
        invariant_order:  assert (ahead_read_1 <= ahead_taken && ahead_taken <= ahead_write_2
            && ahead_write_2 <= ahead_write_1 && ahead_write_1 <= ahead_written && ahead_written <= 16);
        invariant_content: assert (!in_flight || dut.words[picked[3:0]] == content);
`endif
    end
endmodule
