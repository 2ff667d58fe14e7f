/// Lattice ECP5 Evaluation Board, LFE5UM5G-85F-EVN: what of the FPGA is special to this board.
///
/// The one law: the LED enable at the pin falls by itself when the ADC's clock is lost, since everything
/// else that could switch it off runs on that clock. Pins and levels are in `board.lpf` and `docs/gateware.md`.
module top (
    // AD9246-125 or the like: 14 bit, offset binary, CMOS, with a data clock.
    input  logic        adc_dco,
    input  logic [13:0] adc_code,
    input  logic        adc_over_range,
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
    // On the board: push button SW2, LEDs D5 to D7 (lit when low).
    input  logic        reset_n,
    output logic        shows_locked_n,
    output logic        shows_light_n,
    output logic        shows_frame_n
);
    // Clocks: the ADC's, cleaned of its insertion delay by a PLL; the FPGA's own oscillator, which needs
    // nothing from outside, for the host port and for the watch over the other.
    logic clk_adc;
    logic clk_host;
    logic locked;
    logic alive;
    logic restart;

    OSCG #(.DIV(3)) oscillator (.OSC(clk_host)); // 310 MHz / 3

    adc_pll pll (
        .dco    (adc_dco),
        .restart(restart),
        .clk    (clk_adc),
        .locked (locked)
    );

    clock_guard guard (
        .clk    (clk_host),
        .watched(clk_adc),
        .locked (locked),
        .alive  (alive),
        .restart(restart)
    );

    // Both domains are reset together: a toggle that crosses must not differ from its copy by a reset.
    logic rst_adc;
    logic rst_host;
    logic healthy;
    assign healthy = alive && locked && reset_n;

    reset_synchroniser to_adc (
        .clk  (clk_adc),
        .holds(!healthy),
        .rst  (rst_adc)
    );
    reset_synchroniser to_host (
        .clk  (clk_host),
        .holds(!healthy),
        .rst  (rst_host)
    );

    // One register in each input cell. On the way out two: one to cross the chip with, one in the output
    // cell. These three clocks are part of the ADC latency, which is a setting anyway.
    logic [13:0] code;
    logic        over_range;
    logic [31:0] rows;
    logic [31:0] columns;
    logic        enable;
    logic [31:0] rows_halfway;
    logic [31:0] columns_halfway;
    logic        enable_halfway;
    logic        enable_at_pin;

    always_ff @(posedge clk_adc) begin
        rows_halfway    <= rows;
        columns_halfway <= columns;
        enable_halfway  <= enable;
        // Not in its output cell: a gate that needs no clock is to be the last thing before the pin.
        enable_at_pin   <= enable_halfway;
    end
    assign led_enable = enable_at_pin && healthy;

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
        .D   (rows_halfway),
        .SP  (1'b1),
        .SCLK(clk_adc),
        .CD  (1'b0),
        .Q   (led_rows)
    );
    OFS1P3DX columns_out [31:0] (
        .D   (columns_halfway),
        .SP  (1'b1),
        .SCLK(clk_adc),
        .CD  (1'b0),
        .Q   (led_columns)
    );
    // The interlock loop passes an input cell of its own and is synchronised in the core.
    logic [3:0] spi_out;
    logic [3:0] spi_drive;
    for (genvar i = 0; i < 4; i++) begin : g_line
        assign spi_io[i] = spi_drive[i] ? spi_out[i] : 1'bz;
    end

    nirspi_core core (
        .clk_adc,
        .rst_adc,
        .clk_host,
        .rst_host,
        .adc_code      (code),
        .adc_over_range(over_range),
        .led_rows      (rows),
        .led_columns   (columns),
        .led_enable    (enable),
        .interlock,
        .spi_sck,
        .spi_cs_n,
        .spi_in        (spi_io),
        .spi_out,
        .spi_drive,
        .frame_ready,
        .raw_ready,
        .access        ()
    );

    assign shows_locked_n = !healthy;
    assign shows_light_n  = !led_enable;
    assign shows_frame_n  = !frame_ready;
endmodule
