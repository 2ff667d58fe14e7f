/// The bring-up design on the same board: no ADC, no LED array; the board's 12 MHz is the clock.
///
/// The LED lines do what the camera's do. Their levels are read back at the pins, and `loopback` makes the light
/// of them that the ADC would have seen, so that a line that is stuck shows in the picture.
module top (
    input  logic        clk_12mhz,
    // Lines of the LED array, read back.
    inout  wire  [31:0] led_rows,
    inout  wire  [31:0] led_columns,
    inout  wire         led_enable,
    // Interlock loop: closed when high.
    input  logic        interlock,
    // Host port.
    input  logic        spi_sck,
    input  logic        spi_cs_n,
    inout  wire  [3:0]  spi_io,
    output logic        frame_ready,
    output logic        raw_ready,
    // Parallel port.
    input  logic        parallel_ready,
    output logic        parallel_clock,
    output logic [7:0]  parallel_data,
    output logic        parallel_valid,
    // On the board: push button SW2, LEDs D5 to D7 (lit when low).
    input  logic        reset_n,
    output logic        shows_locked_n,
    output logic        shows_light_n,
    output logic        shows_frame_n
);
    // `build.py` and `board.lpf` know them by these names.
    (* keep *) logic clk_adc;
    (* keep *) logic clk_host;
    logic locked;
    logic restart;
    logic healthy;

    OSCG #(.DIV(3)) oscillator (.OSC(clk_host)); // 310 MHz / 3

    board_pll pll (
        .clk_12mhz,
        .restart,
        .clk   (clk_adc),
        .locked
    );

    // Output cells as the camera's, and behind each pin a way back.
    logic [31:0] rows;
    logic [31:0] columns;
    logic        enable;
    logic [31:0] rows_out;
    logic [31:0] columns_out;
    logic [31:0] rows_back;
    logic [31:0] columns_back;
    logic        enable_back;
    logic [31:0] rows_seen;
    logic [31:0] columns_seen;
    logic        enable_seen;

    OFS1P3DX to_rows [31:0] (
        .D   (rows),
        .SP  (1'b1),
        .SCLK(clk_adc),
        .CD  (1'b0),
        .Q   (rows_out)
    );
    OFS1P3DX to_columns [31:0] (
        .D   (columns),
        .SP  (1'b1),
        .SCLK(clk_adc),
        .CD  (1'b0),
        .Q   (columns_out)
    );
    BB row_pads [31:0] (
        .I(rows_out),
        .T(1'b0),
        .O(rows_back),
        .B(led_rows)
    );
    BB column_pads [31:0] (
        .I(columns_out),
        .T(1'b0),
        .O(columns_back),
        .B(led_columns)
    );
    BB enable_pad (
        .I(enable),
        .T(1'b0),
        .O(enable_back),
        .B(led_enable)
    );
    always_ff @(posedge clk_adc) begin
        rows_seen    <= rows_back;
        columns_seen <= columns_back;
        enable_seen  <= enable_back;
    end

    logic [13:0] code;
    nirspi_loopback detector (
        .clk    (clk_adc),
        .rst    (1'b0),
        .rows   (rows_seen),
        .columns(columns_seen),
        .enable (enable_seen),
        .code
    );

    logic [1:0] strobe;
    logic [7:0] lines;
    logic       valid;
    parallel_pins parallel (
        .clk   (clk_adc),
        .strobe,
        .lines,
        .enable(valid),
        .pdck  (parallel_clock),
        .data  (parallel_data),
        .de    (parallel_valid)
    );

    logic [3:0] spi_out;
    logic [3:0] spi_drive;
    for (genvar i = 0; i < 4; i++) begin : g_line
        assign spi_io[i] = spi_drive[i] ? spi_out[i] : 1'bz;
    end

    shell #(.DESIGN(8'd2), .SCANS(1'b0)) camera (
        .clk_host,
        .clk_adc,
        .measured  (clk_adc),
        .locked,
        .restart,
        .reset_n,
        .code,
        .over_range(1'b0),
        .rows,
        .columns,
        .phase_step      (),
        .adc_select_n    (),
        .adc_serial_clock(),
        .adc_serial_data (),
        .led_enable(enable),
        .interlock,
        .spi_sck,
        .spi_cs_n,
        .spi_in    (spi_io),
        .spi_out,
        .spi_drive,
        .frame_ready,
        .raw_ready,
        .parallel_ready,
        .parallel_strobe(strobe),
        .parallel_lines (lines),
        .parallel_enable(valid),
        .healthy
    );

    assign shows_locked_n = !healthy;
    assign shows_light_n  = !enable;
    assign shows_frame_n  = !frame_ready;
endmodule
