/// Bundles of signals that several modules share.
package nirspi_types;
    /// Settings of one run, all in range, with what the counters need already worked out.
    typedef struct packed {
        logic          raw             ; /// A raw burst instead of frames
        logic          order_table     ;
        logic          order_sequency  ;
        logic          differential    ;
        logic          alternating     ; /// Sweeps differ in which comes first, and in the sign of all lines
        logic          test_source     ;
        logic          unlit           ; /// Lines are shown without light
        logic          packets         ; /// Frames are sent as packets
        logic          narrow          ; /// Samples of a packet have 24 bits
        logic [11-1:0] patterns        ;
        logic [10-1:0] patterns_less_1 ;
        logic          single_pattern  ;
        logic [16-1:0] dwell_less_1    ;
        logic          single_clock    ;
        logic [16-1:0] blank           ;
        logic          unblanked       ;
        logic [6-1:0]  latency         ;
        logic [32-1:0] sweeps          ;
        logic [32-1:0] sweeps_less_1   ;
        logic          single_sweep    ;
        logic [32-1:0] frames_less_1   ;
        logic          single_frame    ;
        logic          endless         ; /// Goes on from frame to frame until halted
        logic [12-1:0] raw_less_1      ;
        logic [27-1:0] watchdog_less_1 ;
        logic [21-1:0] duty_limit      ;
        logic          trips_over_range;
        logic [32-1:0] over_range_trip ;
    } Settings;

    /// What a packet carries beside its frame, as of the start of the run.
    typedef struct packed {
        logic [16-1:0] run       ; /// Number of the run since the firmware's start
        logic [64-1:0] clock_base; /// A clock before the run
        logic [64-1:0] time_base ; /// Device time of that clock in microseconds
    } Stamp;

    /// Where a clock lies in a run. Outside, `index`, `complement`, `inverted` and `sweep_first` mean nothing; the rest is 0.
    typedef struct packed {
        logic          active     ;
        logic          slot_first ;
        logic          slot_last  ;
        logic          counts     ; /// Not blanked
        logic [10-1:0] index      ;
        logic          complement ;
        logic          inverted   ; /// All lines are, which lights the same LEDs
        logic          sweep_first; /// In the first sweep of the frame
        logic          frame_first;
        logic          frame_last ;
        logic          run_last   ;
    } Place;

    /// A sample and the ADC's over-range flag.
    typedef struct packed {
        logic          over_range;
        logic [14-1:0] code      ;
    } Sample;

    /// A frame as the host has it, but for its sums.
    typedef struct packed {
        logic [16-1:0] flags     ;
        logic [32-1:0] number    ;
        logic [32-1:0] over_range;
        logic [32-1:0] lost      ;
        logic [64-1:0] shown_at  ;
        logic [64-1:0] total     ; /// Sum of its samples, which is in registers only
    } Header;

    /// Depth of the machine: clock `t` of a run is done with `DEPTH` clocks after its slot was chosen.
    /// Whatever the host does takes effect there, so that it finds the machine as the model has it.
    localparam int unsigned DEPTH = 13;
endpackage
