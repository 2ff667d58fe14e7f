/// The ADC's clock may go away and come back at any moment: no access of before is carried out after it, and
/// none is taken that the ADC's domain cannot see.
///
/// The board's resets (`resets.sv`) with both halves of the bridge: `crossing`, and the pointers of `byte_fifo`.
/// `healthy` may change in any step, and for any time. A step is a tick of each clock, of one or of none.
module recovery (
    input logic        clk_host,
    input logic        clk_adc,
    input logic        healthy,
    input logic        send,
    input logic [1:0]  operation_in,
    input logic [15:0] address_in,
    input logic [31:0] data_in,
    input logic        push,
    input logic        pop
);
    logic rst_adc;
    logic rst_bridge;
    resets all (
        .clk_adc,
        .clk_host,
        .reset_n (1'b1),
        .healthy,
        .rst_adc,
        .rst_host(),
        .rst_bridge
    );

    logic        request;
    logic [1:0]  operation;
    logic [15:0] address;
    logic [31:0] data;
    logic        answered;
    nirspi_crossing dut (
        .rst_host  (rst_bridge),
        .back      (),
        .value_out (),
        .idle      (),
        .epoch_host(),
        .epoch_adc (),
        .value     ('0),
        .*
    );
    nirspi_control engine (
        .clk          (clk_adc),
        .rst          (rst_adc),
        .is_write     (1'b0),
        .in_range     (1'b0),
        .interlock_now(1'b0),
        .fault        ('0),
        .opens        (1'b0),
        .trips        (1'b0),
        .ends         (1'b0),
        .access       (),
        .write        (),
        .stop         (),
        .clear        (),
        .give_back    (),
        .begins       (),
        .begins_raw   (),
        .go           (),
        .go_sample    (),
        .go_raw       (),
        .arrives      (),
        .first        (),
        .running      (),
        .halt         (),
        .table_write  (),
        .config_error (),
        .write_refused(),
        .*
    );

    // An access was taken since the bridge was opened. Bytes come of accesses alone.
    logic accepted;
    always_ff @(posedge clk_host or posedge rst_bridge) begin
        if (rst_bridge) accepted <= 1'b0;
        else if (send && dut.idle) accepted <= 1'b1;
    end
    nirspi_byte_fifo bytes (
        .clk_write(clk_adc),
        .rst_write(rst_adc),
        .push     (push && accepted),
        .push_data('0),
        .full     (),
        .clk_read (clk_host),
        .rst_read (rst_bridge),
        .pop,
        .empty    (),
        .pop_data ()
    );

    // What the engine took with the request.
    logic [49:0] taken;
    always_ff @(posedge clk_adc) if (request) taken <= {operation, address, data};

    // The toggle on its way round.
    logic [7:0] ring;
    assign ring = {
        dut.asked, dut.there.first, dut.asked_here, dut.asked_last, dut.told, dut.here.first, dut.seen, dut.seen_last
    };
    logic [4:0] write_on_its_way;
    logic [4:0] read_on_its_way;
    for (genvar i = 0; i < 5; i++) begin : g_on_the_way
        assign write_on_its_way[i] = bytes.g_pointers[i].to_read.first;
        assign read_on_its_way[i]  = bytes.g_pointers[i].to_write.first;
    end
    logic host_stands_at_0;
    logic adc_stands_at_0;
    assign host_stands_at_0 = {dut.asked, dut.here.first, dut.seen, dut.seen_last, bytes.taken, bytes.taken_gray,
        write_on_its_way, bytes.written_there} == '0;
    assign adc_stands_at_0  = {dut.there.first, dut.asked_here, dut.asked_last, dut.told, engine.busy, answered,
        bytes.written, bytes.written_gray, read_on_its_way, bytes.taken_there} == '0;

    function automatic logic shifted(input logic [7:0] late);
        return (~late & 8'(late << 1)) == '0;
    endfunction

    always_comb begin
        nothing_old:   assert (rst_adc || !request || accepted);
        nothing_early: assert (!accepted || !rst_adc);
        one_at_a_time: assert (rst_adc || !(request && engine.busy));
        stands_still:  assert (rst_adc || !engine.busy || taken == {operation, address, data});
        begins_empty:  assert (rst_adc || accepted || bytes.written == 0 && bytes.taken == 0);
`ifdef INDUCTION
        invariant_shift_1:    assert (shifted(all.to_first.late));
        invariant_shift_2:    assert (shifted(all.to_adc.late));
        invariant_shift_3:    assert (shifted(all.to_bridge.late));
        invariant_host_reset: assert (!rst_bridge || all.to_first.late == '1 || host_stands_at_0);
        invariant_adc_reset:  assert (!rst_adc || all.to_adc.late == '1 || adc_stands_at_0);
        invariant_opened:     assert (rst_adc || accepted || host_stands_at_0 && adc_stands_at_0);
        invariant_one_edge:   assert (rst_adc || $countones(ring[7:1] ^ ring[6:0]) <= 1);
        invariant_waits:      assert (rst_adc || !(engine.busy || answered) || dut.asked_last != dut.told);
        invariant_done:       assert (rst_adc || !(engine.busy && answered));
`endif
    end
endmodule
