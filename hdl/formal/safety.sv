/// LED safety of the whole `engine`, for every input, every setting and for all time.
///
/// `prove.py` cuts memories and host-written registers loose first: they may then have any value in any
/// clock, so what is proven holds whatever the host writes and whenever. Assertions named `invariant_...` are
/// there only to make the others provable by induction.
module safety (
    input logic        clk,
    input logic        rst,
    input logic [13:0] code,
    input logic        over_range,
    input logic        interlock,
    input logic        request,
    input logic [1:0]  operation,
    input logic [15:0] address,
    input logic [31:0] data,
    input logic        byte_taken,
    input logic        parallel_ready
);
    localparam int unsigned DEPTH = nirspi_types::DEPTH;

    logic [31:0] rows;
    logic [31:0] columns;
    logic        enable;
    logic        access;
    nirspi_engine dut (
        .frame_ready(),
        .raw_ready  (),
        .answered   (),
        .value      (),
        .octet      (),
        .byte_valid (),
        .parallel_strobe(),
        .parallel_lines (),
        .parallel_enable(),
        .*
    );

    // The first clock is a reset. An access comes only when the one before it is done with: `crossing` waits for that.
    logic begun = 1'b0;
    always_ff @(posedge clk) begun <= 1'b1;
    always_comb begin
        assume (begun || rst);
        assume (!(request && dut.command.busy));
    end

    // What a bystander with a stopwatch knows.
    localparam logic [29:0] EVER = '1;
    logic [29:0] silent; // clocks since the last access
    logic [29:0] unfed;  // clocks since the watchdog was renewed
    logic        opened; // the interlock has been open since the last start
    logic        was_open;
    logic        was_reset;
    logic [2:0]  fault_before;
    logic        forgotten;
    logic        lines_were_up_in_the_dark;
    logic        was_unlit;

    always_ff @(posedge clk) begin
        was_open     <= !interlock;
        was_reset    <= rst;
        fault_before <= dut.fault;
        forgotten    <= rst || dut.clear;
        was_unlit    <= dut.settings.unlit;
        lines_were_up_in_the_dark <= !enable && (rows != 0 || columns != 0);
        if (rst) begin
            silent <= EVER;
            unfed  <= EVER;
            opened <= 1'b1;
        end else begin
            silent <= access ? 30'd1 : silent == EVER ? EVER : silent + 1;
            unfed  <= dut.guard.dog.renewed ? 30'd1 : unfed == EVER ? EVER : unfed + 1;
            opened <= !interlock || opened && !dut.begins;
        end
    end

    // A run on its way from its start to its first clock done with.
    logic coming;
    assign coming = |dut.command.going[DEPTH - 1:1];

    logic [29:0] limit; // of the watchdog, in clocks
    assign limit = 30'(dut.settings.watchdog_less_1) + 1;

    always_comb if (begun) begin
        // The rules.
        dark_in_reset:         assert (!(enable && was_reset));
        dark_in_fault:         assert (!(enable && dut.fault != 0));
        dark_when_open:        assert (!(enable && was_open));
        dark_until_restarted:  assert (!(enable && opened));
        dark_without_run:      assert (!(enable && !dut.running && !coming && !dut.halt));
        dark_when_host_silent: assert (!(enable && silent > limit + DEPTH));
        dark_when_unlit:       assert (!(enable && dut.settings.unlit && !dut.halt));
        lines_low_when_dark:   assert (enable || !lines_were_up_in_the_dark || rows == 0 && columns == 0
            || dut.settings.unlit && (dut.running || coming) || was_unlit && dut.halt);
        fault_latched:         assert (fault_before == 0 || dut.fault == fault_before || forgotten);

`ifdef INDUCTION
        // What makes them inductive.
        invariant_opened:      assert (opened == dut.guard.dropped);
        invariant_lit_stages:  assert (!((dut.array.counters.active || dut.array.active != 0) && !dut.running && !coming && !dut.halt));
        invariant_lights:      assert (!dut.array.lights || dut.array.active[3] && (!dut.settings.unlit || dut.halt));
        invariant_no_run_in_fault: assert (!(dut.running && dut.fault != 0));
        for (int i = 0; i < 15; i++) begin
            assert (!dut.command.going[i] || silent == 30'(i + 1) && dut.command.busy && dut.command.age == 6'(i + 2));
        end
        invariant_access:      assert (!access || dut.command.busy && dut.command.age == 1);
        invariant_alone:       assert (dut.command.going[DEPTH - 1:0] == 0 || !dut.running && dut.fault == 0);
        invariant_first:       assert (dut.guard.dog.first == dut.command.going[DEPTH]);
        invariant_busy:        assert (!dut.command.busy || dut.command.age <= 6'(dut.command.ANSWER));
        invariant_fresh:       assert (silent <= unfed + DEPTH + 1 || !dut.running);
        invariant_unfed:       assert (!dut.running || dut.guard.dog.renewed
            || unfed <= 30'(dut.settings.watchdog_less_1)
                && dut.guard.dog.left == 27'(dut.settings.watchdog_less_1 - 27'(unfed))
                && dut.guard.dog.last == (dut.guard.dog.left == 0));
        invariant_at_once:     assert (!dut.running || dut.guard.dog.at_once == (dut.settings.watchdog_less_1 == 0));
`endif
    end
endmodule
