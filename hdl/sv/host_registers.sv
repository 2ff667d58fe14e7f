/// The registers that are answered in the host port's clock, with or without the ADC's.
///
/// Invariant: every read has an answer before its dummy cycles are over. Of the registers here it is their
/// value; of any other it is `NO_CLOCK`, until the engine's answer takes its place.
module nirspi_host_registers
    import nirspi_register_map::*;
(
    input var logic          clk      ,
    input var logic          rst      ,
    input var logic [8-1:0]  design_id,
    input var logic          locked   , /// The PLL of the ADC's clock
    input var logic          alive    , /// The ADC's domain ticks
    input var logic          ready    , /// The ADC's domain is out of reset
    input var logic          beat     , /// The ADC's clock, divided by `CLOCKS_PRESCALER` and again by two
    input var logic [32-1:0] sampling , /// The register `Sampling`
    // From the host port.
    input var logic          send   ,
    input var logic [16-1:0] address,
    // From the engine.
    input var logic          back ,
    input var logic [32-1:0] value,
    // To the host port.
    output var logic          answered,
    output var logic [32-1:0] answer
);


    logic          locked_here;
    logic [16-1:0] frequency  ;
    logic [32-1:0] clocks     ;
    logic [5-1:0]  here       ;
    logic          own        ;

    nirspi_synchroniser to_locked (
        .clk  (clk        ),
        .rst  (rst        ),
        .from (locked     ),
        .to   (locked_here)
    );
    nirspi_clock_meter meter (
        .clk   (clk      ),
        .rst   (rst      ),
        .beat  (beat     ),
        .count (frequency)
    );

    always_comb clocks = 32'(frequency) | (((locked_here) ? ( CLOCKS_LOCKED ) : ( 0 )))
        | (((alive) ? ( CLOCKS_ALIVE ) : ( 0 ))) | (((ready) ? ( CLOCKS_READY ) : ( 0 )));
    always_comb begin
        here[0] = 32'(address) == ADDRESS_IDENTITY;
        here[1] = 32'(address) == ADDRESS_VERSION;
        here[2] = 32'(address) == ADDRESS_CLOCKS;
        here[3] = 32'(address) == ADDRESS_DESIGN;
        here[4] = 32'(address) == ADDRESS_SAMPLING;
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            own      <= 0;
            answered <= 0;
            answer   <= 0;
        end else if (send) begin
            own      <= here != 0;
            answered <= 1;
            answer   <= ((here == 0) ? (
                NO_CLOCK
            ) : (
                (RESET_IDENTITY & {32{here[0]}}) | (RESET_VERSION & {32{here[1]}}) | (clocks & {32{here[2]}})
                    | (32'(design_id) & {32{here[3]}}) | (sampling & {32{here[4]}})
            ));
        end else begin
            answered <= back && !own;
            if (back && !own) begin
                answer <= value;
            end
        end
    end
endmodule
