/// What switches the LEDs off whatever the firmware does: interlock, over-range, duty, watchdog.
///
/// Invariant: the first cause is latched, and nothing is lit until it is cleared. `permit` falls in the
/// clock of the trip, so no clock sees both a fault and a lit LED.
module nirspi_safety (
    input  var logic                          clk             ,
    input  var logic                          rst             ,
    input  var nirspi_types::Settings         settings        ,
    input  var logic                          window_first    , /// This clock is the first of a duty window
    input  var logic                          begins          , /// A run is accepted
    input  var logic                          arrives         , /// The next clock is the first of a run
    input  var logic                          running         , /// This clock is one of a run
    input  var logic                          feed            , /// An access comes before this clock
    input  var logic                          stop            , /// It ends the run
    input  var logic                          clear           , /// It forgets the fault
    input  var logic                          interlock_closed, /// As of this clock
    input  var logic                          interlock_now   , /// At the pin
    input  var logic                          ends            , /// This clock is the last of a run
    input  var logic                          over_range      , /// The trip is reached with this clock
    input  var logic                  [2-1:0] half_arrays     , /// Lit in this clock
    output var logic                  [3-1:0] fault           , /// Code as of before this clock
    output var logic                          opens           , /// The interlock ends the run before this clock
    output var logic                          trips           , /// This clock ends the run
    output var logic                          permit          , /// LEDs may be lit in the next clock
    output var logic                          permitted        /// As `permit`, but for what withdraws it in this very clock
);
    logic counts  ;
    logic exceeded;
    logic barks   ;
    logic dropped ;

    nirspi_duty budget (
        .clk          (clk                ),
        .rst          (rst                ),
        .limit        (settings.duty_limit),
        .window_first (window_first       ),
        .running      (running            ),
        .spends       (counts             ),
        .half_arrays  (half_arrays        ),
        .exceeded     (exceeded           )
    );
    nirspi_watchdog dog (
        .clk     (clk                     ),
        .rst     (rst                     ),
        .less_1  (settings.watchdog_less_1),
        .arrives (arrives                 ),
        .feed    (feed                    ),
        .barks   (barks                   )
    );

    always_comb opens     = running && !interlock_closed;
    always_comb counts    = running && !opens && !stop;
    always_comb trips     = counts && (over_range || exceeded || barks);
    always_comb permitted = interlock_now && !dropped && fault == 0;
    always_comb permit    = permitted && !opens && !trips && !(running && ends);

    // An interlock that closes again does not light up what is left of its run.
    always_ff @ (posedge clk) begin
        if (rst) begin
            dropped <= 1;
        end else if (!interlock_now) begin
            dropped <= 1;
        end else if (begins) begin
            dropped <= 0;
        end
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            fault <= 0;
        end else if (trips) begin
            if (over_range) begin
                fault <= 3'(nirspi_register_map::FAULT_OVER_RANGE);
            end else if (exceeded) begin
                fault <= 3'(nirspi_register_map::FAULT_DUTY);
            end else begin
                fault <= 3'(nirspi_register_map::FAULT_WATCHDOG);
            end
        end else if (clear) begin
            fault <= 0;
        end else if (opens) begin
            fault <= 3'(nirspi_register_map::FAULT_INTERLOCK);
        end
    end
endmodule
