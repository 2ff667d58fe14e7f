/// The bytes of frames and bursts on their way to the host port: 16 deep, two clocks.
///
/// Invariant: nothing is written when full and nothing read when empty; pointers cross in Gray code, of
/// which one bit changes at a time. With every byte goes the epoch it was asked for in, so that what an
/// abandoned transfer has left can be told from what follows.
module nirspi_byte_fifo (
    input  var logic         clk_write,
    input  var logic         rst_write,
    input  var logic         push     ,
    input  var logic [9-1:0] push_data,
    output var logic         full     ,
    input  var logic         clk_read ,
    input  var logic         rst_read ,
    input  var logic         pop      ,
    output var logic         empty    ,
    output var logic [9-1:0] pop_data
);
    logic [9-1:0] words [16];

    // Five bits: one more than the address, to tell full from empty.
    logic [5-1:0] written      ;
    logic [5-1:0] written_gray ;
    logic [5-1:0] written_there;
    logic [5-1:0] next_written ;
    logic [5-1:0] taken        ;
    logic [5-1:0] taken_gray   ;
    logic [5-1:0] taken_there  ;
    logic [5-1:0] next_taken   ;

    always_comb next_written = written + 1;
    always_comb next_taken   = taken + 1;
    // Full: the Gray codes differ in their two top bits and in no other.
    always_comb full  = written_gray == (taken_there ^ 5'b11000);
    always_comb empty = taken_gray == written_there;

    always_ff @ (posedge clk_write) begin
        if (rst_write) begin
            written      <= 0;
            written_gray <= 0;
        end else if (push && !full) begin
            written      <= next_written;
            written_gray <= next_written ^ (next_written >> 1);
        end
    end

    always_ff @ (posedge clk_write) begin
        if (push && !full) begin
            words[written[3:0]] <= push_data;
        end
    end

    always_ff @ (posedge clk_read) begin
        if (rst_read) begin
            taken      <= 0;
            taken_gray <= 0;
        end else if (pop && !empty) begin
            taken      <= next_taken;
            taken_gray <= next_taken ^ (next_taken >> 1);
        end
    end

    for (genvar i = 0; i < 5; i++) begin :g_pointers
        nirspi_synchroniser to_read (
            .clk  (clk_read        ),
            .rst  (rst_read        ),
            .from (written_gray[i] ),
            .to   (written_there[i])
        );
        nirspi_synchroniser to_write (
            .clk  (clk_write     ),
            .rst  (rst_write     ),
            .from (taken_gray[i] ),
            .to   (taken_there[i])
        );
    end

    // A word has stood for two clocks when its pointer arrives.

    always_comb pop_data = words[taken[3:0]];

endmodule
