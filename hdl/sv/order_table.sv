/// The order table, twice: the host reads one copy while the sequencer reads the other.
///
/// Invariant: both copies are written together, and only between runs. It is all 0 after power-up. An entry
/// read in the clock of its writing is undefined: the sequencer then shows nothing, and the host's address
/// stands until it is read anew.
module nirspi_order_table (
    input  var logic          clk         ,
    input  var logic          write       ,
    input  var logic [10-1:0] host_address,
    input  var logic [10-1:0] host_data   ,
    output var logic [10-1:0] host_entry  , /// Two clocks after its address
    input  var logic [10-1:0] index       ,
    output var logic [10-1:0] entry        /// Two clocks after its index
);
    (* no_rw_check *)
    logic [10-1:0] host_copy [1024];
    (* no_rw_check *)
    logic [10-1:0] copy      [1024];
    logic [10-1:0] host_read       ;
    logic [10-1:0] fetched         ;

    always_ff @ (posedge clk) begin
        if (write) begin
            host_copy[host_address] <= host_data;
        end
        host_read  <= host_copy[host_address];
        host_entry <= host_read;
    end

    always_ff @ (posedge clk) begin
        if (write) begin
            copy[host_address] <= host_data;
        end
        fetched <= copy[index];
        entry   <= fetched;
    end
endmodule
