/// Everything on the ADC's clock: what the golden model in `hdl/model` describes.
///
/// Invariant: a clock of a run goes through here in fixed time. Its slot is chosen, its lines are at the
/// pins six clocks later, its sample leaves the source eight clocks later, and it is done with thirteen
/// (`types::DEPTH`) clocks later: what is counted, latched or delivered changes then and only then.
module nirspi_engine
    import nirspi_register_map::*;
(
    input  var logic          clk        ,
    input  var logic          rst        ,
    input  var logic [14-1:0] code       ,
    input  var logic          over_range ,
    input  var logic          interlock  , /// Closed; in step with `clk`
    output var logic [32-1:0] rows       ,
    output var logic [32-1:0] columns    ,
    output var logic          enable     ,
    output var logic          frame_ready,
    output var logic          raw_ready  ,
    output var logic          access     , /// An access of the host takes effect
    input  var logic          request    ,
    input  var logic [2-1:0]  operation  , /// `register_map::HOST_...`
    input  var logic [16-1:0] address    ,
    input  var logic [32-1:0] data       ,
    output var logic          answered   ,
    output var logic [32-1:0] value      ,
    output var logic [8-1:0]  octet      ,
    output var logic          byte_valid ,
    input  var logic          byte_taken ,
    // Parallel port.
    input  var logic         parallel_ready , /// In step with `clk`
    output var logic [2-1:0] parallel_strobe,
    output var logic [8-1:0] parallel_lines ,
    output var logic         parallel_enable
);


    nirspi_types::Settings settings;
    nirspi_types::Stamp    stamp   ;

    // Time since reset, of the clock that is being done with.
    logic [64-1:0] clock_now   ;
    logic [64-1:0] to_light    ;
    logic [64-1:0] light_next  ;
    logic          window_first;

    always_ff @ (posedge clk) begin
        if (rst) begin
            clock_now    <= -(64'(nirspi_types::DEPTH));
            to_light     <= 0;
            light_next   <= 0;
            window_first <= 0;
        end else begin
            clock_now    <= clock_now + 1;
            to_light     <= 64'd2 - 64'(settings.latency);
            light_next   <= clock_now + to_light;
            window_first <= clock_now[19:0] == 20'hFFFFF;
        end
    end

    // The interlock as of the clock being done with; one more, as a run's first clock follows its start.
    logic [14-1:0] interlocks;
    always_ff @ (posedge clk) begin
        if (rst) begin
            interlocks <= 0;
        end else begin
            interlocks <= {interlocks[12:0], interlock};
        end
    end

    // Control.
    logic         write        ;
    logic         stop         ;
    logic         clear        ;
    logic         give_back    ;
    logic         begins       ;
    logic         begins_raw   ;
    logic         go           ;
    logic         go_sample    ;
    logic         go_raw       ;
    logic         arrives      ;
    logic         first        ;
    logic         running      ;
    logic         halt         ;
    logic         table_write  ;
    logic         config_error ;
    logic         write_refused;
    logic         in_range     ;
    logic [3-1:0] fault        ;
    logic         opens        ;
    logic         trips        ;
    logic         ends         ;
    logic         permit       ;
    logic         permitted    ;

    nirspi_control command (
        .clk           (clk                         ),
        .rst           (rst                         ),
        .request       (request                     ),
        .is_write      (operation == HOST_WRITE[1:0]),
        .address       (address                     ),
        .data          (data                        ),
        .answered      (answered                    ),
        .access        (access                      ),
        .write         (write                       ),
        .in_range      (in_range                    ),
        .interlock_now (interlock                   ),
        .fault         (fault                       ),
        .opens         (opens                       ),
        .trips         (trips                       ),
        .ends          (ends                        ),
        .stop          (stop                        ),
        .clear         (clear                       ),
        .give_back     (give_back                   ),
        .begins        (begins                      ),
        .begins_raw    (begins_raw                  ),
        .go            (go                          ),
        .go_sample     (go_sample                   ),
        .go_raw        (go_raw                      ),
        .arrives       (arrives                     ),
        .first         (first                       ),
        .running       (running                     ),
        .halt          (halt                        ),
        .table_write   (table_write                 ),
        .config_error  (config_error                ),
        .write_refused (write_refused               )
    );

    // Light.
    logic [10-1:0] table_index;
    logic [10-1:0] table_entry;
    logic [10-1:0] host_entry ;
    logic          lit        ;
    logic          full       ;
    logic          dark       ;

    nirspi_order_table order (
        .clk          (clk         ),
        .write        (table_write ),
        .host_address (address[9:0]),
        .host_data    (data[9:0]   ),
        .host_entry   (host_entry  ),
        .index        (table_index ),
        .entry        (table_entry )
    );
    nirspi_leds array (
        .clk         (clk        ),
        .rst         (rst        ),
        .settings    (settings   ),
        .start       (go         ),
        .halt        (halt       ),
        .permit      (permit     ),
        .permitted   (permitted  ),
        .table_index (table_index),
        .table_entry (table_entry),
        .rows        (rows       ),
        .columns     (columns    ),
        .enable      (enable     ),
        .lit         (lit        ),
        .full        (full       ),
        .dark        (dark       )
    );

    // Until the clock is done with.
    logic [7-1:0] lit_late ;
    logic [7-1:0] full_late;
    logic [7-1:0] dark_late;
    always_ff @ (posedge clk) begin
        lit_late  <= {lit_late[5:0], lit};
        full_late <= {full_late[5:0], full};
        dark_late <= {dark_late[5:0], dark};
    end

    // Samples.
    nirspi_types::Sample          sample    ;
    nirspi_types::Place           place     ;
    logic                [30-1:0] sum       ;
    logic                         overflow  ;
    logic                [3-1:0]  filling   ;
    logic                [3-1:0]  reading   ;
    logic                         raw_active;
    logic                         raw_first ;
    logic                         raw_last  ;
    logic                [32-1:0] over_count;
    logic                         over_any  ;
    logic                         over_trips;
    logic                [11-1:0] sum_at    ;
    logic                [48-1:0] sum_word  ;
    logic                [12-1:0] raw_at    ;
    logic                [16-1:0] raw_word  ;
    logic                [64-1:0] total     ;

    nirspi_source samples (
        .clk        (clk                 ),
        .rst        (rst                 ),
        .test       (settings.test_source),
        .start      (go_sample           ),
        .code       (code                ),
        .over_range (over_range          ),
        .sample     (sample              )
    );
    nirspi_window slots (
        .clk      (clk      ),
        .rst      (rst      ),
        .settings (settings ),
        .start    (go_sample),
        .halt     (halt     ),
        .sample   (sample   ),
        .place    (place    ),
        .sum      (sum      )
    );
    nirspi_accumulators sums (
        .clk          (clk     ),
        .rst          (rst     ),
        .filling      (filling ),
        .reading      (reading ),
        .place        (place   ),
        .sum          (sum     ),
        .overflow     (overflow),
        .host_address (sum_at  ),
        .host_word    (sum_word)
    );
    nirspi_raw_capture burst (
        .clk          (clk       ),
        .rst          (rst       ),
        .settings     (settings  ),
        .start        (go_raw    ),
        .halt         (halt      ),
        .sample       (sample    ),
        .active       (raw_active),
        .first        (raw_first ),
        .last         (raw_last  ),
        .host_address (raw_at    ),
        .host_word    (raw_word  )
    );
    nirspi_over_counter over (
        .clk     (clk                           ),
        .rst     (rst                           ),
        .trips   (settings.trips_over_range     ),
        .trip    (settings.over_range_trip      ),
        .counts  (place.active || raw_active    ),
        .first   (place.frame_first || raw_first),
        .over    (sample.over_range             ),
        .count   (over_count                    ),
        .any     (over_any                      ),
        .reached (over_trips                    )
    );

    nirspi_sample_total level (
        .clk    (clk              ),
        .counts (place.counts     ),
        .first  (place.frame_first),
        .code   (sample.code      ),
        .total  (total            )
    );

    // Done with.
    logic [5-1:0] frame_last;
    logic [5-1:0] run_last  ;
    logic [5-1:0] burst_last;
    logic         counts    ;
    logic         frame_done;
    logic         burst_done;

    always_ff @ (posedge clk) begin
        if (rst) begin
            frame_last <= 0;
            run_last   <= 0;
            burst_last <= 0;
        end else begin
            frame_last <= {frame_last[3:0], place.frame_last};
            run_last   <= {run_last[3:0], place.run_last};
            burst_last <= {burst_last[3:0], raw_last};
        end
    end

    always_comb begin
        counts     = running && !stop && !opens;
        frame_done = counts && !trips && frame_last[4];
        burst_done = counts && !trips && burst_last[4];
        ends       = run_last[4] || burst_last[4];
    end

    nirspi_safety guard (
        .clk              (clk                                                          ),
        .rst              (rst                                                          ),
        .settings         (settings                                                     ),
        .window_first     (window_first                                                 ),
        .begins           (begins                                                       ),
        .arrives          (arrives                                                      ),
        .running          (running                                                      ),
        .feed             (access                                                       ),
        .stop             (stop                                                         ),
        .clear            (clear                                                        ),
        .interlock_closed (interlocks[13]                                               ),
        .interlock_now    (interlock                                                    ),
        .ends             (ends                                                         ),
        .over_range       (over_trips                                                   ),
        .half_arrays      ({full_late[6], lit_late[6] && !full_late[6] && !dark_late[6]}),
        .fault            (fault                                                        ),
        .opens            (opens                                                        ),
        .trips            (trips                                                        ),
        .permit           (permit                                                       ),
        .permitted        (permitted                                                    )
    );

    logic                [32-1:0] frames_made;
    logic                [32-1:0] frames_lost;
    nirspi_types::Header          header     ;
    logic                         waits      ; // a frame, for the host or for the parallel port
    logic                         sent       ; // the parallel port's frame
    logic                         parallel   ; // packets of the run leave by the parallel port

    always_comb frame_ready = waits && !parallel;

    nirspi_frames delivery (
        .clk        (clk                                    ),
        .rst        (rst                                    ),
        .settings   (settings                               ),
        .clock_now  (clock_now                              ),
        .light_next (light_next                             ),
        .restart    (begins                                 ),
        .give_back  (((parallel) ? ( sent ) : ( give_back ))),
        .first      (first                                  ),
        .done       (frame_done                             ),
        .over_range (over_count                             ),
        .over_any   (over_any                               ),
        .total      (total                                  ),
        .overflow   (overflow                               ),
        .counts     (counts                                 ),
        .filling    (filling                                ),
        .reading    (reading                                ),
        .ready      (waits                                  ),
        .made       (frames_made                            ),
        .lost       (frames_lost                            ),
        .header     (header                                 )
    );

    always_ff @ (posedge clk) begin
        if (rst) begin
            raw_ready <= 0;
        end else if (begins) begin
            raw_ready <= 0;
        end else if (burst_done) begin
            raw_ready <= 1;
        end else if (give_back) begin
            raw_ready <= 0;
        end
    end

    // What the host reads. An interlock that opens before this clock has opened before the read.
    logic [32-1:0] status    ;
    logic [3-1:0]  fault_seen;
    logic          running_on;

    always_comb begin
        running_on = running && !opens;
        fault_seen = ((opens) ? ( 3'(FAULT_INTERLOCK) ) : ( fault ));
        status     = (((running_on) ? ( STATUS_RUNNING ) : ( 0 ))) | (((frame_ready) ? ( STATUS_FRAME_READY ) : ( 0 )))
            | (((raw_ready) ? ( STATUS_RAW_READY ) : ( 0 )))
            | (((running_on && lit_late[6]) ? ( STATUS_LEDS_ON ) : ( 0 )))
            | (((fault_seen != 0) ? ( STATUS_FAULT ) : ( 0 )))
            | (((interlocks[13]) ? ( STATUS_INTERLOCK_CLOSED ) : ( 0 )))
            | (((config_error) ? ( STATUS_CONFIG_ERROR ) : ( 0 )))
            | (((write_refused) ? ( STATUS_WRITE_REFUSED ) : ( 0 )));
    end

    nirspi_registers bank (
        .clk         (clk                                  ),
        .rst         (rst                                  ),
        .address     (address                              ),
        .data        (data                                 ),
        .write       (write                                ),
        .read        (access && operation == HOST_READ[1:0]),
        .copy        (begins                               ),
        .copy_raw    (begins_raw                           ),
        .in_range    (in_range                             ),
        .settings    (settings                             ),
        .parallel    (parallel                             ),
        .stamp       (stamp                                ),
        .status      (status                               ),
        .fault       (fault_seen                           ),
        .frames_made (frames_made                          ),
        .frames_lost (frames_lost                          ),
        .delivered   (waits                                ),
        .header      (header                               ),
        .clock_now   (clock_now                            ),
        .table_entry (host_entry                           ),
        .value       (value                                )
    );

    // The bytes that the host reads. Whatever is opened ends both modules' bytes.
    logic          opens_frame ;
    logic          opens_raw   ;
    logic          opens_any   ;
    logic [11-1:0] format_sum  ;
    logic [8-1:0]  format_octet;
    logic          format_valid;
    logic [11-1:0] packet_sum  ;
    logic [8-1:0]  packet_octet;
    logic          packet_valid;
    logic          opens_packet; // for the parallel port
    logic          packet_taken;
    always_comb opens_frame  = access && operation == HOST_FRAME[1:0] && frame_ready;
    always_comb opens_raw    = access && operation == HOST_RAW[1:0] && raw_ready;
    always_comb opens_any    = access && (operation == HOST_FRAME[1:0] || operation == HOST_RAW[1:0]);
    always_comb sum_at       = ((settings.packets) ? ( packet_sum ) : ( format_sum ));
    always_comb octet        = ((packet_valid && !parallel) ? ( packet_octet ) : ( format_octet ));
    always_comb byte_valid   = packet_valid && !parallel || format_valid;

    nirspi_formatter format (
        .clk         (clk                             ),
        .rst         (rst                             ),
        .settings    (settings                        ),
        .header      (header                          ),
        .open_frame  (opens_frame && !settings.packets),
        .open_raw    (opens_raw                       ),
        .open_none   (opens_any                       ),
        .sum_address (format_sum                      ),
        .sum_word    (sum_word                        ),
        .raw_address (raw_at                          ),
        .raw_word    (raw_word                        ),
        .octet       (format_octet                    ),
        .valid       (format_valid                    ),
        .taken       (byte_taken                      )
    );
    nirspi_packer pack (
        .clk         (clk                                             ),
        .rst         (rst                                             ),
        .settings    (settings                                        ),
        .header      (header                                          ),
        .stamp       (stamp                                           ),
        .open        (opens_frame && settings.packets || opens_packet ),
        .close       (opens_any && !parallel                          ),
        .sum_address (packet_sum                                      ),
        .sum_word    (sum_word                                        ),
        .octet       (packet_octet                                    ),
        .valid       (packet_valid                                    ),
        .taken       (((parallel) ? ( packet_taken ) : ( byte_taken )))
    );
    nirspi_parallel_port port (
        .clk       (clk            ),
        .rst       (rst            ),
        .on        (parallel       ),
        .restart   (begins         ),
        .frame     (waits          ),
        .ready     (parallel_ready ),
        .open      (opens_packet   ),
        .octet     (packet_octet   ),
        .valid     (packet_valid   ),
        .taken     (packet_taken   ),
        .give_back (sent           ),
        .strobe    (parallel_strobe),
        .lines     (parallel_lines ),
        .enable    (parallel_enable)
    );
endmodule
