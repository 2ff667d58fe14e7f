/// Turns a delivered bank or burst into the bytes of the host port.
///
/// Invariant: the layout is that of `mcu/wire/src/fpga.rs`; without complements the negative half reads 0,
/// whatever an earlier run has left in its RAM. Bytes stop when all are out; what the host reads beyond is
/// its own port's padding.
module nirspi_formatter (
    input  var logic                           clk        ,
    input  var logic                           rst        ,
    input  var nirspi_types::Settings          settings   ,
    input  var nirspi_types::Header            header     ,
    input  var logic                           open_frame , /// Begins with the first byte of the frame
    input  var logic                           open_raw   , /// Begins with the first byte of the burst
    input  var logic                           open_none  , /// Ends whatever was going on
    output var logic                  [11-1:0] sum_address,
    input  var logic                  [48-1:0] sum_word   , /// Three clocks after its address
    output var logic                  [12-1:0] raw_address,
    input  var logic                  [16-1:0] raw_word   , /// Two clocks after its address
    output var logic                  [8-1:0]  octet      ,
    output var logic                           valid      ,
    input  var logic                           taken       /// The byte goes with this clock
);
    /// What the bytes in hand are of.
    typedef enum logic [3-1:0] {
        Part_Idle,
        Part_Head,
        Part_Sums,
        Part_Check,
        Part_Burst
    } Part;

    Part           part      ;
    logic [64-1:0] word      ; // lowest byte first
    logic [4-1:0]  bytes_left; // of `word`
    logic [3-1:0]  fetching  ; // clocks until the next word is there
    logic [2-1:0]  chunk     ; // of the header
    logic [10-1:0] index     ;
    logic          negative  ;
    logic [12-1:0] raw_index ;
    logic          covered   ; // by the checksum
    logic [32-1:0] crc       ;

    always_comb sum_address = {negative, index};
    always_comb raw_address = raw_index;
    always_comb octet       = word[7:0];
    always_comb valid       = bytes_left != 0;

    nirspi_crc32 check (
        .clk   (clk                      ),
        .clear (open_frame               ),
        .take  (valid && taken && covered),
        .octet (octet                    ),
        .value (crc                      )
    );

    always_ff @ (posedge clk) begin
        if (rst) begin
            part       <= Part_Idle;
            word       <= 0;
            bytes_left <= 0;
            fetching   <= 0;
            chunk      <= 0;
            index      <= 0;
            negative   <= 0;
            raw_index  <= 0;
            covered    <= 0;
        end else if (open_frame || open_raw || open_none) begin
            part       <= ((open_frame) ? ( Part_Head ) : (open_raw) ? ( Part_Burst ) : ( Part_Idle ));
            bytes_left <= 0;
            fetching   <= 4;
            chunk      <= 0;
            index      <= 0;
            negative   <= 0;
            raw_index  <= 0;
            covered    <= open_frame;
        end else if (valid) begin
            if (taken) begin
                word       <= word >> 8;
                bytes_left <= bytes_left - 1;
                fetching   <= 4;
            end
        end else if (fetching != 0) begin
            fetching <= fetching - 1;
        end else begin
            case (part)
                Part_Head: begin
                    chunk      <= chunk + 1;
                    bytes_left <= 8;
                    case (chunk)
                        0      : word <= {header.flags, 5'b0, settings.patterns, 32'(nirspi_register_map::FRAME_MAGIC)};
                        1      : word <= {settings.sweeps, header.number};
                        2      : word <= {header.lost, header.over_range};
                        default: begin
                            word <= header.shown_at;
                            part <= Part_Sums;
                        end
                    endcase
                end
                Part_Sums: begin
                    word       <= ((negative && !settings.differential) ? ( 0 ) : ( {16'b0, sum_word} ));
                    bytes_left <= 6;
                    negative   <= ~negative;
                    if (negative) begin
                        index <= index + 1;
                        if (index == settings.patterns_less_1) begin
                            part <= Part_Check;
                        end
                    end
                end
                Part_Check: begin
                    word       <= {32'b0, crc};
                    bytes_left <= 4;
                    covered    <= 0;
                    part       <= Part_Idle;
                end
                Part_Burst: begin
                    word       <= {48'b0, raw_word};
                    bytes_left <= 2;
                    raw_index  <= raw_index + 1;
                    if (raw_index == settings.raw_less_1) begin
                        part <= Part_Idle;
                    end
                end
                default: begin
                end
            endcase
        end
    end
endmodule
