/// A reset that holds at once, clock or no clock, and lets go some clocks after its cause has gone.
module reset_synchroniser (
    input  logic clk,
    input  logic holds,
    output logic rst
);
    logic [7:0] late = '1;
    always_ff @(posedge clk or posedge holds) begin
        if (holds) late <= '1;
        else late <= late << 1;
    end
    assign rst = late[7];
endmodule
