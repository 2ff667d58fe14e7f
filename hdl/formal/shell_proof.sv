/// The LED enable at the pin is low at most 36 clocks of the watch after the ADC's clock has stopped, and at once
/// without lock, with the reset button pressed or while the sampling phase is scanned, whatever the core does and
/// whatever state everything is in.
///
/// The clock never ticks here, and everything begins in any state: that is the moment of the stop.
module shell_proof (
    input logic clk_host,
    input logic locked,
    input logic reset_n
);
    logic led_enable;
    shell dut (
        .clk_host,
        .clk_adc    (1'b0),
        .measured   (1'b0),
        .locked,
        .restart    (),
        .reset_n,
        .code       ('0),
        .over_range (1'b0),
        .rows       (),
        .columns    (),
        .phase_step (),
        .adc_select_n    (),
        .adc_serial_clock(),
        .adc_serial_data (),
        .led_enable,
        .interlock  (1'b1),
        .spi_sck    (1'b0),
        .spi_cs_n   (1'b1),
        .spi_in     ('0),
        .spi_out    (),
        .spi_drive  (),
        .frame_ready(),
        .raw_ready  (),
        .parallel_ready (1'b0),
        .parallel_strobe(),
        .parallel_lines (),
        .parallel_enable(),
        .healthy    ()
    );

    logic [5:0] since = '0;
    always_ff @(posedge clk_host) if (since != '1) since <= since + 1;

    always_comb begin
        dark_when_stopped: assert (since < 36 || !led_enable);
        dark_at_once:      assert (locked && reset_n || !led_enable);
        dark_in_scan:      assert (dut.scanned || !led_enable);
`ifdef INDUCTION
        invariant_seen:   assert (since < 1 || dut.guard.beat[0] == dut.guard.divided[3]);
        invariant_seen_1: assert (since < 2 || dut.guard.beat[1] == dut.guard.divided[3]);
        invariant_seen_2: assert (since < 3 || dut.guard.beat[2] == dut.guard.divided[3]);
        invariant_silent: assert (since < 3 || !dut.guard.alive || 6'(dut.guard.silent) >= 6'(since - 6'd3) || dut.guard.silent == '1);
`endif
    end
endmodule

/// Stands for the core: its outputs have any value in any clock.
module nirspi_core (
    input  logic        clk_adc,
    input  logic        rst_adc,
    input  logic        clk_host,
    input  logic        rst_host,
    input  logic        rst_bridge,
    input  logic        clk_sck,
    input  logic        rst_sck,
    input  logic [7:0]  design_id,
    input  logic        adc_beat,
    input  logic        pll_locked,
    input  logic        clock_alive,
    input  logic [31:0] sampling,
    input  logic [13:0] adc_code,
    input  logic        adc_over_range,
    output logic [31:0] led_rows,
    output logic [31:0] led_columns,
    output logic        led_enable,
    input  logic        interlock,
    input  logic        spi_sck,
    input  logic        spi_cs_n,
    input  logic [3:0]  spi_in,
    output logic [3:0]  spi_out,
    output logic [3:0]  spi_drive,
    output logic        frame_ready,
    output logic        raw_ready,
    input  logic        parallel_ready,
    output logic [1:0]  parallel_strobe,
    output logic [7:0]  parallel_lines,
    output logic        parallel_enable,
    output logic        access
);
endmodule

/// Stands for the scan of the sampling phase: it may be over in any clock.
module nirspi_phase_scan (
    input  logic        clk_host,
    input  logic        rst_host,
    input  logic        clk_adc,
    input  logic        rst_adc,
    input  logic [13:0] code,
    output logic        serial_select_n,
    output logic        serial_clock,
    output logic        serial_data,
    output logic        phase_step,
    output logic        done,
    output logic [31:0] sampling
);
    // Of any value; one that is read twice is to be the same for both.
    logic next;
    always_ff @(posedge clk_host) done <= next;
endmodule
