/// What every design on this board has around the core: watch over the ADC's clock, resets, and the LED enable.
///
/// Invariant: the LED enable at the pin falls by itself when the ADC's clock is lost, since everything
/// else that could switch it off runs on that clock (`hdl/formal/shell_proof.sv`).
module shell #(
    parameter logic [7:0] DESIGN = 8'd1, /// `Design` of `mcu/wire`
    parameter bit         SCANS  = 1'b1  /// There is an ADC whose sampling phase can be scanned
) (
    input  logic        clk_host,
    input  logic        clk_adc,
    input  logic        measured,  /// The clock whose frequency `Clocks` tells: that at the pin
    input  logic        locked,
    output logic        restart,   /// Starts the PLL's search for lock anew
    input  logic        reset_n,
    // In step with `clk_adc`.
    input  logic [13:0] code,
    input  logic        over_range,
    output logic [31:0] rows,
    output logic [31:0] columns,
    // The PLL moves `clk_adc` by a step whenever this falls.
    output logic        phase_step,
    // Pins.
    output logic        adc_select_n,
    output logic        adc_serial_clock,
    output logic        adc_serial_data,
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
    // In step with `clk_adc`.
    output logic [1:0]  parallel_strobe,
    output logic [7:0]  parallel_lines,
    output logic        parallel_enable,
    output logic        healthy
);
    logic alive;
    clock_guard guard (
        .clk    (clk_host),
        .watched(clk_adc),
        .locked,
        .alive,
        .restart
    );
    // The ADC's clock can be used, though it may not stand where the lines are sampled best.
    logic clocked;
    assign clocked = alive && locked && reset_n;

    // The core stays in reset until the scan is over, so the array is dark and nothing sees the checkerboard.
    logic        scanned;
    logic [31:0] sampling;
    if (SCANS) begin : g_scan
        logic rst_scan_host;
        logic rst_scan_adc;
        reset_synchroniser to_scan_host (
            .clk  (clk_host),
            .holds(!clocked),
            .rst  (rst_scan_host)
        );
        reset_synchroniser to_scan_adc (
            .clk  (clk_adc),
            .holds(!clocked),
            .rst  (rst_scan_adc)
        );
        nirspi_phase_scan scan (
            .clk_host,
            .rst_host       (rst_scan_host),
            .clk_adc,
            .rst_adc        (rst_scan_adc),
            .code,
            .serial_select_n(adc_select_n),
            .serial_clock   (adc_serial_clock),
            .serial_data    (adc_serial_data),
            .phase_step,
            .done           (scanned),
            .sampling
        );
    end else begin : g_no_scan
        assign adc_select_n     = 1'b1;
        assign adc_serial_clock = 1'b0;
        assign adc_serial_data  = 1'b0;
        assign phase_step       = 1'b0;
        assign scanned          = 1'b1;
        assign sampling         = '0;
    end
    assign healthy = clocked && scanned;

    // Changes every four clocks of the one measured. Few flip-flops: nextpnr then leaves the pin's own way to the PLL.
    logic [2:0] divided = '0;
    always_ff @(posedge measured) divided <= divided + 1;

    logic rst_adc;
    logic rst_host;
    logic rst_bridge;
    resets all (
        .clk_adc,
        .clk_host,
        .reset_n,
        .healthy,
        .rst_adc,
        .rst_host,
        .rst_bridge
    );

    // On the way out two registers: one to cross the chip with, one in the output cell. They are part of the ADC
    // latency, which is a setting anyway.
    logic [31:0] rows_here;
    logic [31:0] columns_here;
    logic        enable_here;
    logic        enable_halfway;
    logic        enable_at_pin;
    always_ff @(posedge clk_adc) begin
        rows           <= rows_here;
        columns        <= columns_here;
        enable_halfway <= enable_here;
        // Not in its output cell: a gate that needs no clock is to be the last thing before the pin.
        enable_at_pin  <= enable_halfway;
    end
    assign led_enable = enable_at_pin && healthy;

    // The parallel port has one register here and one in each output cell, its clock too.
    logic [1:0] strobe_here;
    logic [7:0] lines_here;
    logic       valid_here;
    always_ff @(posedge clk_adc) begin
        parallel_strobe <= strobe_here;
        parallel_lines  <= lines_here;
        parallel_enable <= valid_here;
    end

    // The interlock loop passes an input cell of its own and is synchronised in the core.
    nirspi_core core (
        .clk_adc,
        .rst_adc,
        .clk_host,
        .rst_host,
        .rst_bridge,
        .clk_sck       (spi_sck),
        .rst_sck       (spi_cs_n),
        .design_id     (DESIGN),
        .adc_beat      (divided[2]),
        .pll_locked    (locked),
        .clock_alive   (alive),
        .sampling,
        .adc_code      (code),
        .adc_over_range(over_range),
        .led_rows      (rows_here),
        .led_columns   (columns_here),
        .led_enable    (enable_here),
        .interlock,
        .spi_sck,
        .spi_cs_n,
        .spi_in,
        .spi_out,
        .spi_drive,
        .frame_ready,
        .raw_ready,
        .parallel_ready,
        .parallel_strobe(strobe_here),
        .parallel_lines (lines_here),
        .parallel_enable(valid_here),
        .access        ()
    );
endmodule
