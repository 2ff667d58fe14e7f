/// Attributes samples to slots: latency, blanking, and the sum over a slot.
///
/// Invariant: the sample of clock `t` belongs to what was shown at clock `t - latency`, and counts in
/// exactly one slot. Latency is not a delay line of samples: the sequencer here begins that much later.
module nirspi_window (
    input  var logic                           clk     ,
    input  var logic                           rst     ,
    input  var nirspi_types::Settings          settings,
    input  var logic                           start   , /// Two clocks from now is the sample of a run's clock 0
    input  var logic                           halt    ,
    input  var nirspi_types::Sample            sample  ,
    output var nirspi_types::Place             place   , /// Of this clock's sample
    output var logic                  [30-1:0] sum      /// Of the slot, one clock after its last sample
);
    logic         waiting;
    logic [6-1:0] left   ;
    logic         arrives;

    always_comb arrives = waiting && left == 0;

    always_ff @ (posedge clk) begin
        if (rst) begin
            waiting <= 0;
            left    <= 0;
        end else if (start) begin
            waiting <= !settings.raw;
            left    <= settings.latency;
        end else if (halt || arrives) begin
            waiting <= 0;
        end else begin
            left <= left - 1;
        end
    end

    nirspi_sequencer counters (
        .clk      (clk     ),
        .rst      (rst     ),
        .settings (settings),
        .start    (arrives ),
        .halt     (halt    ),
        .place    (place   )
    );

    always_ff @ (posedge clk) begin
        sum <= (((place.slot_first) ? ( 0 ) : ( sum ))) + (((place.counts) ? ( 30'(sample.code) ) : ( 0 )));
    end
endmodule
