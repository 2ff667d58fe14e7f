/// Carries accesses from the host port's clock to the ADC's, and answers back.
///
/// Invariant: what crosses on more than one wire stands still while it does. A toggle goes over when the
/// access stands, a toggle comes back when the answer stands; an access that comes before that is dropped,
/// which a host that keeps to `HOST_SCK_DIVIDER` never sees. Both sides begin at 0: the board lets the host's side
/// out of reset last.
module nirspi_crossing (
    input var logic clk_host,
    input var logic rst_host,
    input var logic clk_adc ,
    input var logic rst_adc ,
    // Host port.
    input  var logic          send        ,
    input  var logic [2-1:0]  operation_in,
    input  var logic [16-1:0] address_in  ,
    input  var logic [32-1:0] data_in     ,
    output var logic          back        , /// The answer is there
    output var logic [32-1:0] value_out   ,
    output var logic          idle        , /// The next access is taken
    output var logic          epoch_host  , /// Changes with every frame or burst that is asked for
    // Engine.
    output var logic          request  ,
    output var logic [2-1:0]  operation,
    output var logic [16-1:0] address  ,
    output var logic [32-1:0] data     ,
    output var logic          epoch_adc,
    input  var logic          answered ,
    input  var logic [32-1:0] value
);
    logic          asked    ;
    logic [2-1:0]  held_op  ;
    logic [16-1:0] held_at  ;
    logic [32-1:0] held_data;
    logic          seen     ;
    logic          seen_last;

    always_comb idle = asked == seen_last;

    always_ff @ (posedge clk_host) begin
        if (rst_host) begin
            asked      <= 0;
            held_op    <= 0;
            held_at    <= 0;
            held_data  <= 0;
            epoch_host <= 0;
        end else if (send && idle) begin
            asked     <= ~asked;
            held_op   <= operation_in;
            held_at   <= address_in;
            held_data <= data_in;
            if (operation_in[1]) begin
                epoch_host <= ~epoch_host;
            end
        end
    end

    logic          asked_here;
    logic          asked_last;
    logic          told      ;
    logic [32-1:0] held_value;

    nirspi_synchroniser there (
        .clk  (clk_adc   ),
        .rst  (rst_adc   ),
        .from (asked     ),
        .to   (asked_here)
    );

    always_comb operation = held_op;
    always_comb address   = held_at;
    always_comb data      = held_data;
    always_comb epoch_adc = epoch_host;

    always_comb request = asked_here != asked_last;

    always_ff @ (posedge clk_adc) begin
        if (rst_adc) begin
            asked_last <= 0;
            told       <= 0;
            held_value <= 0;
        end else begin
            asked_last <= asked_here;
            if (answered) begin
                told       <= asked_last;
                held_value <= value;
            end
        end
    end

    nirspi_synchroniser here (
        .clk  (clk_host),
        .rst  (rst_host),
        .from (told    ),
        .to   (seen    )
    );

    always_ff @ (posedge clk_host) begin
        if (rst_host) begin
            seen_last <= 0;
        end else begin
            seen_last <= seen;
        end
    end
    always_comb back = seen != seen_last;

    always_comb value_out = held_value;

endmodule
