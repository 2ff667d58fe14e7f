/// CRC-32 (ISO-HDLC), a byte a clock.
module nirspi_crc32 (
    input  var logic          clk  ,
    input  var logic          clear,
    input  var logic          take ,
    input  var logic [8-1:0]  octet,
    output var logic [32-1:0] value
);
    logic [32-1:0] state;
    always_comb value = ~state;

    /// The state after one more byte, lowest bit first.
    function automatic logic [32-1:0] extend(
        input var logic [32-1:0] so_far,
        input var logic [8-1:0]  data
    ) ;
        logic [32-1:0] after;
        after = so_far ^ 32'(data);
        for (int _i = 0; _i < 8; _i++) begin
            after = (after >> 1) ^ (32'hEDB88320 & {32{after[0]}});
        end
        return after;
    endfunction

    always_ff @ (posedge clk) begin
        if (clear) begin
            state <= 32'hFFFFFFFF;
        end else if (take) begin
            state <= extend(state, octet);
        end
    end
endmodule
