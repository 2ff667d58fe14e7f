/// Which bank the host has, the header that goes with it, and the counters of the run.
///
/// Invariant: a bank is either being summed into or delivered, never both; so no frame mixes two.
module nirspi_frames (
    input  var logic                           clk       ,
    input  var logic                           rst       ,
    input  var nirspi_types::Settings          settings  ,
    input  var logic                  [64-1:0] clock_now , /// Since reset, of this clock
    input  var logic                  [64-1:0] light_next, /// Clock at which the sample after this one's light was shown
    input  var logic                           restart   , /// Forgets everything of earlier runs
    input  var logic                           give_back , /// The host gives its frame back before this clock
    input  var logic                           first     , /// This clock is the first of a run
    input  var logic                           done      , /// This clock completes a frame
    input  var logic                  [32-1:0] over_range, /// Over-range samples of the frame
    input  var logic                           over_any  , /// There are some
    input  var logic                  [64-1:0] total     , /// Sum of the frame's samples
    input  var logic                           overflow  , /// A sum wraps with this clock
    input  var logic                           counts    , /// This clock is one of a run
    output var logic                           filling   ,
    output var logic                           ready     ,
    output var logic                  [32-1:0] made      ,
    output var logic                  [32-1:0] lost      ,
    output var nirspi_types::Header            header
);
    logic [64-1:0] shown     ;
    logic          wrapped   ;
    logic          after_loss;
    logic          held      ;
    logic [16-1:0] flags     ;

    always_comb held = ready && !give_back;

    always_comb begin
        flags = 0;
        if (over_any) begin
            flags |= 16'(nirspi_register_map::FLAG_OVER_RANGE);
        end
        if (wrapped || overflow) begin
            flags |= 16'(nirspi_register_map::FLAG_OVERFLOW);
        end
        if (after_loss) begin
            flags |= 16'(nirspi_register_map::FLAG_AFTER_LOSS);
        end
        if (settings.test_source) begin
            flags |= 16'(nirspi_register_map::FLAG_TEST_SOURCE);
        end
        if (settings.differential) begin
            flags |= 16'(nirspi_register_map::FLAG_DIFFERENTIAL);
        end
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            filling    <= 0;
            ready      <= 0;
            made       <= 0;
            lost       <= 0;
            wrapped    <= 0;
            after_loss <= 0;
        end else if (restart) begin
            ready      <= 0;
            made       <= 0;
            lost       <= 0;
            wrapped    <= 0;
            after_loss <= 0;
        end else if (done) begin
            wrapped <= 0;
            made    <= made + 1;
            ready   <= 1;
            if (held) begin
                lost       <= lost + 1;
                after_loss <= 1;
            end else begin
                filling    <= ~filling;
                after_loss <= 0;
            end
        end else begin
            ready   <= held;
            wrapped <= wrapped || overflow && counts;
        end
    end

    always_ff @ (posedge clk) begin
        if (done) begin
            shown <= light_next;
        end else if (first) begin
            shown <= clock_now;
        end
        if (done && !held) begin
            header.flags      <= flags;
            header.number     <= made;
            header.over_range <= over_range;
            header.lost       <= lost;
            header.total      <= total;
            header.shown_at   <= ((first) ? ( clock_now ) : ( shown ));
        end
    end
endmodule
