/// Counts over-range samples of a frame or burst and compares with the trip.
///
/// Invariant: the count is that of the frame's samples so far, this one included, and stops at its largest
/// value. Stage 0 is the clock of the sample; count and comparison are ready in stage 5.
module nirspi_over_counter (
    input  var logic          clk    ,
    input  var logic          rst    ,
    input  var logic          trips  , /// There is a trip
    input  var logic [32-1:0] trip   ,
    input  var logic          counts , /// Stage 0: light has arrived
    input  var logic          first  , /// Stage 0: first sample of the frame or burst
    input  var logic          over   , /// Stage 0
    output var logic [32-1:0] count  , /// Stage 5
    output var logic          any    , /// Stage 5: it is not 0
    output var logic          reached /// Stage 5: the trip
);
    logic [3-1:0]  counts_1;
    logic [2-1:0]  first_1 ;
    logic [2-1:0]  over_1  ;
    logic [33-1:0] count_3 ; // the top bit: one more than fits
    logic [32-1:0] count_4 ;
    logic          any_4   ;
    logic          hit_4   ;
    logic [33-1:0] so_far  ;
    logic [32-1:0] fits    ;

    always_comb so_far = ((first_1[1]) ? ( 0 ) : ( count_3 ));
    always_comb fits   = count_3[31:0] | {32{count_3[32]}};

    always_ff @ (posedge clk) begin
        if (rst) begin
            counts_1 <= 0;
            hit_4    <= 0;
            reached  <= 0;
        end else begin
            counts_1 <= {counts_1[1:0], counts};
            hit_4    <= counts_1[2] && trips && fits >= trip;
            reached  <= hit_4;
        end
    end

    always_ff @ (posedge clk) begin
        first_1 <= {first_1[0], first};
        over_1  <= {over_1[0], over};
        count_3 <= so_far + 33'((counts_1[1] && over_1[1] && !so_far[32]));
        count_4 <= fits;
        count   <= count_4;
        any_4   <= fits != 0;
        any     <= any_4;
    end
endmodule
