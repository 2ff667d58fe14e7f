/// The port that `sck` clocks never overflows, and gives bytes of its own read alone, each once and in order, for two
/// clocks in any relation and reads that end at any time.
///
/// One byte of those in flight is picked and followed, as in `byte_fifo.sv`. Assumed is the time between two reads: five
/// clocks of the ADC, and one of `sck`. The opcode alone lasts longer.
module packet_port (
    input logic       clk_adc,
    input logic       clk_sck,
    input logic       rst_sck,
    input logic       line,
    input logic       begins,
    input logic       access,
    input logic [7:0] octet,
    input logic       byte_valid
);
    // Clocks of the ADC that must still pass before a read, and whether none had to at the last clock of `sck`.
    logic [2:0] left;
    logic       calm;
    always_ff @(posedge clk_adc) left <= dut.reads ? 3'd5 : left == 0 ? 3'd0 : left - 3'd1;
    always_ff @(posedge clk_sck) calm <= left == 0;

    nirspi_packet_port dut (
        .rst_adc  (1'b0),
        .may_begin(begins && calm && left == 0),
        .lines_out(),
        .drives   (),
        .reads    (),
        .takes    (),
        .full     (),
        .*
    );

    function automatic logic [4:0] binary(input logic [4:0] gray);
        logic [4:0] word;
        word[4] = gray[4];
        for (int i = 3; i >= 0; i--) word[i] = word[i + 1] ^ gray[i];
        return word;
    endfunction

    // Pointers on their way.
    logic [4:0] taken_1, taken_2;
    for (genvar i = 0; i < 5; i++) begin : g_on_the_way
        assign taken_1[i] = dut.g_taken[i].to_taken.first;
    end
    assign taken_2 = dut.taken_there;

    // How far each is ahead of the last one, modulo 32.
    logic [4:0] ahead_1, ahead_taken, ahead_here, ahead_once, ahead_written;
    assign ahead_1       = binary(taken_1) - binary(taken_2);
    assign ahead_taken   = dut.taken - binary(taken_2);
    assign ahead_here    = binary(dut.written_here) - binary(taken_2);
    assign ahead_once    = binary(dut.written_once) - binary(taken_2);
    assign ahead_written = dut.written - binary(taken_2);

    // The byte that is followed: a register that never changes, of any value.
    logic [4:0] picked;
    always_ff @(posedge clk_sck) picked <= picked;
    logic       in_flight;
    logic [7:0] content;
    logic [4:0] distance;
    assign distance  = picked - dut.taken;
    assign in_flight = distance < 5'(dut.written - dut.taken);
    always_ff @(posedge clk_adc) if (dut.push && dut.written == picked) content <= octet;

    always_comb begin
        never_over_full: assert (!dut.reads || 5'(dut.written - dut.taken) <= 16);
        order_kept:      assert (!dut.reads || dut.empty || dut.taken != picked || dut.byte_now == content);
        nothing_old:     assert (!dut.reads || dut.empty || dut.takes);
        zeros_else:      assert (!dut.empty || dut.byte_now == 0);
        silent_else:     assert (dut.reads || !dut.drives);
        codes_agree:     assert (dut.written_gray == (dut.written ^ dut.written >> 1) && dut.taken_gray == (dut.taken ^ dut.taken >> 1));
`ifdef INDUCTION
        invariant_one:   assert (left > 4 || !dut.to_reads.first && taken_1 == 0);
        invariant_two:   assert (left > 3 || !dut.reads_there && taken_2 == 0);
        invariant_three: assert (left > 2 || !dut.takes && dut.written == 0);
        invariant_five:  assert (left != 5 || dut.to_reads.first);
        invariant_range: assert (left <= 5);
        invariant_calm:  assert (!calm || dut.reads || dut.written_once == 0);
        invariant_idle:  assert (dut.reads ? dut.clocks >= 8 && (left == 0 || left == 5) : dut.taken == 0);
        invariant_fresh: assert (!dut.reads || dut.takes || dut.written == 0 && dut.taken == 0 && dut.written_once == 0
            && dut.written_here == 0 && taken_1 == 0 && taken_2 == 0);
        invariant_there: assert (!dut.takes || !dut.reads || dut.reads_there);
        invariant_order: assert (!dut.reads || ahead_1 <= ahead_taken && ahead_taken <= ahead_here
            && ahead_here <= ahead_once && ahead_once <= ahead_written && ahead_written <= 16);
        invariant_content: assert (!dut.reads || !in_flight || dut.words[picked[3:0]] == content);
`endif
    end
endmodule
