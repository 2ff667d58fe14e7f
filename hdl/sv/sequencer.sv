/// The chain of counters clock, complement, pattern, sweep, frame.
///
/// It is there twice: one drives the LEDs, one attributes samples. Invariant: both count alike. Every
/// counter counts down and its end is a flip-flop, so that no comparison is in the way of another.
module nirspi_sequencer (
    input  var logic                  clk     ,
    input  var logic                  rst     ,
    input  var nirspi_types::Settings settings,
    input  var logic                  start   , /// The next clock is the first
    input  var logic                  halt    , /// Ends the run after this clock, unless `start` is high too
    output var nirspi_types::Place    place
);
    logic          active      ;
    logic [16-1:0] clock_left  ;
    logic          clock_last  ;
    logic          slot_first  ;
    logic [16-1:0] skip_left   ;
    logic          counts      ;
    logic          second      ;
    logic          swapped     ;
    logic          inverted    ;
    logic [10-1:0] index       ;
    logic [10-1:0] index_left  ;
    logic          index_last  ;
    logic [32-1:0] sweep_left  ;
    logic          sweep_first ;
    logic          sweep_last  ;
    logic          frame_first ;
    logic [32-1:0] frames_left ;
    logic          final_frame ;
    logic          pattern_over;
    logic          sweep_over  ;
    logic          frame_over  ;
    logic          run_over    ;

    always_comb begin
        pattern_over = clock_last && (second || !settings.differential);
        sweep_over   = pattern_over && index_last;
        frame_over   = sweep_over && sweep_last;
        run_over     = frame_over && final_frame && !settings.endless;
    end

    always_comb begin
        place.active      = active;
        place.slot_first  = active && slot_first;
        place.slot_last   = active && clock_last;
        place.counts      = active && counts;
        place.index       = index;
        place.complement  = second ^ swapped;
        place.inverted    = inverted;
        place.sweep_first = sweep_first;
        place.frame_first = active && frame_first;
        place.frame_last  = active && frame_over;
        place.run_last    = active && run_over;
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            active <= 0;
        end else if (start) begin
            active <= 1;
        end else if (halt || run_over) begin
            active <= 0;
        end
    end

    // Clock of the slot.
    always_ff @ (posedge clk) begin
        if (rst) begin
            clock_left <= 0;
            clock_last <= 0;
            slot_first <= 0;
            skip_left  <= 0;
            counts     <= 0;
        end else if (start || clock_last) begin
            clock_left <= settings.dwell_less_1;
            clock_last <= settings.single_clock;
            slot_first <= 1;
            skip_left  <= settings.blank;
            counts     <= settings.unblanked;
        end else begin
            clock_left <= clock_left - 1;
            clock_last <= clock_left == 1;
            slot_first <= 0;
            skip_left  <= skip_left - 1;
            counts     <= counts || skip_left == 1;
        end
    end

    // Pattern of the sweep, and its complement, which comes second, or first in every second sweep of the run.
    always_ff @ (posedge clk) begin
        if (rst) begin
            second     <= 0;
            index      <= 0;
            index_left <= 0;
            index_last <= 0;
        end else if (start) begin
            second     <= 0;
            index      <= 0;
            index_left <= settings.patterns_less_1;
            index_last <= settings.single_pattern;
        end else if (pattern_over) begin
            second     <= 0;
            index      <= ((index_last) ? ( 0 ) : ( index + 1 ));
            index_left <= ((index_last) ? ( settings.patterns_less_1 ) : ( index_left - 1 ));
            index_last <= ((index_last) ? ( settings.single_pattern ) : ( index_left == 1 ));
        end else if (clock_last) begin
            second <= 1;
        end
    end

    // Every second pair of sweeps inverts all lines.
    always_ff @ (posedge clk) begin
        if (rst) begin
            swapped  <= 0;
            inverted <= 0;
        end else if (start) begin
            swapped  <= 0;
            inverted <= 0;
        end else if (sweep_over) begin
            swapped  <= settings.alternating && !swapped;
            inverted <= inverted ^ swapped;
        end
    end

    // Sweep of the frame.
    always_ff @ (posedge clk) begin
        if (rst) begin
            sweep_left  <= 0;
            sweep_first <= 0;
            sweep_last  <= 0;
        end else if (start || frame_over) begin
            sweep_left  <= settings.sweeps_less_1;
            sweep_first <= 1;
            sweep_last  <= settings.single_sweep;
        end else if (sweep_over) begin
            sweep_left  <= sweep_left - 1;
            sweep_first <= 0;
            sweep_last  <= sweep_left == 1;
        end
    end

    // Frame of the run.
    always_ff @ (posedge clk) begin
        if (rst) begin
            frame_first <= 0;
            frames_left <= 0;
            final_frame <= 0;
        end else if (start) begin
            frame_first <= 1;
            frames_left <= settings.frames_less_1;
            final_frame <= settings.single_frame;
        end else begin
            frame_first <= frame_over;
            if (frame_over) begin
                frames_left <= frames_left - 1;
                final_frame <= frames_left == 1;
            end
        end
    end
endmodule
