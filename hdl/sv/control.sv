/// Accesses of the host and what they set off: starts, stops, releases.
///
/// Invariant: an access takes effect between two clocks of those being done with, on all of the machine's
/// state at once; so it finds everything as the model has it at its moment. A start is followed by clock 0 of
/// its run, which in turn is done with `DEPTH` clocks later; the next access waits for that.
module nirspi_control
    import nirspi_register_map::*;
(
    input  var logic          clk          ,
    input  var logic          rst          ,
    input  var logic          request      , /// An access came in; address and data stand until `answered`
    input  var logic          is_write     ,
    input  var logic [16-1:0] address      ,
    input  var logic [32-1:0] data         ,
    output var logic          answered     ,
    output var logic          access       , /// It takes effect before this clock
    output var logic          write        , /// It does, and is a write
    input  var logic          in_range     , /// Every setting is
    input  var logic          interlock_now, /// Closed, at the pin
    input  var logic [3-1:0]  fault        ,
    input  var logic          opens        , /// The interlock ends the run before this clock
    input  var logic          trips        , /// This clock ends the run
    input  var logic          ends         , /// This clock is the last of the run
    output var logic          stop         ,
    output var logic          clear        ,
    output var logic          give_back    ,
    output var logic          begins       , /// A run is accepted
    output var logic          begins_raw   , /// A raw burst is
    output var logic          go           , /// Clock 0 of the run is chosen with the next clock
    output var logic          go_sample    , /// The sample of clock 0 leaves the source after the next clock
    output var logic          go_raw       , /// It does with the next clock
    output var logic          arrives      , /// The next clock is done with, of clock 0
    output var logic          first        , /// This one is
    output var logic          running      , /// This clock is done with and is one of a run
    output var logic          halt         , /// The run has ended
    output var logic          table_write  ,
    output var logic          config_error ,
    output var logic          write_refused
);


    localparam int unsigned ANSWER = nirspi_types::DEPTH + 6;

    // The age of the access under way.
    logic [6-1:0] age ;
    logic         busy;

    always_ff @ (posedge clk) begin
        if (rst) begin
            age      <= 0;
            busy     <= 0;
            access   <= 0;
            answered <= 0;
        end else begin
            access   <= busy && age == 0;
            answered <= busy && age == 6'(ANSWER);
            if (request) begin
                busy <= 1;
                age  <= 0;
            end else if (age == 6'(ANSWER)) begin
                busy <= 0;
            end else begin
                age <= age + 1;
            end
        end
    end

    // What it means, worked out while it waits.
    logic to_control;
    logic to_table  ;
    logic starts    ;

    always_ff @ (posedge clk) begin
        to_control <= is_write && 32'(address) == ADDRESS_CONTROL;
        to_table   <= is_write && address[15:10] == ORDER_TABLE[15:10];
        starts     <= (data & (CONTROL_START | CONTROL_START_RAW)) != 0;
    end

    logic wanted;
    always_comb begin
        write     = access && is_write;
        stop      = access && to_control && (data & CONTROL_STOP) != 0;
        clear     = access && to_control && (data & CONTROL_CLEAR_FAULT) != 0;
        give_back = access && to_control && (data & CONTROL_RELEASE) != 0;
        wanted    = access && to_control && starts && interlock_now && !(running && !stop && !opens)
            && (clear || fault == 0 && !opens);
        begins      = wanted && in_range;
        begins_raw  = (data & CONTROL_START) == 0;
        table_write = access && to_table && !running;
    end

    always_ff @ (posedge clk) begin
        if (rst) begin
            config_error  <= 0;
            write_refused <= 0;
        end else begin
            if (wanted) begin
                config_error <= !in_range;
            end
            if (begins) begin
                write_refused <= 0;
            end else if (access && to_table && running) begin
                write_refused <= 1;
            end
        end
    end

    // A run on its way through the machine.
    logic [15-1:0] going;
    always_ff @ (posedge clk) begin
        if (rst) begin
            going   <= 0;
            running <= 0;
            halt    <= 0;
        end else begin
            going <= {going[13:0], begins};
            halt  <= running && (stop || opens || trips || ends);
            if (arrives) begin
                running <= 1;
            end else if (stop || opens || trips || ends) begin
                running <= 0;
            end
        end
    end
    always_comb go        = going[0];
    always_comb go_sample = going[6];
    always_comb go_raw    = going[7];
    always_comb arrives   = going[nirspi_types::DEPTH - 1];
    always_comb first     = going[nirspi_types::DEPTH];
endmodule
