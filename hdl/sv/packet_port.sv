/// Reads of packets that are clocked by `sck` itself: opcode, four clocks of address, dummy cycles, bytes.
///
/// Invariant: a read gives the bytes of its own access, once and in order, and zeros before and after. Both pointers
/// begin at 0 with each read: while the port is not selected, the pin holds `sck`'s half in reset, and the ADC's half
/// clears its own pointer. Eight clocks of `sck` are longer than that takes. Pointers cross in Gray code.
module nirspi_packet_port
    import nirspi_register_map::*;
(
    input var logic clk_adc,
    input var logic rst_adc,
    input var logic clk_sck,
    input var logic rst_sck, /// High while the port is not selected
    // Pins.
    input  var logic         line     , /// `io0`
    output var logic [4-1:0] lines_out,
    output var logic         drives   ,
    // The port that samples its pins.
    input  var logic may_begin, /// That port has seen no opcode yet, and the ADC's domain answers
    output var logic reads    , /// The opcode has come; falls with the pin
    // Bytes.
    input  var logic         access    , /// An access takes effect
    input  var logic [8-1:0] octet     ,
    input  var logic         byte_valid,
    output var logic         takes     , /// Bytes go here, and nowhere else
    output var logic         full
);

    /// Clocks of `sck` before the one that makes the first bits.
    localparam logic [32-1:0] LEAD = 11 + HOST_DUMMY_CYCLES;

    logic [8-1:0] words [16];

    // Five bits: one more than the address, to tell full from empty.
    logic [5-1:0] written     ;
    logic [5-1:0] written_gray;
    logic [5-1:0] next_written;
    logic [5-1:0] taken_there ;
    logic         reads_there ;
    logic         push        ;

    logic [5-1:0] clocks      ; // of this access, up to 31
    logic [7-1:0] shifted     ;
    logic         second      ; // the lower half of a byte comes next
    logic [4-1:0] low         ;
    logic [5-1:0] taken       ;
    logic [5-1:0] taken_gray  ;
    logic [5-1:0] next_taken  ;
    logic [5-1:0] written_once;
    logic [5-1:0] written_here;
    logic         empty       ;
    logic [8-1:0] byte_now    ;

    nirspi_synchroniser to_reads (
        .clk  (clk_adc    ),
        .rst  (rst_adc    ),
        .from (reads      ),
        .to   (reads_there)
    );
    for (genvar i = 0; i < 5; i++) begin :g_taken
        nirspi_synchroniser to_taken (
            .clk  (clk_adc       ),
            .rst  (rst_adc       ),
            .from (taken_gray[i] ),
            .to   (taken_there[i])
        );
    end

    always_comb next_written = written + 1;
    always_comb full         = written_gray == (taken_there ^ 5'b11000);
    always_comb push         = takes && byte_valid && !full;

    // Bytes that an earlier access has left come before this one's access takes effect.
    always_ff @ (posedge clk_adc) begin
        if (rst_adc) begin
            takes        <= 0;
            written      <= 0;
            written_gray <= 0;
        end else if (!reads_there) begin
            takes        <= 0;
            written      <= 0;
            written_gray <= 0;
        end else begin
            if (access) begin
                takes <= 1;
            end
            if (push) begin
                written      <= next_written;
                written_gray <= next_written ^ (next_written >> 1);
            end
        end
    end

    always_ff @ (posedge clk_adc) begin
        if (push) begin
            words[written[3:0]] <= octet;
        end
    end

    always_comb next_taken = taken + 1;
    always_comb empty      = taken_gray == written_here;
    // A word has stood for two clocks when its pointer arrives.

    always_comb byte_now = ((empty) ? ( 0 ) : ( words[taken[3:0]] ));

    always_ff @ (posedge clk_sck, posedge rst_sck) begin
        if (rst_sck) begin
            clocks       <= 0;
            shifted      <= 0;
            reads        <= 0;
            drives       <= 0;
            second       <= 0;
            low          <= 0;
            lines_out    <= 0;
            taken        <= 0;
            taken_gray   <= 0;
            written_once <= 0;
            written_here <= 0;
        end else begin
            written_once <= written_gray;
            written_here <= written_once;
            shifted      <= {shifted[5:0], line};
            if (clocks != 31) begin
                clocks <= clocks + 1;
            end
            if (clocks == 7) begin
                reads <= may_begin && {shifted, line} == (HOST_PACKET[7:0] | HOST_QUAD[7:0]);
            end
            if (reads && clocks >= 5'(LEAD)) begin
                drives <= 1;
                second <= ~second;
                if (second) begin
                    lines_out <= low;
                end else begin
                    lines_out <= byte_now[7:4];
                    low       <= byte_now[3:0];
                    if (!empty) begin
                        taken      <= next_taken;
                        taken_gray <= next_taken ^ (next_taken >> 1);
                    end
                end
            end
        end
    end

endmodule
