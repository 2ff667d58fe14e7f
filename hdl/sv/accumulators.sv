/// Adds slot sums to one of three banks of 48-bit words, one a clock; the host reads another.
///
/// Invariant: a word is what its slots sum to, however soon a slot comes again. The addition takes a read,
/// two halves and a write, so the sum of a slot that came up to five clocks ago is taken from the stages
/// that still have it. Stage 0 is the clock of the slot's last sample; the word is written in stage 5.
module nirspi_accumulators #(
    parameter int unsigned HALF = 24 /// Bits of half a word
) (
    input  var logic                                clk         ,
    input  var logic                                rst         ,
    input  var logic               [3-1:0]          filling     , /// Bank being summed into, one bit; changes only after a frame's last stage 5
    input  var logic               [3-1:0]          reading     , /// Bank that the host reads, one bit
    input  var nirspi_types::Place                  place       , /// Stage 0
    input  var logic               [30-1:0]         sum         , /// Stage 1
    output var logic                                overflow    , /// Stage 5: a word has wrapped
    input  var logic               [11-1:0]         host_address, /// Complement, index
    output var logic               [(2 * HALF)-1:0] host_word    /// Three clocks after its address
);
    localparam int unsigned WIDTH = 2 * HALF;
    localparam int unsigned CARRY = HALF + 1;

    // What each stage adds, and where: [1] to [6], younger slots first.
    logic [7-1:0]  adds       ;
    logic [11-1:0] address [7];
    logic          first_1    ;
    logic [30-1:0] sum_2      ;
    logic [30-1:0] sum_3      ;

    always_comb adds[0]    = place.slot_last;
    always_comb address[0] = {place.complement, place.index};

    always_ff @ (posedge clk) begin
        if (rst) begin
            adds[6:1] <= 0;
        end else begin
            adds[6:1] <= adds[5:0];
        end
    end

    always_ff @ (posedge clk) begin
        first_1 <= place.sweep_first;
        sum_2   <= sum;
        sum_3   <= sum_2;
    end

    for (genvar i = 1; i < 7; i++) begin :g_address
        always_ff @ (posedge clk) begin
            address[i] <= address[i - 1];
        end
    end

    // Stage 2 to 3: which older slot, if any, has this address. Bit d: the one d clocks older.
    logic [6-1:0] again  ;
    logic [6-1:0] again_2;
    logic [3-1:0] again_3;
    logic         again_4;
    logic         first_2;

    always_comb begin
        again[0] = 0;
        for (int d = 1; d < 6; d++) begin
            again[d] = adds[d + 1] && address[d + 1] == address[1] && !first_1;
        end
    end

    always_ff @ (posedge clk) begin
        first_2 <= first_1;
        again_2 <= again;
        again_3 <= again_2[2:0];
        again_4 <= again_3[1];
    end

    // The banks.
    logic [3-1:0]     bank_1     ;
    logic [3-1:0]     bank_2     ;
    logic [WIDTH-1:0] fetched    ;
    logic [WIDTH-1:0] word    [3];
    logic [HALF-1:0]  high_5     ;
    logic [HALF-1:0]  low_5      ;

    for (genvar i = 0; i < 3; i++) begin :g_bank
        logic ours;
        always_comb ours = filling[i];
        nirspi_bank_ram #(
            .WIDTH (WIDTH)
        ) bank (
            .clk           (clk                                         ),
            .write         (adds[5] && ours                             ),
            .write_address (address[5]                                  ),
            .write_data    ({high_5, low_5}                             ),
            .read_address  (((ours) ? ( address[0] ) : ( host_address ))),
            .read_data     (word[i]                                     )
        );
    end

    always_ff @ (posedge clk) begin
        bank_1    <= filling;
        bank_2    <= bank_1;
        host_word <= ((reading[0]) ? ( word[0] ) : (reading[1]) ? ( word[1] ) : ( word[2] ));
    end
    always_comb fetched = ((bank_2[0]) ? ( word[0] ) : (bank_2[1]) ? ( word[1] ) : ( word[2] ));

    // Stage 3: what is added to. Its low half may still be in stage 4, its high half then is not yet known.
    logic [HALF-1:0]        low_3 ;
    logic [HALF-1:0]        high_3;
    logic [(HALF + 1)-1:0]  low_4 ;
    logic [HALF-1:0]        high_4;
    logic [(30 - HALF)-1:0] sum_4 ;
    logic [WIDTH-1:0]       word_6;
    logic [WIDTH-1:0]       word_7;
    logic [(HALF + 1)-1:0]  total ;

    always_ff @ (posedge clk) begin
        if (first_2) begin
            {high_3, low_3} <= 0;
        end else if (again_2[2]) begin
            {high_3, low_3} <= {high_5, low_4[HALF - 1:0]};
        end else if (again_2[3]) begin
            {high_3, low_3} <= {high_5, low_5};
        end else if (again_2[4]) begin
            {high_3, low_3} <= word_6;
        end else if (again_2[5]) begin
            {high_3, low_3} <= word_7;
        end else begin
            {high_3, low_3} <= fetched;
        end
        // Stage 4: the low half.
        low_4  <= CARRY'((((again_3[1]) ? ( low_4[HALF - 1:0] ) : ( low_3 )))) + CARRY'(sum_3[HALF - 1:0]);
        high_4 <= ((again_3[2]) ? ( high_5 ) : ( high_3 ));
        sum_4  <= sum_3[29:HALF];
        // Stage 5: the high half.
        high_5 <= total[HALF - 1:0];
        low_5  <= low_4[HALF - 1:0];
        word_6 <= {high_5, low_5};
        word_7 <= word_6;
    end
    // One carry chain: the carry of the low half comes in by a bit below.
    logic [(HALF + 2)-1:0] total_below;
    always_comb total_below = {1'b0, ((again_4) ? ( high_5 ) : ( high_4 )), 1'b1} + {CARRY'(sum_4), low_4[HALF]};
    always_comb total       = total_below[HALF + 1:1];

    logic wrapped;
    always_ff @ (posedge clk) begin
        wrapped <= total[HALF];
    end
    always_comb overflow = wrapped && adds[5];
endmodule
