/// The host port: an SPI slave (mode 0) that also goes by four lines.
///
/// Invariant: the pins are sampled, never clocked by; so `sck` may stop anywhere and a transfer that is cut
/// short leaves nothing behind. The command set is `mcu/wire/src/host_port.rs`.
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
        Phase_Dummy,
        Phase_Answer,
        Phase_Over
    } Phase;

    Phase          phase   ;
    logic [6-1:0]  left    ; // cycles of the phase after this one
    logic          quad    ;
    logic [32-1:0] shifted ;
    logic [32-1:0] next    ;
    logic          sck_last;
    logic          rises   ;
    logic          known   ;
    logic [32-1:0] out     ;
    logic [5-1:0]  out_left; // cycles until the next byte of a frame
    logic          streams ;
    logic          stale   ;
    logic [8-1:0]  byte_now;
    logic          takes   ;

    always_comb rises = sck && !sck_last;
    always_comb next  = ((quad) ? ( {shifted[27:0], lines_in} ) : ( {shifted[30:0], lines_in[0]} ));
    always_comb known = next[6:2] == HOST_WRITE[6:2];

    // A byte of an earlier transfer is thrown away at once; a missing one reads 0.
    always_comb stale    = !empty && fifo_data[8] != epoch;
    always_comb byte_now = ((empty || stale) ? ( 0 ) : ( fifo_data[7:0] ));
    always_comb takes    = rises && selected && streams
        && (phase == Phase_Dummy && left == 0 || phase == Phase_Answer && out_left == 0);
    always_comb pop = stale || takes;

    always_comb lines_out = ((quad) ? ( out[31:28] ) : ( {2'b0, out[31], 1'b0} ));

    always_ff @ (posedge clk) begin
        if (rst) begin
            sck_last  <= 0;
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
        end else begin
            sck_last <= sck;
            send     <= 0;
            if (!selected) begin
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
                    end
                    Phase_Address: if (left == 0) begin
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
                    Phase_Data   : if (left == 0) begin
                        data  <= next;
                        phase <= Phase_Over;
                        send  <= 1;
                    end
                    Phase_Dummy  : if (left == 0) begin
                        phase    <= Phase_Answer;
                        drive    <= ((quad) ? ( 4'b1111 ) : ( 4'b0010 ));
                        out_left <= ((quad) ? ( 1 ) : ( 7 ));
                        if (streams) begin
                            out <= {byte_now, 24'b0};
                        end
                    end
                    Phase_Answer : if (streams && out_left == 0) begin
                        out      <= {byte_now, 24'b0};
                        out_left <= ((quad) ? ( 1 ) : ( 7 ));
                    end else begin
                        out      <= ((quad) ? ( out << 4 ) : ( out << 1 ));
                        out_left <= out_left - 1;
                    end
                    default      : begin
                    end
                endcase
            end
            if (back && !streams && phase == Phase_Dummy) begin
                out <= value;
            end
        end
    end
endmodule
