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
