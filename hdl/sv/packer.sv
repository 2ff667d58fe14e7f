/// Makes a delivered bank into a packet that the firmware forwards as it is: differences, postcard, CRC-32, COBS.
///
/// Invariant: the bytes are those of `mcu/wire/src/ready.rs`, and nothing follows the delimiter. A block of COBS
/// begins with its length, so bytes wait in a ring until their block is closed. The first byte waits until 100 bytes
/// are final: they take a host of 60 MHz 416 clocks, and the next block is closed in 345, because a sample of 24 bits
/// takes 4 clocks and one of 32 bits 5. So a host that takes at most six bytes in 25 clocks finds no gap.
module nirspi_packer (
    input  var logic                           clk        ,
    input  var logic                           rst        ,
    input  var nirspi_types::Settings          settings   ,
    input  var nirspi_types::Header            header     ,
    input  var nirspi_types::Stamp             stamp      ,
    input  var logic                           open       , /// Begins with the first byte of the packet
    input  var logic                           close      , /// Ends whatever was going on
    output var logic                  [11-1:0] sum_address,
    input  var logic                  [48-1:0] sum_word   , /// Three clocks after its address
    output var logic                  [8-1:0]  octet      ,
    output var logic                           valid      ,
    input  var logic                           taken       /// The byte goes with this clock
);
    /// What comes after the bytes in hand.
    typedef enum logic [3-1:0] {
        Part_Idle,
        Part_Head,
        Part_Sums,
        Part_Check,
        Part_Closing,
        Part_Delimiter
    } Part;

    // Device time of the frame: the clocks since `clock_base` by 125, a bit a clock.
    logic [7-1:0]  bits_left;
    logic [64-1:0] quotient ; // its upper bits are still those of the dividend
    logic [7-1:0]  remainder;
    logic [8-1:0]  partial  ;
    logic [8-1:0]  reduced  ;
    logic          fits     ;
    logic          timed    ;
    logic [64-1:0] micros   ;

    always_comb partial = {remainder, quotient[63]};
    always_comb reduced = partial - 8'd125;
    always_comb fits    = partial >= 8'd125;

    always_ff @ (posedge clk) begin
        if (rst) begin
            bits_left <= 0;
            timed     <= 0;
        end else if (open) begin
            bits_left <= 64;
            timed     <= 0;
        end else if (bits_left != 0) begin
            bits_left <= bits_left - 1;
        end else begin
            timed <= 1;
        end
    end

    always_ff @ (posedge clk) begin
        if (open) begin
            quotient  <= header.shown_at - stamp.clock_base;
            remainder <= 0;
        end else if (bits_left != 0) begin
            quotient  <= {quotient[62:0], fits};
            remainder <= ((fits) ? ( reduced[6:0] ) : ( partial[6:0] ));
        end
        micros <= quotient + stamp.time_base;
    end

    // The next sample is fetched while the one before goes out. The address of its positive sum stands from then on; with
    // that of its negative sum, which stands for a clock, the index goes on.
    localparam logic [3-1:0] OPENED  = 4;
    localparam logic [3-1:0] BEGINS  = 7;
    localparam logic [3-1:0] FETCHED = 3;

    Part           part      ;
    logic [4-1:0]  bytes_left; // of `word`
    logic [10-1:0] index     ;
    logic [3-1:0]  age       ; // clocks since the address of the negative sum, up to `FETCHED`; at first from `OPENED` on
    logic [32-1:0] positive  ;
    logic [32-1:0] sample    ;
    logic          loads     ;
    logic          fetches   ;

    always_comb sum_address = {fetches, index};
    always_comb loads       = part == Part_Sums && bytes_left == 0 && age == FETCHED;
    always_comb fetches     = loads || age == BEGINS;

    always_ff @ (posedge clk) begin
        if (open) begin
            age   <= OPENED;
            index <= 0;
        end else if (fetches) begin
            age   <= 0;
            index <= index + 1;
        end else if (age != FETCHED) begin
            age <= age + 1;
        end
        if (age == 1) begin
            positive <= sum_word[31:0];
        end
        if (age == 2) begin
            sample <= positive - (((settings.differential) ? ( sum_word[31:0] ) : ( 0 )));
        end
    end

    // Bytes of all samples: 4 or 3 of each.
    logic [13-1:0] all_of_four;
    logic [13-1:0] length     ;

    always_comb all_of_four = {settings.patterns, 2'b0};

    always_ff @ (posedge clk) begin
        length <= all_of_four - (((settings.narrow) ? ( {2'b0, settings.patterns} ) : ( 0 )));
    end

    // Bytes of the message, lowest first, and the ring in which their blocks grow.
    logic [64-1:0] word    ;
    logic          padded  ; // a number, seven bits a byte
    logic [3-1:0]  field   ; // of the header
    logic [32-1:0] crc     ;
    logic [8-1:0]  next    ;
    logic [11-1:0] code_at ; // of the open block's length; everything before it is final
    logic [11-1:0] next_at ;
    logic [8-1:0]  distance; // from the one to the other
    logic [11-1:0] read_at ;
    logic [11-1:0] used    ;
    logic          puts    ;
    logic          full    ;
    logic          ends    ;

    always_comb next = ((padded) ? ( {bytes_left != 1, word[6:0]} ) : ( word[7:0] ));
    always_comb used = next_at - read_at;
    always_comb puts = bytes_left != 0 && !used[10];
    always_comb full = distance == 255;
    always_comb ends = full || next == 0;

    nirspi_crc32 check (
        .clk   (clk          ),
        .clear (open         ),
        .take  (puts && !full),
        .octet (next         ),
        .value (crc          )
    );

    logic         write     ;
    logic [8-1:0] write_data;
    always_comb write      = puts || bytes_left == 0 && (part == Part_Closing || part == Part_Delimiter);
    always_comb write_data = ((part == Part_Delimiter) ? ( 0 ) : (puts && !ends) ? ( next ) : ( distance ));

    nirspi_bank_ram #(
        .WIDTH (8)
    ) ring (
        .clk           (clk                                          ),
        .write         (write                                        ),
        .write_address (((puts && !ends) ? ( next_at ) : ( code_at ))),
        .write_data    (write_data                                   ),
        .read_address  (read_at                                      ),
        .read_data     (octet                                        )
    );

    always_ff @ (posedge clk) begin
        if (rst) begin
            part       <= Part_Idle;
            word       <= 0;
            bytes_left <= 0;
            padded     <= 0;
            field      <= 0;
            code_at    <= 0;
            next_at    <= 1;
            distance   <= 1;
        end else if (open || close) begin
            part       <= ((open) ? ( Part_Head ) : ( Part_Idle ));
            bytes_left <= 0;
            field      <= 0;
            code_at    <= 0;
            next_at    <= 1;
            distance   <= 1;
        end else if (bytes_left != 0) begin
            if (puts) begin
                next_at  <= next_at + 1;
                distance <= ((ends) ? ( 1 ) : ( distance + 1 ));
                if (ends) begin
                    code_at <= next_at;
                end
                // A full block takes a clock for its length and none of the bytes.
                if (!full) begin
                    word       <= ((padded) ? ( word >> 7 ) : ( word >> 8 ));
                    bytes_left <= bytes_left - 1;
                end
            end
        end else begin
            case (part)
                Part_Head: begin
                    field  <= field + 1;
                    padded <= 1;
                    case (field)
                        0: begin
                            word       <= 1;
                            bytes_left <= 1;
                            padded     <= 0;
                        end
                        1: begin
                            word       <= 64'(stamp.run);
                            bytes_left <= 3;
                        end
                        2: begin
                            word       <= 64'(header.number);
                            bytes_left <= 5;
                        end
                        3: begin
                            word <= micros;
                            if (timed) begin
                                bytes_left <= 10;
                            end else begin
                                field <= 3;
                            end
                        end
                        4: begin
                            word       <= 64'(settings.sweeps);
                            bytes_left <= 5;
                        end
                        5: begin
                            word       <= 64'(header.flags);
                            bytes_left <= 3;
                        end
                        6: begin
                            word       <= ((settings.narrow) ? ( 64'(nirspi_register_map::SAMPLES_NARROW) ) : ( 0 ));
                            bytes_left <= 1;
                            padded     <= 0;
                        end
                        default: begin
                            word       <= 64'(length);
                            bytes_left <= 2;
                            part       <= Part_Sums;
                        end
                    endcase
                end
                Part_Sums: if (loads) begin
                    word       <= {32'b0, sample};
                    bytes_left <= ((settings.narrow) ? ( 3 ) : ( 4 ));
                    padded     <= 0;
                    // The index is that of the next sample; 1024 patterns count as 0.
                    if (index == settings.patterns[9:0]) begin
                        part <= Part_Check;
                    end
                end
                Part_Check: begin
                    word       <= {32'b0, crc};
                    bytes_left <= 4;
                    part       <= Part_Closing;
                end
                Part_Closing: begin
                    code_at <= next_at;
                    part    <= Part_Delimiter;
                end
                Part_Delimiter: begin
                    code_at <= code_at + 1;
                    part    <= Part_Idle;
                end
                default: begin
                end
            endcase
        end
    end

    // What is final goes out, once there is enough of it.
    logic seen ;
    logic flows;
    always_ff @ (posedge clk) begin
        if (rst) begin
            flows <= 0;
        end else if (open || close) begin
            flows <= 0;
        end else if (code_at >= 100 || part == Part_Idle) begin
            flows <= 1;
        end
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            read_at <= 0;
            seen    <= 0;
            valid   <= 0;
        end else if (open || close) begin
            read_at <= 0;
            seen    <= 0;
            valid   <= 0;
        end else if (valid) begin
            if (taken) begin
                read_at <= read_at + 1;
                seen    <= 0;
                valid   <= 0;
            end
        end else if (flows && read_at != code_at) begin
            seen  <= 1;
            valid <= seen;
        end
    end
endmodule
