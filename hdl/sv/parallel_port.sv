/// Packets on eight lines, with a clock that the FPGA makes: one period in three clocks.
///
/// Invariant: every byte of a packet goes out once and in order, with a zero before the packet and three behind its
/// delimiter. A period has a byte only if `ready` was high in the clock before it. The lines change when the strobe
/// falls, and the receiver takes them when it rises, half a period later. A start cuts the packet under way; the zero
/// before the next one ends it. Nothing here crosses clocks.
module nirspi_parallel_port (
    input  var logic         clk      ,
    input  var logic         rst      ,
    input  var logic         on       , /// Frames of the run go here; changes after `restart` alone
    input  var logic         restart  , /// A run begins
    input  var logic         frame    , /// There is a frame
    input  var logic         ready    , /// The receiver takes bytes
    output var logic         open     , /// The packet of that frame is asked for
    input  var logic [8-1:0] octet    ,
    input  var logic         valid    ,
    output var logic         taken    , /// The byte goes with this clock
    output var logic         give_back, /// The frame has been sent
    // Pins.
    output var logic [2-1:0] strobe, /// Its levels in the first and in the second half of this clock
    output var logic [8-1:0] lines ,
    output var logic         enable /// The lines hold a byte in this period
);
    /// What the next byte is.
    typedef enum logic [3-1:0] {
        Part_Idle,
        Part_Before,
        Part_Packet,
        Part_Behind,
        Part_Sent
    } Part;

    Part          part ;
    logic [2-1:0] left ; // zeros behind the packet, but for one
    logic [2-1:0] phase; // of the period
    logic         runs ; // the strobe has this period
    logic         there; // there is a byte to send
    logic         puts ; // the next period has a byte

    always_comb open      = part == Part_Idle && on && frame && !restart;
    always_comb give_back = part == Part_Sent;
    always_comb there     = part == Part_Before || part == Part_Packet && valid || part == Part_Behind;
    always_comb puts      = phase == 2 && ready && there;
    always_comb taken     = puts && part == Part_Packet;

    always_ff @ (posedge clk) begin
        if (rst) begin
            part <= Part_Idle;
            left <= 0;
        end else if (restart) begin
            part <= Part_Idle;
        end else begin
            case (part)
                Part_Idle  : if (open) begin
                    part <= Part_Before;
                end
                Part_Before: if (puts) begin
                    part <= Part_Packet;
                end
                Part_Packet: if (puts && octet == 0) begin
                    part <= Part_Behind;
                    left <= 2;
                end
                Part_Behind: if (puts) begin
                    left <= left - 1;
                    if (left == 0) begin
                        part <= Part_Sent;
                    end
                end
                default    : part <= Part_Idle;
            endcase
        end
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            phase  <= 0;
            runs   <= 0;
            strobe <= 0;
            lines  <= 0;
            enable <= 0;
        end else begin
            strobe[1] <= runs && phase == 1;
            strobe[0] <= runs && phase != 2;
            if (phase == 2) begin
                phase  <= 0;
                runs   <= on;
                enable <= puts;
                lines  <= ((taken) ? ( octet ) : ( 0 ));
            end else begin
                phase <= phase + 1;
            end
        end
    end
endmodule
