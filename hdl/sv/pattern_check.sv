/// Looks whether the ADC's samples are its checkerboard.
///
/// Invariant: while `checked` is high, `right` stands still, and says whether each of the last `SAMPLING_SAMPLES`
/// samples was one of the two of the checkerboard and other than the sample before it. `checked` rises only when
/// `look` has been low since it was last high.
module nirspi_pattern_check
    import nirspi_register_map::*;
(
    input  var logic          clk    ,
    input  var logic          rst    ,
    input  var logic [14-1:0] code   ,
    input  var logic          look   , /// Stands until `checked` is high, and is low until it is low again
    output var logic          checked,
    output var logic          right
);


    logic          looks;
    logic [14-1:0] last ;
    logic [16-1:0] left ; // samples after this one
    logic          one  ; // this sample is right

    nirspi_synchroniser to_looks (
        .clk  (clk  ),
        .rst  (rst  ),
        .from (look ),
        .to   (looks)
    );

    always_comb one = code == ~last && (code == 14'(SAMPLING_CHECKERBOARD) || last == 14'(SAMPLING_CHECKERBOARD));

    always_ff @ (posedge clk) begin
        if (rst) begin
            last    <= 0;
            left    <= 0;
            checked <= 0;
            right   <= 0;
        end else begin
            last <= code;
            if (!looks) begin
                left    <= 16'((SAMPLING_SAMPLES - 1));
                checked <= 0;
                right   <= 1;
            end else if (!checked) begin
                left    <= left - 1;
                checked <= left == 0;
                right   <= right && one;
            end
        end
    end
endmodule
