/// The FPGA but for what is special to a board: PLL, pin cells, LVDS receivers.
///
/// Two clocks: `clk_adc`, 125 MHz, for LEDs and samples alike; `clk_host` for the host port, which samples its
/// pins with it. A third, `sck` itself, clocks reads of packets; its reset is the pin `spi_cs_n`. Other resets are synchronous, each to its own clock, high. The host port lives without the ADC's clock:
/// `rst_host` holds it alone, and `rst_bridge` that half of it which talks to the ADC's domain. The board must hold
/// `rst_bridge` as long as `rst_adc` and longer (`hdl/formal/recovery.sv`).
module nirspi_core (
    input var logic clk_adc   ,
    input var logic rst_adc   ,
    input var logic clk_host  ,
    input var logic rst_host  ,
    input var logic rst_bridge,
    input var logic clk_sck   , /// `spi_sck`
    input var logic rst_sck   , /// `spi_cs_n`
    // What the board knows of itself and of the ADC's clock.
    input var logic [8-1:0]  design_id  , /// `Design` of `mcu/wire`
    input var logic          adc_beat   , /// The ADC's clock, divided
    input var logic          pll_locked ,
    input var logic          clock_alive,
    input var logic [32-1:0] sampling   , /// The register `Sampling`
    // ADC, in step with `clk_adc`.
    input var logic [14-1:0] adc_code      ,
    input var logic          adc_over_range,
    // LED array.
    output var logic [32-1:0] led_rows   ,
    output var logic [32-1:0] led_columns,
    output var logic          led_enable ,
    // Interlock loop, closed when high; in step with nothing.
    input var logic interlock,
    // Parallel port.
    input  var logic         parallel_ready , /// The receiver takes bytes; in step with nothing
    output var logic [2-1:0] parallel_strobe, /// The clock's levels in the first and in the second half of `clk_adc`
    output var logic [8-1:0] parallel_lines ,
    output var logic         parallel_enable,
    // Host port.
    input  var logic         spi_sck    ,
    input  var logic         spi_cs_n   ,
    input  var logic [4-1:0] spi_in     ,
    output var logic [4-1:0] spi_out    ,
    output var logic [4-1:0] spi_drive  , /// Line by line; none while `spi_cs_n` is high
    output var logic         frame_ready,
    output var logic         raw_ready  ,
    output var logic         access      /// An access of the host takes effect: for an activity LED
);
    // Pins to the clocks that look at them. All six of the host port are equally late.
    logic         closed  ;
    logic         receives;
    logic         sck     ;
    logic         cs_n    ;
    logic [4-1:0] lines_in;

    nirspi_synchroniser to_closed (
        .clk  (clk_adc  ),
        .rst  (rst_adc  ),
        .from (interlock),
        .to   (closed   )
    );
    nirspi_glitch_filter to_sck (
        .clk  (clk_host),
        .rst  (rst_host),
        .from (spi_sck ),
        .to   (sck     )
    );
    nirspi_glitch_filter to_cs_n (
        .clk  (clk_host),
        .rst  (rst_host),
        .from (spi_cs_n),
        .to   (cs_n    )
    );
    nirspi_synchroniser to_receives (
        .clk  (clk_adc       ),
        .rst  (rst_adc       ),
        .from (parallel_ready),
        .to   (receives      )
    );
    for (genvar i = 0; i < 4; i++) begin :g_line
        nirspi_glitch_filter to_line (
            .clk  (clk_host   ),
            .rst  (rst_host   ),
            .from (spi_in[i]  ),
            .to   (lines_in[i])
        );
    end

    // Host port.
    logic          send        ;
    logic [2-1:0]  operation_in;
    logic [16-1:0] address_in  ;
    logic [32-1:0] data_in     ;
    logic          back        ;
    logic [32-1:0] value_out   ;
    logic          answered_out;
    logic [32-1:0] answer      ;
    logic          ready       ;
    logic          epoch_host  ;
    logic          empty       ;
    logic          pop         ;
    logic [9-1:0]  pop_data    ;
    logic [4-1:0]  drive       ;

    logic [4-1:0] slow_lines  ;
    logic         beginning   ;
    logic         idle        ;
    logic         packet      ;
    logic         reads       ;
    logic [4-1:0] packet_lines;
    logic         drives      ;

    nirspi_synchroniser to_packet (
        .clk  (clk_host),
        .rst  (rst_host),
        .from (reads   ),
        .to   (packet  )
    );

    nirspi_spi_slave port (
        .clk       (clk_host    ),
        .rst       (rst_host    ),
        .sck       (sck         ),
        .selected  (!cs_n       ),
        .lines_in  (lines_in    ),
        .lines_out (slow_lines  ),
        .drive     (drive       ),
        .beginning (beginning   ),
        .packet    (packet      ),
        .idle      (idle        ),
        .send      (send        ),
        .operation (operation_in),
        .address   (address_in  ),
        .data      (data_in     ),
        .back      (answered_out),
        .value     (answer      ),
        .epoch     (epoch_host  ),
        .empty     (empty       ),
        .fifo_data (pop_data    ),
        .pop       (pop         )
    );
    // The lines are let go with the pin, not some clocks later.

    always_comb spi_out   = ((drives) ? ( packet_lines ) : ( slow_lines ));
    always_comb spi_drive = (drive | {4{drives}}) & {4{~spi_cs_n}};

    always_ff @ (posedge clk_host) begin
        if (rst_bridge) begin
            ready <= 0;
        end else begin
            ready <= 1;
        end
    end
    nirspi_host_registers answers (
        .clk       (clk_host    ),
        .rst       (rst_host    ),
        .design_id (design_id   ),
        .locked    (pll_locked  ),
        .alive     (clock_alive ),
        .ready     (ready       ),
        .beat      (adc_beat    ),
        .sampling  (sampling    ),
        .send      (send        ),
        .address   (address_in  ),
        .back      (back        ),
        .value     (value_out   ),
        .answered  (answered_out),
        .answer    (answer      )
    );

    // To the engine and back.
    logic          request  ;
    logic [2-1:0]  operation;
    logic [16-1:0] address  ;
    logic [32-1:0] data     ;
    logic          epoch    ;
    logic          answered ;
    logic [32-1:0] value    ;

    nirspi_crossing bridge (
        .clk_host     (clk_host    ),
        .rst_host     (rst_bridge  ),
        .clk_adc      (clk_adc     ),
        .rst_adc      (rst_adc     ),
        .send         (send        ),
        .operation_in (operation_in),
        .address_in   (address_in  ),
        .data_in      (data_in     ),
        .back         (back        ),
        .value_out    (value_out   ),
        .idle         (idle        ),
        .epoch_host   (epoch_host  ),
        .request      (request     ),
        .operation    (operation   ),
        .address      (address     ),
        .data         (data        ),
        .epoch_adc    (epoch       ),
        .answered     (answered    ),
        .value        (value       )
    );

    logic [8-1:0] octet     ;
    logic         byte_valid;
    logic         full      ;
    logic         tag       ;
    logic         by_sck    ;
    logic         full_sck  ;

    // A byte belongs to the epoch whose access made it, not to one that is still on its way.
    always_ff @ (posedge clk_adc) begin
        if (rst_adc) begin
            tag <= 0;
        end else if (access) begin
            tag <= epoch;
        end
    end

    nirspi_byte_fifo bytes (
        .clk_write (clk_adc              ),
        .rst_write (rst_adc              ),
        .push      (byte_valid && !by_sck),
        .push_data ({tag, octet}         ),
        .full      (full                 ),
        .clk_read  (clk_host             ),
        .rst_read  (rst_bridge           ),
        .pop       (pop                  ),
        .empty     (empty                ),
        .pop_data  (pop_data             )
    );

    nirspi_packet_port packets (
        .clk_adc    (clk_adc           ),
        .rst_adc    (rst_adc           ),
        .clk_sck    (clk_sck           ),
        .rst_sck    (rst_sck           ),
        .line       (spi_in[0]         ),
        .lines_out  (packet_lines      ),
        .drives     (drives            ),
        .may_begin  (beginning && ready),
        .reads      (reads             ),
        .access     (access            ),
        .octet      (octet             ),
        .byte_valid (byte_valid        ),
        .takes      (by_sck            ),
        .full       (full_sck          )
    );

    nirspi_engine machine (
        .clk             (clk_adc                               ),
        .rst             (rst_adc                               ),
        .code            (adc_code                              ),
        .over_range      (adc_over_range                        ),
        .interlock       (closed                                ),
        .rows            (led_rows                              ),
        .columns         (led_columns                           ),
        .enable          (led_enable                            ),
        .frame_ready     (frame_ready                           ),
        .raw_ready       (raw_ready                             ),
        .access          (access                                ),
        .request         (request                               ),
        .operation       (operation                             ),
        .address         (address                               ),
        .data            (data                                  ),
        .answered        (answered                              ),
        .value           (value                                 ),
        .octet           (octet                                 ),
        .byte_valid      (byte_valid                            ),
        .byte_taken      (((by_sck) ? ( !full_sck ) : ( !full ))),
        .parallel_ready  (receives                              ),
        .parallel_strobe (parallel_strobe                       ),
        .parallel_lines  (parallel_lines                        ),
        .parallel_enable (parallel_enable                       )
    );
endmodule
