/// Where samples come from: the ADC's pins or the test generator.
///
/// Invariant: everything behind this block cannot tell which. A sample leaves it two clocks after it was
/// at the pins.
module nirspi_source (
    input  var logic                         clk       ,
    input  var logic                         rst       ,
    input  var logic                         test      ,
    input  var logic                         start     , /// The next sample is the first of a run
    input  var logic                [14-1:0] code      , /// From the ADC's pins
    input  var logic                         over_range,
    output var nirspi_types::Sample          sample
);
    nirspi_types::Sample          pins     ;
    logic                [14-1:0] generator;
    logic                [14-1:0] next     ;

    // x^14 + x^5 + x^3 + x + 1
    always_comb next = {generator[12:0], generator[13] ^ generator[4] ^ generator[2] ^ generator[0]};

    always_ff @ (posedge clk) begin
        if (rst) begin
            pins      <= nirspi_types::Sample'(0);
            generator <= 0;
            sample    <= nirspi_types::Sample'(0);
        end else begin
            pins.code       <= code;
            pins.over_range <= over_range;
            generator       <= ((start) ? ( 14'(nirspi_register_map::TEST_SEED) ) : ( next ));
            if (test) begin
                sample.code       <= generator;
                sample.over_range <= 0;
            end else begin
                sample <= pins;
            end
        end
    end
endmodule
