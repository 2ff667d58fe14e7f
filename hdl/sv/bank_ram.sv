/// One bank of sums: a word for each pattern and one for each complement.
///
/// A word written is read from the clock after on. A word read in the clock of its writing is undefined; the
/// accumulators never use one.
module nirspi_bank_ram #(
    parameter int unsigned WIDTH = 48
) (
    input  var logic             clk          ,
    input  var logic             write        ,
    input  var logic [11-1:0]    write_address,
    input  var logic [WIDTH-1:0] write_data   ,
    input  var logic [11-1:0]    read_address ,
    output var logic [WIDTH-1:0] read_data     /// Two clocks after its address
);
    (* no_rw_check *)
    logic [WIDTH-1:0] words   [2048];
    logic [WIDTH-1:0] fetched       ;

    always_ff @ (posedge clk) begin
        if (write) begin
            words[write_address] <= write_data;
        end
        fetched   <= words[read_address];
        read_data <= fetched;
    end
endmodule
