/// Drives the LED lines from the sequencer's slot, six clocks after it was chosen.
///
/// Invariant: lines change only at a slot's first clock and are all 0 outside a run. The last stage asks
/// for the permission once more, whatever the stages before it say: `enable` falls in the clock after it is
/// withdrawn, the other lines, which light nothing without it, a clock later. A run without light shows its lines, and
/// `enable` stays low.
module nirspi_leds (
    input  var logic                           clk        ,
    input  var logic                           rst        ,
    input  var nirspi_types::Settings          settings   ,
    input  var logic                           start      , /// The next clock of the sequencer is the first
    input  var logic                           halt       ,
    input  var logic                           permit     , /// LEDs may be lit in the next clock
    input  var logic                           permitted  , /// As `permit`, but for what withdraws it in this very clock
    output var logic                  [10-1:0] table_index,
    input  var logic                  [10-1:0] table_entry, /// Two clocks after `table_index`
    output var logic                  [32-1:0] rows       ,
    output var logic                  [32-1:0] columns    ,
    output var logic                           enable     ,
    output var logic                           lit        , /// As `enable`, but for the permission
    output var logic                           full       , /// All LEDs are lit
    output var logic                           dark        /// None is, though `lit`
);
    nirspi_types::Place place;
    nirspi_sequencer counters (
        .clk      (clk     ),
        .rst      (rst     ),
        .settings (settings),
        .start    (start   ),
        .halt     (halt    ),
        .place    (place   )
    );
    always_comb table_index = place.index;

    /// Bit `i` is the sign line of index `i` for the Walsh function `k`.
    function automatic logic [32-1:0] sign_lines(
        input var logic [5-1:0] k
    ) ;
        logic [32-1:0] word;
        for (int i = 0; i < 32; i++) begin
            word[i] = ^(k & (5'(i)));
        end
        return word;
    endfunction

    // Stages 1 and 2: the table is read. Stage 3: the pattern. Stage 4: its lines.
    logic [4-1:0]  active      ;
    logic          lights      ; // as `active[3]`, in a run with light
    logic [4-1:0]  complement  ;
    logic [3-1:0]  inverts_rows;
    logic [3-1:0]  inverts     ;
    logic [10-1:0] index_1     ;
    logic [10-1:0] index_2     ;
    logic [10-1:0] gray        ;
    logic [10-1:0] sequency    ;
    logic [10-1:0] pattern     ;
    logic [32-1:0] next_rows   ;
    logic [32-1:0] next_columns;
    logic          zero        ;

    always_comb begin
        gray = index_2 ^ (index_2 >> 1);
        for (int i = 0; i < 10; i++) begin
            sequency[i] = gray[9 - i];
        end
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            active <= 0;
            lights <= 0;
        end else if (halt) begin
            active <= 0;
            lights <= 0;
        end else begin
            active <= {active[2:0], place.active};
            lights <= active[2] && !settings.unlit;
        end
    end

    always_ff @ (posedge clk) begin
        complement   <= {complement[2:0], place.complement};
        inverts_rows <= {inverts_rows[1:0], place.complement ^ place.inverted};
        inverts      <= {inverts[1:0], place.inverted};
        index_1      <= place.index;
        index_2      <= index_1;
        if (settings.order_table) begin
            pattern <= table_entry;
        end else if (settings.order_sequency) begin
            pattern <= sequency;
        end else begin
            pattern <= index_2;
        end
        next_rows    <= sign_lines(pattern[9:5]) ^ {32{inverts_rows[2]}};
        next_columns <= sign_lines(pattern[4:0]) ^ {32{inverts[2]}};
        zero         <= pattern == 0;
    end

    // Stage 5: the registers at the pins.
    logic shown ;
    logic shines;
    always_comb shown  = active[3] && permitted && !halt;
    always_comb shines = lights && permitted && !halt;

    always_ff @ (posedge clk) begin
        if (rst) begin
            rows    <= 0;
            columns <= 0;
            enable  <= 0;
            lit     <= 0;
            full    <= 0;
            dark    <= 0;
        end else begin
            rows    <= ((shown) ? ( next_rows ) : ( 0 ));
            columns <= ((shown) ? ( next_columns ) : ( 0 ));
            enable  <= shines && permit;
            lit     <= lights;
            full    <= lights && zero && !complement[3];
            dark    <= lights && zero && complement[3];
        end
    end
endmodule
