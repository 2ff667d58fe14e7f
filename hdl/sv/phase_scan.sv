/// Finds the phase at which the ADC is sampled best, and moves the sampling clock there.
///
/// The ADC sends its checkerboard meanwhile. The sampling clock goes through its period twice, so that a window which
/// begins late in the period and ends early in it is seen whole.
///
/// Invariant: when `done` rises, the sampling clock stands in the middle of the longest window of steps in which
/// `pattern_check` found every sample right, or where it stood before if there was no such step; and the ADC has been
/// asked for its own samples again. `done` stays high until the next reset.
module nirspi_phase_scan
    import nirspi_register_map::*;
(
    input var logic          clk_host,
    input var logic          rst_host, /// High while the ADC's clock cannot be used
    input var logic          clk_adc ,
    input var logic          rst_adc ,
    input var logic [14-1:0] code    ,
    // The ADC's serial port: a bit is taken when `serial_clock` rises. It is written to, and never read.
    output var logic serial_select_n,
    output var logic serial_clock   ,
    output var logic serial_data    ,
    // The PLL of the sampling clock: each fall moves it by a step, always in the same direction.
    output var logic          phase_step,
    output var logic          done      ,
    output var logic [32-1:0] sampling   /// The register `Sampling`
);


    typedef enum logic [3-1:0] {
        State_Write,
        State_Rest,
        State_Look,
        State_Release,
        State_Step,
        State_Done
    } State;

    State          state  ;
    logic [8-1:0]  timer  ; // clocks of this state
    logic [2-1:0]  word   ; // that is written, or has been written last
    logic [24-1:0] shift  ;
    logic [5-1:0]  bits   ; // of the word, after this one
    logic [6-1:0]  phase  ;
    logic          again  ; // the second turn
    logic          moves  ; // the scan is over, the clock goes to its place
    logic [6-1:0]  run    ; // right steps up to this one
    logic [6-1:0]  longest;
    logic [6-1:0]  last   ; // step of the longest window

    logic look        ;
    logic checked     ;
    logic right       ;
    logic checked_here;
    logic right_here  ;

    nirspi_pattern_check check (
        .clk     (clk_adc),
        .rst     (rst_adc),
        .code    (code   ),
        .look    (look   ),
        .checked (checked),
        .right   (right  )
    );
    nirspi_synchroniser to_checked (
        .clk  (clk_host    ),
        .rst  (rst_host    ),
        .from (checked     ),
        .to   (checked_here)
    );
    // It stands still while `checked` is high.

    always_comb right_here = right;

    logic [6-1:0] run_here;
    logic [6-1:0] next    ; // step
    logic [6-1:0] middle  ;
    always_comb run_here = ((!right_here) ? ( 0 ) : (run == 6'(SAMPLING_STEPS)) ? ( run ) : ( run + 1 ));
    always_comb next     = ((phase == 6'(SAMPLING_STEPS) - 1) ? ( 0 ) : ( phase + 1 ));
    always_comb middle   = ((last >= longest >> 1) ? (
        last - (longest >> 1)
    ) : (
        last + 6'(SAMPLING_STEPS) - (longest >> 1)
    ));

    always_comb sampling = {7'd0, done, 8'(SAMPLING_STEPS), 2'd0, longest, 2'd0, phase};

    // Outputs leave from flip-flops: another clock, the PLL and the board's resets would take a glitch for an edge.
    always_ff @ (posedge clk_host) begin
        if (rst_host) begin
            look            <= 0;
            serial_select_n <= 1;
            serial_clock    <= 0;
            serial_data     <= 0;
            phase_step      <= 0;
            done            <= 0;
        end else begin
            look            <= state == State_Look;
            serial_select_n <= state != State_Write;
            serial_clock    <= state == State_Write && timer[2];
            serial_data     <= state == State_Write && shift[23];
            phase_step      <= state == State_Step && timer[7:4] == 1;
            done            <= state == State_Done;
        end
    end

    always_ff @ (posedge clk_host) begin
        if (rst_host) begin
            state   <= State_Write;
            timer   <= 0;
            word    <= 0;
            shift   <= 24'(SAMPLING_BEFORE_0);
            bits    <= 23;
            phase   <= 0;
            again   <= 0;
            moves   <= 0;
            run     <= 0;
            longest <= 0;
            last    <= 0;
        end else begin
            timer <= timer + 1;
            case (state)
                State_Write: if (timer[2:0] == 7) begin
                    shift <= shift << 1;
                    bits  <= bits - 1;
                    if (bits == 0) begin
                        state <= State_Rest;
                        timer <= 0;
                    end
                end
                // The ADC takes what was written, and its pipeline fills.
                State_Rest : if (timer == 255) begin
                    word <= word + 1;
                    bits <= 23;
                    case (word)
                        0: begin
                            state <= State_Write;
                            shift <= 24'(SAMPLING_BEFORE_1);
                        end
                        1: state <= State_Look;
                        2: begin
                            state <= State_Write;
                            shift <= 24'(SAMPLING_AFTER_1);
                        end
                        default: state <= State_Done;
                    endcase
                end
                State_Look: if (checked_here) begin
                    state <= State_Release;
                    run   <= run_here;
                    if (run_here > longest) begin
                        longest <= run_here;
                        last    <= phase;
                    end
                end
                State_Release: if (!checked_here) begin
                    state <= State_Step;
                    timer <= 0;
                end
                // A step, and the time that the clock takes to follow.
                State_Step: if (timer == 255) begin
                    phase <= next;
                    state <= State_Look;
                    if (moves) begin
                        state <= ((next == middle) ? ( State_Write ) : ( State_Step ));
                    end else if (next == 0) begin
                        again <= 1;
                        if (again) begin
                            moves <= 1;
                            state <= State_Step;
                        end
                    end
                    shift <= 24'(SAMPLING_AFTER_0);
                end
                default: begin
                end
            endcase
        end
    end
endmodule
