// Two clocks as one: a step of the proof is a tick of each clock that is high in it, or of none. So the clocks
// may stand in any relation, and ticks may coincide.
(* techmap_celltype = "$dff" *)
module tick (CLK, D, Q);
    parameter WIDTH = 1;
    parameter CLK_POLARITY = 1;
    input CLK;
    input [WIDTH-1:0] D;
    output [WIDTH-1:0] Q;
    \$ff #(.WIDTH(WIDTH)) _TECHMAP_REPLACE_ (.D(CLK ? D : Q), .Q(Q));
endmodule

// An asynchronous reset holds at once, and for the step in which it is high, tick or none.
(* techmap_celltype = "$aldff" *)
module tick_reset (CLK, ALOAD, AD, D, Q);
    parameter WIDTH = 1;
    parameter CLK_POLARITY = 1;
    parameter ALOAD_POLARITY = 1;
    input CLK, ALOAD;
    input [WIDTH-1:0] AD, D;
    output [WIDTH-1:0] Q;
    parameter [WIDTH-1:0] _TECHMAP_WIREINIT_Q_ = {WIDTH{1'bx}};
    wire [WIDTH-1:0] _TECHMAP_REMOVEINIT_Q_ = {WIDTH{1'b1}};
    (* init = _TECHMAP_WIREINIT_Q_ *)
    wire [WIDTH-1:0] held;
    assign Q = ALOAD ? AD : held;
    \$ff #(.WIDTH(WIDTH)) state (.D(ALOAD ? AD : CLK ? D : held), .Q(held));
endmodule
