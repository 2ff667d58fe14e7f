/// Records a burst of plain samples.
///
/// Invariant: word `t` is the sample of the burst's clock `t`, and the clock that makes a burst whole is
/// marked.
module nirspi_raw_capture (
    input  var logic                           clk         ,
    input  var logic                           rst         ,
    input  var nirspi_types::Settings          settings    ,
    input  var logic                           start       , /// The next clock's sample is the burst's first
    input  var logic                           halt        ,
    input  var nirspi_types::Sample            sample      ,
    output var logic                           active      ,
    output var logic                           first       ,
    output var logic                           last        ,
    input  var logic                  [12-1:0] host_address,
    output var logic                  [16-1:0] host_word    /// Two clocks after its address
);
    logic [12-1:0] address;
    logic [12-1:0] left   ;
    logic          is_last;

    always_comb last = active && is_last;

    always_ff @ (posedge clk) begin
        if (rst) begin
            active  <= 0;
            first   <= 0;
            address <= 0;
            left    <= 0;
            is_last <= 0;
        end else if (start) begin
            active  <= settings.raw;
            first   <= settings.raw;
            address <= 0;
            left    <= settings.raw_less_1;
            is_last <= settings.raw_less_1 == 0;
        end else begin
            active  <= active && !is_last && !halt;
            first   <= 0;
            address <= address + 1;
            left    <= left - 1;
            is_last <= left == 1;
        end
    end

    // Bit 15 says over range, bit 14 is 0.
    (* no_rw_check *)
    logic [15-1:0] words   [4096];
    logic [15-1:0] fetched       ;

    always_ff @ (posedge clk) begin
        if (active) begin
            words[address] <= {sample.over_range, sample.code};
        end
        fetched   <= words[host_address];
        host_word <= {fetched[14], 1'b0, fetched[13:0]};
    end
endmodule
