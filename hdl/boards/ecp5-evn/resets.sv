/// The resets of the core: one for each clock, and one for the host port's half of the bridge between them.
///
/// Invariant: wherever the ADC's clock stops and begins again, both halves of the bridge stand at 0 when the
/// first access may cross. The ADC's domain is held until the host's half has been reset, and the host's half
/// until the ADC's domain is out of reset. `hdl/formal/recovery.sv` proves that for clocks in any relation.
module resets (
    input  logic clk_adc,
    input  logic clk_host,
    input  logic reset_n,
    input  logic healthy,   /// The ADC's clock can be used
    output logic rst_adc,
    output logic rst_host,
    output logic rst_bridge
);
    logic first;
    reset_synchroniser to_host (
        .clk  (clk_host),
        .holds(!reset_n),
        .rst  (rst_host)
    );
    reset_synchroniser to_first (
        .clk  (clk_host),
        .holds(!healthy),
        .rst  (first)
    );
    reset_synchroniser to_adc (
        .clk  (clk_adc),
        .holds(!healthy || first),
        .rst  (rst_adc)
    );
    reset_synchroniser to_bridge (
        .clk  (clk_host),
        .holds(rst_adc),
        .rst  (rst_bridge)
    );
endmodule
