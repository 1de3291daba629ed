// The slow part in the sequencer: no line ever plays words of another. At every tick of a scan both axes have in the
// half that plays the words of that line, of the program that plays.
//
// The host may do anything on any clock, in every mode of a commit; a line may take any time to be worked out. What is
// worked out is a label: the line, and the colour of its program. Asked of what the host commits is what dac_fit and
// dac_whole ask: lines of at least 8 ticks, as many lines as the counter has, and all words written anew.
//
// `part` is `uut.low_area.slow_part.axes`
// `x_axis` is `uut.low_area.slow_part.axes.x_axis`
// `y_axis` is `uut.low_area.slow_part.axes.y_axis`
// `engine` is `uut.low_area.slow_part.axes.engine`
// `store` is `uut.low_area.slow_part.axes.store`

`default_nettype none

module slow_play_properties (
    input wire        clock,
    input wire        reset,
    input wire        write,
    input wire [2:0]  write_region,
    input wire [15:0] write_address,
    input wire [31:0] write_data,
    input wire        commit,
    input wire [1:0]  commit_mode,
    input wire        withdraw,
    input wire        arm,
    input wire [15:0] arm_frames,
    input wire        trigger,
    input wire        park,
    input wire        tick
);
    localparam LINE_BITS = 2, TICK_BITS = 4;
    wire writable, committed, armed, running, busy;
    dac_sequencer #(
        .DAC_BITS(8), .X_INDEX_BITS(3), .X_WORD_BITS(8), .Y_INDEX_BITS(3), .Y_WORD_BITS(8), .TICK_BITS(TICK_BITS),
        .LINE_BITS(LINE_BITS), .PERIOD_BITS(8), .COUNT_BITS(2), .LOW_AREA(1), .SLOW_PART(1), .SLOW_INDEX_BITS(3),
        .COMMIT_MODES(1)
    ) uut (
        .clock(clock), .reset(reset), .write(write), .write_region(write_region), .write_address(write_address),
        .write_data(write_data), .writable(writable), .refused(), .commit(commit), .commit_mode(commit_mode),
        .withdraw(withdraw), .committed(committed), .can_keep(), .arm(arm), .arm_frames(arm_frames),
        .trigger(trigger), .park(park), .clear_faults(1'b0), .armed(armed), .running(running), .tick(tick),
        .underrun(1'b0), .busy(busy), .strobe(), .x_code(), .y_code(), .line_marker(), .frame_marker(),
        .pixel_marker(), .backward_marker(), .valid_marker(), .swapped_marker(), .playing(), .parked(), .faults(),
        .fault_counts()
    );

    wire uut__take, uut__bank, uut__loaded, uut__tick_0, uut__runs_0, uut__line_0, uut__load_0, uut__sound_commit;
    wire uut__scan_write;
    wire [LINE_BITS-1:0] uut__line_number;
    wire [15:0] uut__address;
    wire [31:0] uut__data;
    wire part__half;
    wire [LINE_BITS:0] part__lines_0, part__lines_1;
    wire [2:0] x_axis__label_0, x_axis__label_1, y_axis__label_0, y_axis__label_1;
    wire [1:0] store__colours;

    // What is asked of a commit.
    wire [TICK_BITS-1:0] uut__scan__idle_next_to_last, uut__scan__next_to_last_tick;
    wire [LINE_BITS:0] idle_lines = uut__bank ? part__lines_0 : part__lines_1;
    wire [LINE_BITS:0] lines = uut__bank ? part__lines_1 : part__lines_0;
    reg lines_known;  // written since the last swap
    initial lines_known = 0;
    always @(posedge clock)
        lines_known <= !uut__take && (lines_known || (uut__scan_write && uut__address[3:0] == 4'd1));
    always @* if (uut__sound_commit) begin
        assume (lines_known && idle_lines >= 1 && idle_lines <= 1 << LINE_BITS);
        assume (uut__scan__idle_next_to_last >= 6 && uut__scan__idle_next_to_last <= (1 << TICK_BITS) - 2);
    end

    // The property, on the clock after the flags of a tick, from which on the half plays.
    reg plays;
    reg [LINE_BITS-1:0] line;
    initial plays = 0;
    always @(posedge clock) begin
        plays <= uut__tick_0 && uut__runs_0;
        line <= uut__line_number;
    end
    wire [2:0] expected = {line, store__colours[uut__bank]};
    wire [2:0] x_label = part__half ? x_axis__label_1 : x_axis__label_0;
    wire [2:0] y_label = part__half ? y_axis__label_1 : y_axis__label_0;
    always @* if (plays) begin
        assert (x_label == expected);
        assert (y_label == expected);
    end
    // Not vacuous: a line of another program than the first one plays.
    always @* cover (plays && expected == 3'b001);

`ifndef PROPERTIES_ALONE
    // What makes it inductive. The scan: where it is in its line and frame.
    wire uut__scan__first, uut__scan__last, uut__scan__top, uut__scan__bottom, uut__scan__starts;
    wire [TICK_BITS-1:0] uut__scan__at_tick;
    wire [LINE_BITS-1:0] uut__scan__at_line, uut__scan__last_line_number, uut__scan__idle_last_line;
    wire uut__keep, uut__at_frame, uut__same_frame, uut__host_write, uut__host_commit, uut__x_write, uut__y_write;
    wire uut__banks__draining;
    wire part__preparing, part__is_idle, part__needs_idle, part__anew;
    wire [LINE_BITS-1:0] part__next_line, part__line_at, part__line_after;
    wire engine__done, engine__works, engine__reads, store__colour;
    wire [1:0] engine__wrote;
    wire [8:0] x_axis__works;
    wire works = uut__tick_0 || x_axis__works != 0;

    wire [LINE_BITS-1:0] idle_last = idle_lines - 1, last_of_lines = lines - 1;

    // Lines of 8 ticks or more, and the line after the one that plays, or due.
    wire [LINE_BITS-1:0] last_line = uut__scan__last_line_number;
    wire [LINE_BITS-1:0] due = uut__scan__starts ? 0 : uut__scan__first ? uut__scan__at_line :
                               uut__scan__at_line == last_line ? 0 : uut__scan__at_line + 1;
    wire [2:0] next_x = part__half ? x_axis__label_0 : x_axis__label_1;
    wire [2:0] next_y = part__half ? y_axis__label_0 : y_axis__label_1;
    wire [2:0] worked = {part__line_at, store__colours[uut__bank ^ part__is_idle ^ uut__load_0]};
    wire [2:0] at_line = {uut__scan__at_line, store__colours[uut__bank]};
    wire [2:0] this_line = {uut__line_number, store__colours[uut__bank]};
    always @* begin
        // The banks.
        assert (!committed || !uut__banks__draining);
        assert (!uut__banks__draining || works);
        assert (!uut__host_commit || (!committed && !part__preparing && !uut__banks__draining));
        assert (!uut__host_write || (!committed && !part__preparing && !uut__banks__draining && !uut__load_0));
        assert (!uut__scan_write || uut__host_write);
        assert (!uut__x_write || uut__host_write);
        assert (!uut__y_write || uut__host_write);
        if (committed) assert (part__preparing && part__is_idle);
        if (uut__load_0) assert (uut__tick_0 && part__is_idle && !part__preparing && !committed && uut__loaded);
        if (part__is_idle && !part__preparing && !uut__load_0) assert (part__anew && !uut__host_write);
        if (committed || part__preparing) assert (lines_known);
        if (lines_known) assert (uut__scan__idle_last_line == idle_last);
        if (part__preparing) assert (idle_lines >= 1 && idle_lines <= 1 << LINE_BITS);
        if (part__preparing) assert (uut__scan__idle_next_to_last >= 6);
        if (part__preparing) assert (uut__scan__idle_next_to_last <= (1 << TICK_BITS) - 2);
        if (uut__loaded) assert (last_line == last_of_lines && lines >= 1 && lines <= 1 << LINE_BITS);
        if (uut__loaded) assert (uut__scan__next_to_last_tick >= 6);
        if (uut__loaded) assert (uut__scan__next_to_last_tick <= (1 << TICK_BITS) - 2);
        if (!uut__loaded) assert (uut__scan__next_to_last_tick == 1 && last_line == 0);
        // The scan.
        if (running) begin
            assert (!(uut__scan__first && uut__scan__last));
            if (uut__scan__first) assert (uut__scan__at_tick == 0);
            if (!uut__scan__first) assert (uut__scan__at_tick != 0 && !uut__scan__starts && uut__loaded);
            if (!uut__scan__first) assert (uut__scan__at_tick <= uut__scan__next_to_last_tick + 1);
            assert (uut__scan__last == (uut__scan__at_tick == uut__scan__next_to_last_tick + 1 && !uut__scan__first));
            if (uut__scan__at_tick > 2) assert (uut__scan__bottom == (uut__scan__at_line == last_line));
            if (uut__scan__starts) assert (uut__scan__first && uut__scan__at_line == 0);
            if (!uut__scan__starts) assert (uut__scan__top == (uut__scan__at_line == 0));
            if (!uut__loaded) assert (uut__scan__starts && committed);
            if (uut__loaded) assert (uut__scan__at_line <= last_line);
        end
        // The line that is due, and the one that was worked out.
        if (running && !(uut__tick_0 && (uut__line_0 || uut__load_0))) assert (part__next_line == due);
        if (running && uut__tick_0 && uut__line_0) assert (part__line_after == due);
        if (uut__tick_0 && uut__line_0) assert (uut__runs_0);
        if (uut__tick_0 && uut__runs_0 && running && !uut__scan__starts && !uut__scan__first)
            assert (uut__line_number == uut__scan__at_line);
        if (running && part__is_idle && part__preparing && uut__at_frame && !part__anew) assert (due == 0);
        // Labels: of the half that plays, from the first tick of a line to its last, and of the other one.
        if (running && !uut__scan__first && !(uut__tick_0 && uut__line_0))
            assert (x_label == at_line && y_label == at_line);
        if (uut__tick_0 && uut__runs_0 && !uut__line_0) assert (x_label == this_line && y_label == this_line);
        if (uut__tick_0 && uut__line_0)
            assert (engine__done && part__line_at == uut__line_number && part__is_idle == uut__load_0);
        if (engine__done) assert (next_x == worked && next_y == worked && !engine__works);
        if (engine__works && engine__reads) assert (store__colour == worked[0] || part__anew);
        if (engine__works && engine__wrote[0]) assert (next_x == worked || part__anew);
        if (engine__works && engine__wrote[1]) assert (next_y == worked || part__anew);
    end
`endif
endmodule

`default_nettype wire
