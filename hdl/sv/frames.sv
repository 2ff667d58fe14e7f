/// Which of the three banks the host has, which one waits behind it, the headers that go with them, and the counters
/// of the run.
///
/// Invariant: a bank is being summed into, delivered, waiting or free, and only one of these; so no frame mixes two.
/// Banks are filled in turn, and frames are delivered in the order in which they were made.
module nirspi_frames (
    input  var logic                           clk       ,
    input  var logic                           rst       ,
    input  var nirspi_types::Settings          settings  ,
    input  var logic                  [64-1:0] clock_now , /// Since reset, of this clock
    input  var logic                  [64-1:0] light_next, /// Clock at which the sample after this one's light was shown
    input  var logic                           restart   , /// Forgets everything of earlier runs
    input  var logic                           give_back , /// The host has released its frame; the waiting frame becomes the host's
    input  var logic                           first     , /// This clock is the first of a run
    input  var logic                           done      , /// This clock completes a frame
    input  var logic                  [32-1:0] over_range, /// Over-range samples of the frame
    input  var logic                           over_any  , /// There are some
    input  var logic                  [64-1:0] total     , /// Sum of the frame's samples
    input  var logic                           overflow  , /// A sum wraps with this clock
    input  var logic                           counts    , /// This clock is one of a run
    output var logic                  [3-1:0]  filling   , /// Bank being summed into; one bit is set
    output var logic                  [3-1:0]  reading   , /// Bank of the host's frame, in which no sum changes while `ready`
    output var logic                           ready     , /// The host has a frame
    output var logic                  [32-1:0] made      ,
    output var logic                  [32-1:0] lost      ,
    output var nirspi_types::Header            header
);
    logic [64-1:0] shown     ;
    logic          wrapped   ;
    logic          after_loss;
    logic [16-1:0] flags     ;

    // The oldest frame is the host's, the other waits.
    logic                behind    ; // there is one that waits
    logic                gives     ; // the host gives a frame back
    logic                held      ; // the host has a frame all the same
    logic                full      ; // both wait for the host, so that no bank is left for a third
    nirspi_types::Header newest    ; // of the frame that this clock completes
    nirspi_types::Header header_two; // of the frame that waits

    always_comb gives = give_back && ready;
    always_comb held  = ((give_back) ? ( behind ) : ( ready ));
    always_comb full  = behind && !give_back;

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
            filling    <= 3'b001;
            reading    <= 3'b001;
            ready      <= 0;
            behind     <= 0;
            made       <= 0;
            lost       <= 0;
            wrapped    <= 0;
            after_loss <= 0;
        end else if (restart) begin
            reading    <= filling;
            ready      <= 0;
            behind     <= 0;
            made       <= 0;
            lost       <= 0;
            wrapped    <= 0;
            after_loss <= 0;
        end else if (done) begin
            wrapped <= 0;
            made    <= made + 1;
            ready   <= 1;
            behind  <= held;
            if (full) begin
                lost       <= lost + 1;
                after_loss <= 1;
            end else begin
                filling    <= {filling[1:0], filling[2]};
                after_loss <= 0;
            end
            if (gives) begin
                reading <= {reading[1:0], reading[2]};
            end
        end else begin
            ready   <= held;
            behind  <= full;
            wrapped <= wrapped || overflow && counts;
            if (gives) begin
                reading <= {reading[1:0], reading[2]};
            end
        end
    end

    always_comb begin
        newest.flags      = flags;
        newest.number     = made;
        newest.over_range = over_range;
        newest.lost       = lost;
        newest.total      = total;
        newest.shown_at   = ((first) ? ( clock_now ) : ( shown ));
    end

    always_ff @ (posedge clk) begin
        if (done) begin
            shown <= light_next;
        end else if (first) begin
            shown <= clock_now;
        end
        if (done && !held) begin
            header <= newest;
        end else if (gives) begin
            header <= header_two;
        end
        // Without a frame at the host nothing waits, and the header of what waits means nothing.
        if (done && !full) begin
            header_two <= newest;
        end
    end
endmodule
