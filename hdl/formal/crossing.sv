/// An access reaches the engine only when the one before it is answered, and stands still meanwhile.
///
/// `safety.sv` assumes the first; a bus that is read by the other clock needs the second.
module crossing (
    input logic        clk_host,
    input logic        clk_adc,
    input logic        send,
    input logic [1:0]  operation_in,
    input logic [15:0] address_in,
    input logic [31:0] data_in
);
    logic        request;
    logic [1:0]  operation;
    logic [15:0] address;
    logic [31:0] data;
    logic        answered;
    nirspi_crossing dut (
        .rst_host  (1'b0),
        .rst_adc   (1'b0),
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
        .rst          (1'b0),
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

    // What the engine took with the request.
    logic [49:0] taken;
    always_ff @(posedge clk_adc) if (request) taken <= {operation, address, data};

    // The toggle on its way round.
    logic [7:0] ring;
    assign ring = {
        dut.asked, dut.there.first, dut.asked_here, dut.asked_last, dut.told, dut.here.first, dut.seen, dut.seen_last
    };

    always_comb begin
        one_at_a_time: assert (!(request && engine.busy));
        stands_still:  assert (!engine.busy || taken == {operation, address, data});
`ifdef INDUCTION
        invariant_one_edge: assert ($countones(ring[7:1] ^ ring[6:0]) <= 1);
        invariant_waits:    assert (!(engine.busy || answered) || dut.asked_last != dut.told);
`endif
    end
endmodule
