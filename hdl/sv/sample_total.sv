/// Sums all samples of a frame, for the host's signal meter.
///
/// Invariant: the sum is that of the frame's samples so far that count, this one included, modulo 2^64. Stage 0 is the
/// clock of the sample; the sum is ready in stage 5. The addition takes two stages, with its carry between the halves.
module nirspi_sample_total #(
    parameter int unsigned LOW = 16 /// Bits of the lower part
) (
    input  var logic          clk   ,
    input  var logic          counts, /// Stage 0: not blanked
    input  var logic          first , /// Stage 0: first sample of the frame, which may be blanked
    input  var logic [14-1:0] code  , /// Stage 0
    output var logic [64-1:0] total  /// Stage 5
);
    localparam int unsigned HIGH  = 64 - LOW;
    localparam int unsigned CARRY = LOW + 1;

    logic [14-1:0]    code_1 ;
    logic             first_1;
    logic             first_2;
    logic [CARRY-1:0] low_2  ; // the top bit: the carry
    logic [LOW-1:0]   low_3  ;
    logic [HIGH-1:0]  high_3 ;
    logic [64-1:0]    total_4;

    always_ff @ (posedge clk) begin
        code_1  <= ((counts) ? ( code ) : ( 0 ));
        first_1 <= first;
        first_2 <= first_1;
        low_2   <= CARRY'((((first_1) ? ( 0 ) : ( low_2[LOW - 1:0] )))) + CARRY'(code_1);
        low_3   <= low_2[LOW - 1:0];
        high_3  <= (((first_2) ? ( 0 ) : ( high_3 ))) + HIGH'(low_2[LOW]);
        total_4 <= {high_3, low_3};
        total   <= total_4;
    end
endmodule
