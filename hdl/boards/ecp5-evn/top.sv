/// The camera on the Lattice ECP5 Evaluation Board, LFE5UM5G-85F-EVN: its clocks and its pins.
///
/// Pins and levels are in `board.lpf` and `docs/log/gateware.md`; `shell.sv` has what does not touch a pin.
module top (
    // AD9246-125 or the like: 14 bit, offset binary, CMOS, with a data clock.
    input  logic        adc_dco,
    input  logic [13:0] adc_code,
    input  logic        adc_over_range,
    // Its serial port, which is written to and never read.
    output logic        adc_select_n,
    output logic        adc_serial_clock,
    output logic        adc_serial_data,
    // LED array.
    output logic [31:0] led_rows,
    output logic [31:0] led_columns,
    output logic        led_enable,
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
    // Clocks: the ADC's, cleaned of its insertion delay by a PLL; the FPGA's own oscillator, which needs
    // nothing from outside, for the host port and for the watch over the other.
    // `build.py` and `board.lpf` know them by these names.
    (* keep *) logic clk_adc;
    (* keep *) logic clk_host;
    logic locked;
    logic restart;
    logic phase_step;
    logic healthy;

    OSCG #(.DIV(3)) oscillator (.OSC(clk_host)); // 310 MHz / 3

    adc_pll pll (
        .dco   (adc_dco),
        .restart,
        .phase_step,
        .clk   (clk_adc),
        .locked
    );

    // One register in each input cell and each output cell.
    logic [13:0] code;
    logic        over_range;
    logic [31:0] rows;
    logic [31:0] columns;

    IFS1P3DX code_in [13:0] (
        .D   (adc_code),
        .SP  (1'b1),
        .SCLK(clk_adc),
        .CD  (1'b0),
        .Q   (code)
    );
    IFS1P3DX over_range_in (
        .D   (adc_over_range),
        .SP  (1'b1),
        .SCLK(clk_adc),
        .CD  (1'b0),
        .Q   (over_range)
    );
    OFS1P3DX rows_out [31:0] (
        .D   (rows),
        .SP  (1'b1),
        .SCLK(clk_adc),
        .CD  (1'b0),
        .Q   (led_rows)
    );
    OFS1P3DX columns_out [31:0] (
        .D   (columns),
        .SP  (1'b1),
        .SCLK(clk_adc),
        .CD  (1'b0),
        .Q   (led_columns)
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

    shell #(.DESIGN(8'd1)) camera (
        .clk_host,
        .clk_adc,
        .measured(adc_dco),
        .locked,
        .restart,
        .reset_n,
        .code,
        .over_range,
        .rows,
        .columns,
        .phase_step,
        .adc_select_n,
        .adc_serial_clock,
        .adc_serial_data,
        .led_enable,
        .interlock,
        .spi_sck,
        .spi_cs_n,
        .spi_in  (spi_io),
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
    assign shows_light_n  = !led_enable;
    assign shows_frame_n  = !frame_ready;
endmodule
