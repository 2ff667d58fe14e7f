/// The host port: an SPI slave (mode 0) that also goes by four lines.
///
/// Invariant: the pins are sampled, never clocked by; so `sck` may stop anywhere and a transfer that is cut
/// short leaves nothing behind. A write whose check is wrong does nothing. The command set is
/// `mcu/wire/src/host_port.rs`.
module nirspi_spi_slave
    import nirspi_register_map::*;
(
    input var logic clk,
    input var logic rst,
    // Pins, in step with `clk`.
    input  var logic         sck      ,
    input  var logic         selected ,
    input  var logic [4-1:0] lines_in ,
    output var logic [4-1:0] lines_out,
    output var logic [4-1:0] drive    ,
    // The port that is clocked by `sck`.
    output var logic beginning, /// The access is younger than the opcode of the slowest host that may use that port
    input  var logic packet   , /// That port reads: its opcode has come
    input  var logic idle     , /// An access would be taken
    // Accesses.
    output var logic          send     ,
    output var logic [2-1:0]  operation,
    output var logic [16-1:0] address  ,
    output var logic [32-1:0] data     ,
    input  var logic          back     ,
    input  var logic [32-1:0] value    ,
    // Bytes of a frame or burst.
    input  var logic         epoch    ,
    input  var logic         empty    ,
    input  var logic [9-1:0] fifo_data,
    output var logic         pop
);


    typedef enum logic [3-1:0] {
        Phase_Opcode,
        Phase_Address,
        Phase_Data,
        Phase_Check,
        Phase_Dummy,
        Phase_Answer,
        Phase_Over
    } Phase;

    /// The opcode of a faster read has come by then (227 ns or more). Eight edges of this port's fastest `sck` take 45
    /// clocks, and 30 with a glitch in every second period.
    localparam logic [5-1:0] YOUNG = 5'd25;

    Phase          phase   ;
    logic [6-1:0]  left    ; // cycles of the phase after this one
    logic          quad    ;
    logic [32-1:0] shifted ;
    logic [32-1:0] next    ;
    logic          sck_last;
    logic          rises   ;
    logic          asked   ; // for the frame that `packet` reads
    logic [5-1:0]  age     ; // clocks since the port was selected, up to `YOUNG`
    logic          known   ;
    logic [32-1:0] out     ;
    logic [5-1:0]  out_left; // cycles until the next byte of a frame
    logic          streams ;
    logic          stale   ;
    logic [8-1:0]  byte_now;
    logic [16-1:0] check   ; // of address and value so far
    logic [16-1:0] one     ; // with so many of the bits
    logic [16-1:0] two     ;
    logic [16-1:0] three   ;
    logic [16-1:0] four    ;
    logic [16-1:0] extended; // with the bits of this cycle
    logic [4-1:0]  bits    ; // those bits, the first on the left; one line has one
    logic          takes   ;

    always_comb rises     = sck && !sck_last;
    always_comb beginning = phase == Phase_Opcode && age != YOUNG;
    always_comb next      = ((quad) ? ( {shifted[27:0], lines_in} ) : ( {shifted[30:0], lines_in[0]} ));
    always_comb known     = next[6:2] == HOST_WRITE[6:2];

    // A byte of an earlier transfer is thrown away at once; a missing one reads 0.
    always_comb stale    = !empty && fifo_data[8] != epoch;
    always_comb byte_now = ((empty || stale) ? ( 0 ) : ( fifo_data[7:0] ));
    always_comb takes    = rises && selected && streams
        && (phase == Phase_Dummy && left == 0 || phase == Phase_Answer && out_left == 0);
    always_comb pop = stale || takes;

    /// The check after one more bit.
    function automatic logic [16-1:0] extend(
        input var logic [16-1:0] so_far,
        input var logic          first
    ) ;
        return {so_far[14:0], 1'b0} ^ (HOST_CHECK_POLYNOMIAL[15:0] & {16{so_far[15] ^ first}});
    endfunction

    always_comb begin
        if (phase == Phase_Answer) begin
            bits = out[31:28];
        end else begin
            bits = ((quad) ? ( lines_in ) : ( {lines_in[0], 3'b0} ));
        end
    end
    always_comb one      = extend(check, bits[3]);
    always_comb two      = extend(one, bits[2]);
    always_comb three    = extend(two, bits[1]);
    always_comb four     = extend(three, bits[0]);
    always_comb extended = ((quad) ? ( four ) : ( one ));

    always_comb lines_out = ((quad) ? ( out[31:28] ) : ( {2'b0, out[31], 1'b0} ));

    always_ff @ (posedge clk) begin
        if (rst) begin
            sck_last  <= 0;
            asked     <= 0;
            age       <= 0;
            phase     <= Phase_Opcode;
            left      <= 7;
            quad      <= 0;
            shifted   <= 0;
            out       <= 0;
            out_left  <= 0;
            streams   <= 0;
            drive     <= 0;
            send      <= 0;
            operation <= 0;
            address   <= 0;
            data      <= 0;
            check     <= 0;
        end else begin
            sck_last <= sck;
            asked    <= packet && (asked || idle);
            age      <= ((!selected) ? ( 0 ) : (age == YOUNG) ? ( age ) : ( age + 1 ));
            send     <= 0;
            if (packet) begin
                // Before this port has seen twelve edges of `sck`, so nothing has been sent or driven.
                phase     <= Phase_Over;
                operation <= HOST_FRAME[1:0];
                send      <= idle && !asked;
            end else if (!selected) begin
                phase   <= Phase_Opcode;
                left    <= 7;
                quad    <= 0;
                streams <= 0;
                drive   <= 0;
            end else if (rises) begin
                shifted <= next;
                left    <= left - 1;
                case (phase)
                    Phase_Opcode : if (left == 0) begin
                        quad      <= next[7];
                        operation <= next[1:0];
                        streams   <= next[1];
                        phase     <= ((known) ? ( Phase_Address ) : ( Phase_Over ));
                        left      <= ((next[7]) ? ( 3 ) : ( 15 ));
                        check     <= HOST_CHECK_SEED[15:0];
                    end
                    Phase_Address: begin
                        check <= extended;
                        if (left == 0) begin
                            address <= next[15:0];
                            if (operation == HOST_WRITE[1:0]) begin
                                phase <= Phase_Data;
                                left  <= ((quad) ? ( 7 ) : ( 31 ));
                            end else begin
                                phase <= Phase_Dummy;
                                left  <= 6'((HOST_DUMMY_CYCLES - 1));
                                send  <= 1;
                            end
                        end
                    end
                    Phase_Data: begin
                        check <= extended;
                        if (left == 0) begin
                            data  <= next;
                            phase <= Phase_Check;
                            left  <= ((quad) ? ( 3 ) : ( 15 ));
                        end
                    end
                    Phase_Check: begin
                        check <= extended;
                        if (left == 0) begin
                            // A check that is extended by itself is 0.
                            phase <= Phase_Over;
                            send  <= extended == 0;
                        end
                    end
                    Phase_Dummy : if (left == 0) begin
                        phase    <= Phase_Answer;
                        left     <= ((quad) ? ( 7 ) : ( 31 ));
                        drive    <= ((quad) ? ( 4'b1111 ) : ( 4'b0010 ));
                        out_left <= ((quad) ? ( 1 ) : ( 7 ));
                        if (streams) begin
                            out <= {byte_now, 24'b0};
                        end
                    end
                    Phase_Answer: if (streams && out_left == 0) begin
                        out      <= {byte_now, 24'b0};
                        out_left <= ((quad) ? ( 1 ) : ( 7 ));
                    end else begin
                        check    <= extended;
                        out      <= ((quad) ? ( out << 4 ) : ( out << 1 ));
                        out_left <= out_left - 1;
                        if (!streams && left == 0) begin
                            out <= {extended, 16'b0};
                        end
                    end
                    default     : begin
                    end
                endcase
            end
            if (back && !streams && phase == Phase_Dummy) begin
                out <= value;
            end
        end
    end
endmodule
