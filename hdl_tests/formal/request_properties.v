// What requests do to a scan: `park` and `reset` stop it whatever else comes on their clock, a trigger starts it only if
// it was armed, a counted scan plays its frames and no tick more, and lines are counted round a frame, also where a
// program continues it. In the mode `frame` a program is taken by the first tick of a frame alone.
//
// dac_scan and dac_bank as dac_sequencer wires them. The host may do anything on any clock; of a program that it commits
// is asked what dac_fit asks of it: lines of at least 8 ticks, at least one line, and both within their counters. The
// reference counts ticks, lines and frames by itself.

`default_nettype none

module request_properties
`include "scan_under_test.vh"

    // The schedule that was written, and the one that plays.
    reg [TICK_BITS:0] written_ticks, ticks;
    reg [LINE_BITS:0] written_lines, lines;
    initial begin
        written_ticks = 0;
        written_lines = 0;
        ticks = 8;
        lines = 1;
    end
    wire [TICK_BITS:0] ticks_now = write && writable && write_address == 4'd0 ? write_data[TICK_BITS:0] : written_ticks;
    wire [LINE_BITS:0] lines_now = write && writable && write_address == 4'd1 ? write_data[LINE_BITS:0] : written_lines;
    always @* if (commit && writable) begin
        assume (ticks_now >= 8 && ticks_now <= (1 << TICK_BITS));
        assume (lines_now >= 1 && lines_now <= (1 << LINE_BITS));
    end

    // The reference: tick k of line j, frames that this scan has played, and how many it is to play; 0 is without end.
    reg plays, is_armed;
    reg [TICK_BITS:0] k;
    reg [LINE_BITS:0] j;
    reg [FRAME_BITS-1:0] frames, wanted, asked;
    initial begin
        plays = 0;
        is_armed = 0;
        k = 0;
        j = 0;
        frames = 0;
        wanted = 0;
        asked = 0;
    end
    wire takes = tick && committed && (!plays || (k == 0 && (mode != 2'd2 || j == 0)));
    // A program continues the frame of the last one if it has the same lines, and the same steps of y.
    reg written_steps, steps, had_program;
    initial begin
        written_steps = 0;
        steps = 0;
        had_program = 0;
    end
    wire continues = mode == 2'd1 && had_program && written_ticks == ticks && written_lines == lines &&
                     written_steps == steps;
    always @(posedge clock) begin
        if (write && writable && write_address == 4'd13) written_steps <= write_data[0];
        if (takes) steps <= written_steps;
        had_program <= had_program || takes;
    end
    wire [LINE_BITS:0] this_j = takes && !continues ? 0 : j;  // of the tick of this clock
    wire line_ends = k + 1 == ticks;            // a line of 8 ticks or more ends with another tick than it begins with
    wire frame_ends = line_ends && this_j + 1 == lines;
    wire ends = tick && plays && frame_ends && wanted != 0 && frames + 1 == wanted;
    wire goes_on = plays && !ends;
    wire lost = withdraw && !loaded && !takes;  // the first program, before it is taken
    wire starts = trigger && (is_armed || arm) && !goes_on && (loaded || committed) && !lost && !park && !reset;
    always @(posedge clock) begin
        written_ticks <= ticks_now;
        written_lines <= lines_now;
        if (takes) begin
            ticks <= written_ticks;
            lines <= written_lines;
        end
        plays <= (goes_on || starts) && !lost && !park && !reset;
        is_armed <= (is_armed || arm) && !starts && !park && !reset;
        if (arm) asked <= arm_frames;
        if (starts) begin
            k <= 0;
            j <= 0;
            frames <= 0;
            wanted <= arm ? arm_frames : asked;
        end else if (tick && plays) begin
            k <= line_ends ? 0 : k + 1;
            j <= !line_ends ? this_j : frame_ends ? 0 : this_j + 1;
            if (frame_ends && wanted != 0) frames <= frames + 1;
        end
    end

    // The properties, of ports alone: what was asked on the clock before, and what is on this one.
    reg before, was_stopped, was_running, was_armed, was_arm, was_trigger, was_loaded, was_tick, was_playing, was_ended,
        was_lost;
    reg [TICK_BITS:0] was_k;
    reg [LINE_BITS:0] was_j;
    initial before = 0;
    always @(posedge clock) begin
        before <= 1;
        was_stopped <= park || reset;
        was_running <= running;
        was_armed <= armed;
        was_arm <= arm;
        was_trigger <= trigger;
        was_loaded <= loaded || committed;
        was_lost <= withdraw && !loaded && !take;
        was_tick <= tick;
        was_playing <= plays;
        was_ended <= ends;
        was_k <= k;
        was_j <= this_j;
    end
    always @* if (before) begin
        // After a park or a reset nothing plays on the next tick, and nothing is armed.
        if (was_stopped) assert (!running && !armed);
        // A scan begins by a trigger of an armed device with a program, and by nothing else.
        if (running && !was_running) begin
            assert (was_trigger && (was_armed || was_arm) && was_loaded && !was_stopped && !was_lost);
            assert (loaded || committed);
        end
        // A trigger is taken once.
        if (running && !was_running) assert (!armed);
        if (armed && !was_armed) assert (was_arm);
        // A counted scan is over with the last tick of its last frame, and not before.
        if (was_ended && !was_trigger) assert (!running);
        if (was_running && !running) assert (was_stopped || was_ended || was_lost);
        assert (running == plays && armed == is_armed);
        // What a tick is.
        assert (tick_out == was_tick);
        assert (runs == (was_tick && was_playing));
        if (runs) begin
            assert (tick_number == was_k && line_number == was_j);
            assert ({1'b0, line_number} < lines && {1'b0, tick_number} < ticks);
            assert (line == (was_k == 0) && frame == (was_k == 0 && was_j == 0));
        end else
            assert (!line && !frame && !begins && !y_advance);
    end


`ifndef PROPERTIES_ALONE
    // What makes it inductive.
    wire scan__first, scan__last, scan__top, scan__bottom, scan__last_frame, scan__endless, scan__starts;
    wire [TICK_BITS-1:0] scan__at_tick, scan__next_to_last_tick;
    wire [TICK_BITS-1:0] scan__idle_next_to_last;
    wire [TICK_BITS:0] written_less_two = written_ticks - 2;
    wire scan__y_steps, scan__idle_y_steps;
    wire [LINE_BITS-1:0] scan__at_line, scan__last_line_number;
    wire [LINE_BITS-1:0] scan__idle_last_line;
    wire [LINE_BITS:0] written_less_one = written_lines - 1;
    wire [FRAME_BITS-1:0] scan__frames_left, scan__armed_frames;
    always @* begin
        assert (scan__idle_next_to_last == written_less_two[TICK_BITS-1:0] || written_ticks == 0);
        assert (scan__idle_last_line == written_less_one[LINE_BITS-1:0] || written_lines == 0);
        assert (scan__idle_y_steps == written_steps && scan__y_steps == steps && had_program == loaded);
        if (committed) assert (written_ticks >= 8 && written_ticks <= (1 << TICK_BITS));
        if (committed) assert (written_lines >= 1 && written_lines <= (1 << LINE_BITS));
        if (loaded) begin
            assert ({1'b0, scan__next_to_last_tick} + 2 == ticks && ticks >= 8 && ticks <= (1 << TICK_BITS));
            assert ({1'b0, scan__last_line_number} + 1 == lines && lines >= 1 && lines <= (1 << LINE_BITS));
        end
        if (!loaded) assert (scan__next_to_last_tick == 1 && ticks == 8 && lines == 1);
        if (is_armed) assert (scan__armed_frames == asked);
        if (plays) begin
            assert (loaded || (committed && scan__starts));
            assert (k == {1'b0, scan__at_tick} && k < ticks);
            assert (j == {1'b0, scan__at_line} && j < lines);
            assert (scan__first == (k == 0));
            assert (scan__last == (k == ticks - 1));
            assert (scan__top == (j == 0) || (scan__starts && k == 0));
            if (scan__starts) assert (k == 0 && j == 0);
            if (k >= 2) assert (scan__bottom == (j == lines - 1));
            assert (scan__endless == (wanted == 0));
            if (wanted != 0) assert (frames < wanted && scan__frames_left == wanted - frames);
            if (k >= 1) assert (scan__last_frame == (wanted != 0 && wanted - frames == 1));
        end
    end
`endif
endmodule

`default_nettype wire
