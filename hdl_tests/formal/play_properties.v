// What the sequencer puts out after a request: `playing` comes with a strobe exactly where the scan ran at its tick, and
// the scan runs as the requests at the ports have it. A tick is lost only while `busy`, which is a fault on the next
// clock: in the pipeline with cubic tables on the ten clocks after a tick, with lines never. Of ports alone.
//
// The host may do anything on any clock. The axes are those beside this file; request_properties has the rest.

`default_nettype none

module play_properties
`include "sequencer_under_test.vh"

    localparam LATENCY = CUBIC ? 57 : 24;  // clocks from a tick to its strobe, in the pipeline with multiplier blocks

    reg before, was_stopped, was_withdraw, was_running, was_armed, was_arm, was_trigger, was_tick, was_lost;
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
        was_withdraw <= withdraw;
        was_running <= running;
        was_armed <= armed;
        was_arm <= arm;
        was_trigger <= trigger;
        was_tick <= tick && !busy;
        was_lost <= tick && busy;
        ticks <= {ticks[LATENCY-2:0], tick && !busy};
        ran <= {ran[LATENCY-2:0], tick && !busy && running};
        if (tick && !busy) ran_last <= running;
        works <= (tick && !busy) || (works && !strobe);
    end
    always @* if (before) begin
        if (was_stopped) assert (!running && !armed);
        if (running && !was_running) assert (was_trigger && (was_armed || was_arm) && !was_stopped);
        if (was_running && !running) assert (was_stopped || was_tick || was_withdraw);
        if (armed && !was_armed) assert (was_arm);
        if (was_arm && !was_trigger && !was_stopped) assert (armed);
        if (was_lost) assert (faults[2]);
    end
    always @* begin
        if (strobe && LOW_AREA) assert (works && playing == ran_last);
        if (!LOW_AREA) assert (strobe == ticks[LATENCY-1]);
        if (!LOW_AREA) assert (busy == (CUBIC && ticks[9:0] != 0));  // a table of lines loses none
        if (!LOW_AREA && strobe) assert (playing == ran[LATENCY-1]);
    end

`ifdef PIPELINED
    // What makes it inductive: the ticks on their way, in the sequencer and here.
    wire [LATENCY-2:0] uut__pipelined__ticks_now, uut__pipelined__runnings_now;
    always @* begin
        assert (uut__pipelined__ticks_now == ticks[LATENCY-2:0]);
        assert (((uut__pipelined__runnings_now ^ ran) & ticks[LATENCY-2:0]) == 0);
    end
`endif

    // Not vacuous: a scan of one frame plays to its end.
    reg played;
    initial played = 0;
    always @(posedge clock) played <= played || (strobe && playing);
    always @* cover (played && strobe && !playing);
endmodule

`default_nettype wire
