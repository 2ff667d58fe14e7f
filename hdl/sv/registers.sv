/// The register bank, the settings copied from it, and what the host reads.
///
/// Invariant: a read returns the last value written, valid or not; values are checked when a run starts. The map is
/// `register_map`, made from `mcu/wire`. `host_registers` answers reads that need no ADC clock; they read 0 here.
module nirspi_registers
    import nirspi_register_map::*;
(
    input  var logic                           clk        ,
    input  var logic                           rst        ,
    input  var logic                  [16-1:0] address    , /// Stands long before `write` or `read`
    input  var logic                  [32-1:0] data       ,
    input  var logic                           write      ,
    input  var logic                           read       ,
    input  var logic                           copy       , /// A run begins: takes the settings over
    input  var logic                           copy_raw   , /// It is a raw burst
    output var logic                           in_range   , /// Every setting is
    output var nirspi_types::Settings          settings   ,
    output var logic                           parallel   , /// Packets of the run leave by the parallel port
    output var nirspi_types::Stamp             stamp      , /// Copied with the settings
    input  var logic                  [32-1:0] status     ,
    input  var logic                  [3-1:0]  fault      ,
    input  var logic                  [32-1:0] frames_made,
    input  var logic                  [32-1:0] frames_lost,
    input  var logic                           delivered  , /// There is a frame
    input  var nirspi_types::Header            header     , /// Of that frame
    input  var logic                  [64-1:0] clock_now  ,
    input  var logic                  [10-1:0] table_entry,
    output var logic                  [32-1:0] value       /// Two clocks after `read`, and from then on
);


    logic [32-1:0] scratch   ;
    logic [32-1:0] mode      ;
    logic [32-1:0] patterns  ;
    logic [32-1:0] dwell     ;
    logic [32-1:0] blank     ;
    logic [32-1:0] latency   ;
    logic [32-1:0] sweeps    ;
    logic [32-1:0] frames    ;
    logic [32-1:0] raw_length;
    logic [32-1:0] watchdog  ;
    logic [32-1:0] duty_limit;
    logic [32-1:0] trip      ;
    logic [32-1:0] run       ;
    logic [32-1:0] time_low  ;
    logic [32-1:0] time_high ;
    logic [32-1:0] writes    ;
    logic [64-1:0] clock_read; // as of the last read of its low word

    always_ff @ (posedge clk) begin
        if (rst) begin
            scratch    <= RESET_SCRATCH;
            mode       <= RESET_MODE;
            patterns   <= RESET_PATTERNS;
            dwell      <= RESET_DWELL;
            blank      <= RESET_BLANK;
            latency    <= RESET_LATENCY;
            sweeps     <= RESET_SWEEPS;
            frames     <= RESET_FRAMES;
            raw_length <= RESET_RAW_LENGTH;
            watchdog   <= RESET_WATCHDOG;
            duty_limit <= RESET_DUTY_LIMIT;
            trip       <= RESET_OVER_RANGE_TRIP;
            run        <= RESET_RUN;
            time_low   <= RESET_TIME_LOW;
            time_high  <= RESET_TIME_HIGH;
        end else if (write) begin
            case (32'(address)) inside
                ADDRESS_SCRATCH        : scratch    <= data;
                ADDRESS_MODE           : mode       <= data;
                ADDRESS_PATTERNS       : patterns   <= data;
                ADDRESS_DWELL          : dwell      <= data;
                ADDRESS_BLANK          : blank      <= data;
                ADDRESS_LATENCY        : latency    <= data;
                ADDRESS_SWEEPS         : sweeps     <= data;
                ADDRESS_FRAMES         : frames     <= data;
                ADDRESS_RAW_LENGTH     : raw_length <= data;
                ADDRESS_WATCHDOG       : watchdog   <= data;
                ADDRESS_DUTY_LIMIT     : duty_limit <= data;
                ADDRESS_OVER_RANGE_TRIP: trip       <= data;
                ADDRESS_RUN            : run        <= data;
                ADDRESS_TIME_LOW       : time_low   <= data;
                ADDRESS_TIME_HIGH      : time_high  <= data;
                default                : begin
                end
            endcase
        end
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            writes <= RESET_WRITES;
        end else if (write) begin
            writes <= writes + 1;
        end
    end

    // The verdict stands a few clocks after a write, long before the next access can ask for it.
    logic [10-1:0] good;

    always_ff @ (posedge clk) begin
        if (rst) begin
            good     <= 0;
            in_range <= 0;
        end else begin
            good[0]  <= (mode & ~MODE_DEFINED) == 0 && (mode & (MODE_PARALLEL | MODE_PACKETS)) != MODE_PARALLEL;
            good[1]  <= patterns != 0 && patterns <= PATTERNS;
            good[2]  <= dwell != 0 && dwell[31:16] == 0;
            good[3]  <= blank < dwell;
            good[4]  <= latency <= LATENCY_MAX;
            good[5]  <= sweeps != 0;
            good[6]  <= raw_length != 0 && raw_length <= RAW_SAMPLES_MAX;
            good[7]  <= watchdog != 0;
            good[8]  <= watchdog <= WATCHDOG_MAX;
            good[9]  <= duty_limit <= DUTY_LIMIT_MAX;
            in_range <= &good;
        end
    end

    // Worked out ahead of the copy, for the same reason.
    nirspi_types::Settings next;

    always_ff @ (posedge clk) begin
        next.raw              <= 0;
        next.order_table      <= (mode & MODE_ORDER_TABLE) != 0;
        next.order_sequency   <= (mode & MODE_ORDER_SEQUENCY) != 0;
        next.differential     <= (mode & MODE_DIFFERENTIAL) != 0;
        next.alternating      <= (mode & MODE_ALTERNATING) != 0 && (mode & MODE_DIFFERENTIAL) != 0;
        next.test_source      <= (mode & MODE_TEST_SOURCE) != 0;
        next.unlit            <= (mode & MODE_UNLIT) != 0;
        next.packets          <= (mode & MODE_PACKETS) != 0;
        next.narrow           <= (mode & MODE_NARROW) != 0;
        next.patterns         <= patterns[10:0];
        next.patterns_less_1  <= patterns[9:0] - 1;
        next.single_pattern   <= patterns == 1;
        next.dwell_less_1     <= dwell[15:0] - 1;
        next.single_clock     <= dwell == 1;
        next.blank            <= blank[15:0];
        next.unblanked        <= blank == 0;
        next.latency          <= latency[5:0];
        next.sweeps           <= sweeps;
        next.sweeps_less_1    <= sweeps - 1;
        next.single_sweep     <= sweeps == 1;
        next.frames_less_1    <= frames - 1;
        next.single_frame     <= frames == 1;
        next.endless          <= frames == 0;
        next.raw_less_1       <= raw_length[11:0] - 1;
        next.watchdog_less_1  <= watchdog[26:0] - 1;
        next.duty_limit       <= duty_limit[20:0];
        next.trips_over_range <= trip != 0;
        next.over_range_trip  <= trip;
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            settings <= nirspi_types::Settings'(0);
            parallel <= 0;
        end else if (copy) begin
            settings         <= next;
            settings.raw     <= copy_raw;
            settings.endless <= next.endless || copy_raw;
            parallel         <= (mode & MODE_PARALLEL) != 0;
        end
    end
    always_ff @ (posedge clk) begin
        if (copy) begin
            stamp.run        <= run[15:0];
            stamp.clock_base <= clock_read;
            stamp.time_base  <= {time_high, time_low};
        end
    end

    // Which word is asked for, worked out while the access waits.
    logic [17-1:0] asked      ;
    logic [8-1:0]  asked_live ;
    logic          asked_table;

    always_ff @ (posedge clk) begin
        asked[0]      <= 32'(address) == ADDRESS_SCRATCH;
        asked[1]      <= 32'(address) == ADDRESS_MODE;
        asked[2]      <= 32'(address) == ADDRESS_PATTERNS;
        asked[3]      <= 32'(address) == ADDRESS_DWELL;
        asked[4]      <= 32'(address) == ADDRESS_BLANK;
        asked[5]      <= 32'(address) == ADDRESS_LATENCY;
        asked[6]      <= 32'(address) == ADDRESS_SWEEPS;
        asked[7]      <= 32'(address) == ADDRESS_FRAMES;
        asked[8]      <= 32'(address) == ADDRESS_RAW_LENGTH;
        asked[9]      <= 32'(address) == ADDRESS_WATCHDOG;
        asked[10]     <= 32'(address) == ADDRESS_DUTY_LIMIT;
        asked[11]     <= 32'(address) == ADDRESS_OVER_RANGE_TRIP;
        asked[12]     <= 32'(address) == ADDRESS_CLOCK_HIGH;
        asked[13]     <= 32'(address) == ADDRESS_WRITES;
        asked[14]     <= 32'(address) == ADDRESS_RUN;
        asked[15]     <= 32'(address) == ADDRESS_TIME_LOW;
        asked[16]     <= 32'(address) == ADDRESS_TIME_HIGH;
        asked_live[0] <= 32'(address) == ADDRESS_STATUS;
        asked_live[1] <= 32'(address) == ADDRESS_FAULT;
        asked_live[2] <= 32'(address) == ADDRESS_FRAMES_MADE;
        asked_live[3] <= 32'(address) == ADDRESS_FRAMES_LOST;
        asked_live[4] <= 32'(address) == ADDRESS_CLOCK_LOW;
        asked_live[5] <= 32'(address) == ADDRESS_SUM_LOW;
        asked_live[6] <= 32'(address) == ADDRESS_SUM_HIGH;
        asked_live[7] <= 32'(address) == ADDRESS_OVER_RANGE;
        asked_table   <= address[15:10] == ORDER_TABLE[15:10];
    end

    // What changes by itself is held as of the clock of the read; the rest stands.
    logic [32-1:0] live    ;
    logic [32-1:0] stored_0;
    logic [32-1:0] stored_1;
    logic [32-1:0] stored_2;
    logic [32-1:0] entry   ;

    always_ff @ (posedge clk) begin
        if (read) begin
            live <= (status & {32{asked_live[0]}}) | (32'(fault) & {32{asked_live[1]}})
                | (frames_made & {32{asked_live[2]}}) | (frames_lost & {32{asked_live[3]}})
                | (clock_now[31:0] & {32{asked_live[4]}}) | (header.total[31:0] & {32{asked_live[5] && delivered}})
                | (header.total[63:32] & {32{asked_live[6] && delivered}})
                | (header.over_range & {32{asked_live[7] && delivered}});
        end
        stored_0 <= (scratch & {32{asked[0]}}) | (mode & {32{asked[1]}}) | (patterns & {32{asked[2]}})
            | (dwell & {32{asked[3]}}) | (blank & {32{asked[4]}}) | (latency & {32{asked[5]}});
        stored_1 <= (sweeps & {32{asked[6]}}) | (frames & {32{asked[7]}}) | (raw_length & {32{asked[8]}})
            | (watchdog & {32{asked[9]}}) | (duty_limit & {32{asked[10]}}) | (trip & {32{asked[11]}})
            | (clock_read[63:32] & {32{asked[12]}}) | (writes & {32{asked[13]}});
        stored_2 <= (run & {32{asked[14]}}) | (time_low & {32{asked[15]}}) | (time_high & {32{asked[16]}});
        entry <= 32'(table_entry) & {32{asked_table}};
        value <= live | stored_0 | stored_1 | stored_2 | entry;
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            clock_read <= 0;
        end else if (read && 32'(address) == ADDRESS_CLOCK_LOW) begin
            clock_read <= clock_now;
        end
    end
endmodule
