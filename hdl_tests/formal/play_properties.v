// What the sequencer puts out after a request: `playing` comes with a strobe exactly where the scan ran at its tick, and
// the scan runs as the requests at the ports have it. In the pipeline and in low area, of ports alone.
//
// The host may do anything on any clock. The axes are those beside this file; request_properties has the rest.

`default_nettype none

module play_properties #(
    parameter LOW_AREA = 0
) (
    input wire        clock,
    input wire        reset,
    input wire        write,
    input wire [2:0]  write_region,
    input wire [15:0] write_address,
    input wire [31:0] write_data,
    input wire        commit,
    input wire        withdraw,
    input wire        arm,
    input wire [15:0] arm_frames,
    input wire        trigger,
    input wire        park,
    input wire        clear_faults,
    input wire        tick,
    input wire        underrun
);
    localparam LATENCY = 24;  // clocks from a tick to its strobe, in the pipeline with multiplier blocks
    wire writable, refused, committed, armed, running, busy, strobe, swapped_marker;
    wire line_marker, frame_marker, pixel_marker, backward_marker, valid_marker, playing, parked;
    wire [7:0] x_code, y_code;
    wire [3:0] faults;
    wire [4*2-1:0] fault_counts;

    dac_sequencer #(
        .DAC_BITS(8), .X_INDEX_BITS(3), .X_WORD_BITS(8), .Y_INDEX_BITS(3), .Y_WORD_BITS(8), .TICK_BITS(4),
        .LINE_BITS(2), .PERIOD_BITS(8), .COUNT_BITS(2), .PLAIN_MULTIPLIER(1), .LOW_AREA(LOW_AREA)
    ) uut (
        .clock(clock), .reset(reset), .write(write), .write_region(write_region), .write_address(write_address),
        .write_data(write_data), .writable(writable), .refused(refused), .commit(commit), .withdraw(withdraw),
        .committed(committed), .arm(arm), .arm_frames(arm_frames), .trigger(trigger), .park(park),
        .clear_faults(clear_faults), .armed(armed), .running(running), .tick(tick), .underrun(underrun), .busy(busy),
        .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(line_marker), .frame_marker(frame_marker),
        .pixel_marker(pixel_marker), .backward_marker(backward_marker), .valid_marker(valid_marker),
        .swapped_marker(swapped_marker), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );

    reg before, was_stopped, was_running, was_armed, was_arm, was_trigger, was_tick;
    reg [LATENCY-1:0] ticks, ran;  // the highest bit is of the tick whose strobe may come now
    reg works, ran_last;           // in low area, a tick at a time
    initial begin
        before = 0;
        ticks = 0;
        ran = 0;
        works = 0;
    end
    always @(posedge clock) begin
        before <= 1;
        was_stopped <= park || reset;
        was_running <= running;
        was_armed <= armed;
        was_arm <= arm;
        was_trigger <= trigger;
        was_tick <= tick && !busy;
        ticks <= {ticks[LATENCY-2:0], tick};
        ran <= {ran[LATENCY-2:0], tick && running};
        if (tick && !busy) ran_last <= running;
        works <= (tick && !busy) || (works && !strobe);
    end
    always @* if (before) begin
        if (was_stopped) assert (!running && !armed);
        if (running && !was_running) assert (was_trigger && (was_armed || was_arm) && !was_stopped);
        if (was_running && !running) assert (was_stopped || was_tick);
        if (armed && !was_armed) assert (was_arm);
        if (was_arm && !was_trigger && !was_stopped) assert (armed);
    end
    always @* begin
        if (strobe && LOW_AREA) assert (works && playing == ran_last);
        if (!LOW_AREA) assert (strobe == ticks[LATENCY-1]);
        if (!LOW_AREA && strobe) assert (playing == ran[LATENCY-1]);
    end

    // Not vacuous: a scan of one frame plays to its end.
    reg played;
    initial played = 0;
    always @(posedge clock) played <= played || (strobe && playing);
    always @* cover (played && strobe && !playing);
endmodule

`default_nettype wire
