// When a program is taken: by the first tick of a line, or by a tick while nothing plays, and only if it was committed;
// in the mode `frame` by the first tick of a frame.
//
// dac_scan and dac_bank as dac_sequencer wires them; the last sample of the old program may have left at any time. The
// host may do anything on any clock; of a line that it commits is asked only that it has at least 8 ticks (as dac_scan
// says). The reference counts the ticks of a line by itself, from when a scan or a program begins.

`default_nettype none

module scan_properties
`include "scan_under_test.vh"

    // The line that was written, and the one that plays.
    reg [TICK_BITS:0] written_ticks, line_ticks, number;
    initial begin
        written_ticks = 0;
        line_ticks = 8;
        number = 0;
    end
    wire writes = write && writable && write_address == 4'd0;
    wire [TICK_BITS:0] ticks_now = writes ? write_data[TICK_BITS:0] : written_ticks;
    always @* if (commit && writable) assume (ticks_now >= 8 && ticks_now <= (1 << TICK_BITS));
    always @(posedge clock) begin
        written_ticks <= ticks_now;
        if (take) line_ticks <= written_ticks;
        if (!running)
            number <= 0;
        else if (tick)
            number <= take ? 1 : number + 1 == line_ticks ? 0 : number + 1;
    end

    reg before, taken, was_committed, was_bank, may_go;
    reg [TICK_BITS:0] was_number;
    initial before = 0;
    always @(posedge clock) begin
        before <= 1;
        taken <= take;
        was_committed <= committed;
        was_bank <= bank;
        may_go <= take || withdraw || reset;
        was_number <= number;
    end
    always @* begin
        if (take) assert (tick && committed);
        if (take && running) assert (number == 0);
        // and then it does not wait
        if (tick && committed && (!running || (number == 0 && mode != 2'd2))) assert (take);
        if (before) begin
            assert ((bank != was_bank) == taken);
            assert (load == taken);
            if (was_committed && !may_go) assert (committed);
            if (was_committed && may_go) assert (!committed);
            if (line) assert (was_number == 0);
            if (runs) assert ({1'b0, tick_number} == was_number);
        end
    end
    // Not vacuous: a second program is taken in a running scan.
    always @* cover (take && running && loaded);

    // What makes it inductive.
    wire scan__first, scan__last, scan__starts;
    wire [TICK_BITS-1:0] scan__at_tick, scan__next_to_last_tick;
    wire [TICK_BITS-1:0] scan__idle_next_to_last;
    wire [TICK_BITS:0] written_less_two = written_ticks - 2;
    always @* begin
        assert (scan__idle_next_to_last == written_less_two[TICK_BITS-1:0] || written_ticks == 0);
        if (committed) assert (written_ticks >= 8 && written_ticks <= (1 << TICK_BITS));
        if (loaded) assert ({1'b0, scan__next_to_last_tick} + 2 == line_ticks && line_ticks >= 8);
        if (!loaded) assert (scan__next_to_last_tick == 1 && line_ticks == 8);
        if (loaded) assert (line_ticks <= (1 << TICK_BITS));
        if (running) begin
            assert (loaded || committed);
            if (!loaded) assert (number == 0 && scan__starts);
            assert (number == {1'b0, scan__at_tick} && number < line_ticks);
            assert (scan__first == (number == 0));
            assert (scan__last == (number == line_ticks - 1));
        end
    end
endmodule

`default_nettype wire
