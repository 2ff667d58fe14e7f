/// The light budget: half-arrays lit in the fixed windows of 2^20 clocks.
///
/// Invariant: what is spent is counted in and out of runs alike, so no start renews the budget. What the
/// limit leaves is kept beside it, with its signs after 0, 1 and 2 more worked out a clock before they are
/// asked for.
module nirspi_duty (
    input  var logic          clk         ,
    input  var logic          rst         ,
    input  var logic [21-1:0] limit       , /// Changes only between runs
    input  var logic          window_first, /// This clock is the first of a window
    input  var logic          running     ,
    input  var logic          spends      , /// This clock is one of a run and counts
    input  var logic [2-1:0]  half_arrays , /// Lit in this clock: 0, 1 or 2
    output var logic          exceeded     /// With this clock, were it to count
);
    logic [22-1:0] spent        ;
    logic [22-1:0] left         ; // what the limit leaves, between runs
    logic [22-1:0] rest         ; // what it leaves in a run; two's complement, both
    logic          below_0      ;
    logic          below_1      ;
    logic          below_2      ;
    logic          limit_below_1;
    logic          limit_below_2;
    logic [22-1:0] base         ;
    logic [2-1:0]  cost         ;
    logic [22-1:0] after        ;
    logic [22-1:0] less_1       ;
    logic [22-1:0] less_2       ;

    always_comb begin
        if (half_arrays[1]) begin
            exceeded = ((window_first) ? ( limit_below_2 ) : ( below_2 ));
        end else if (half_arrays[0]) begin
            exceeded = ((window_first) ? ( limit_below_1 ) : ( below_1 ));
        end else begin
            exceeded = !window_first && below_0;
        end
    end

    always_comb begin
        if (window_first) begin
            base = 22'(limit);
        end else if (running) begin
            base = rest;
        end else begin
            base = left;
        end
        cost   = ((running) ? ( half_arrays ) : ( 0 ));
        after  = base - 22'(cost);
        less_1 = base - 22'((3'(cost) + 1));
        less_2 = base - 22'((3'(cost) + 2));
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            spent         <= 0;
            left          <= 0;
            rest          <= 0;
            below_0       <= 0;
            below_1       <= 0;
            below_2       <= 0;
            limit_below_1 <= 0;
            limit_below_2 <= 0;
        end else begin
            spent         <= (((window_first) ? ( 0 ) : ( spent ))) + (((spends) ? ( 22'(half_arrays) ) : ( 0 )));
            left          <= 22'(limit) - (((window_first) ? ( 0 ) : ( spent )));
            rest          <= after;
            below_0       <= after[21];
            below_1       <= less_1[21];
            below_2       <= less_2[21];
            limit_below_1 <= limit == 0;
            limit_below_2 <= limit[20:1] == 0;
        end
    end
endmodule
