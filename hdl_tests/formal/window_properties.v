// Imaging windows: a tick images exactly where its tick number is inside a window of the line, its line number inside a
// window of the frame, and no line settles: not a tick longer, not a tick shorter.
//
// dac_markers, fed with ticks as dac_scan gives them (request_properties proves these): tick numbers count up from the
// first tick of a line, line numbers from the first line of a frame. Lines and frames may end anywhere. Of a program is
// asked that a window does not end after the longest line or frame.

`default_nettype none

module window_properties #(
    parameter TICK_BITS = 4,
    parameter LINE_BITS = 2
) (
    input wire        clock,
    input wire        write,
    input wire [3:0]  write_address,
    input wire [31:0] write_data,
    input wire        take,
    input wire        tick,
    input wire        runs_in,
    input wire        begins_in,
    input wire        line_in,
    input wire        frame_in
);
    // As dac_scan gives them: a new program, or a scan, begins with a line and a frame.
    reg load, ran;
    reg [TICK_BITS-1:0] tick_before;
    reg [LINE_BITS-1:0] line_before;
    initial begin
        load = 0;
        ran = 0;
        tick_before = 0;
        line_before = 0;
    end
    wire runs = runs_in;
    wire begins = runs && (begins_in || load || !ran);
    wire line = runs && (line_in || begins);
    wire frame = line && (frame_in || begins);
    wire [TICK_BITS-1:0] tick_number = line ? 0 : tick_before + 1;
    wire [LINE_BITS-1:0] line_number = frame ? 0 : line ? line_before + 1 : line_before;
    always @* begin
        if (load) assume (tick);
        if (tick && runs && !line) assume (tick_before != {TICK_BITS{1'b1}});
        if (tick && line && !frame) assume (line_before != {LINE_BITS{1'b1}});
    end
    always @(posedge clock) begin
        load <= take;
        if (tick) begin
            ran <= runs;
            if (runs) tick_before <= tick_number;
            if (runs) line_before <= line_number;
        end
    end

    wire line_marker, frame_marker, pixel_marker, backward_marker, images;
    dac_markers #(.TICK_BITS(TICK_BITS), .LINE_BITS(LINE_BITS)) markers (
        .clock(clock), .write(write), .write_address(write_address), .write_data(write_data), .take(take), .load(load),
        .tick(tick), .runs(runs), .begins(begins), .line(line), .frame(frame), .tick_number(tick_number),
        .line_number(line_number), .line_marker(line_marker), .frame_marker(frame_marker),
        .pixel_marker(pixel_marker), .backward_marker(backward_marker), .images(images)
    );

    // Lines still to settle, the one of this tick included. A new program brings its number with its first tick.
    reg [7:0] written_settle, settle, left;
    initial begin
        written_settle = 0;
        settle = 0;
        left = 0;
    end
    wire [7:0] of_program = load ? written_settle : settle;
    wire [7:0] left_now = begins ? of_program : line && left != 0 ? left - 1 : left;
    always @(posedge clock) begin
        if (write && write_address == 4'd2) written_settle <= write_data[7:0];
        if (load) settle <= written_settle;
        if (tick) left <= left_now;
    end

    // The definition. A tick goes through three clocks of dac_markers: r1, r2, and what is put out.
    wire forward_now, backward_now, up_now, down_now;
    wire forward_1, backward_1, up_1, down_1, forward_2, backward_2, up_2, down_2;
    wire markers__forward__imaging, markers__backward__imaging, markers__up__imaging, markers__down__imaging;
    wire [TICK_BITS:0] markers__forward__first, markers__forward__stop, markers__forward__idle_first;
    wire [TICK_BITS:0] markers__backward__first, markers__backward__stop, markers__backward__idle_first;
    wire [LINE_BITS:0] markers__up__first, markers__up__stop, markers__up__idle_first;
    wire [LINE_BITS:0] markers__down__first, markers__down__stop, markers__down__idle_first;
    wire [TICK_BITS:0] markers__forward__idle_count, markers__backward__idle_count;
    wire [LINE_BITS:0] markers__up__idle_count, markers__down__idle_count;
    wire markers__forward__is_first, markers__forward__is_stop, markers__forward__is_zero, markers__forward__is_valid;
    wire markers__backward__is_first, markers__backward__is_stop, markers__backward__is_zero;
    wire markers__backward__is_valid;
    wire markers__up__is_first, markers__up__is_stop, markers__up__is_zero, markers__up__is_valid;
    wire markers__down__is_first, markers__down__is_stop, markers__down__is_zero, markers__down__is_valid;
    window_reference #(.BITS(TICK_BITS), .ADDRESS(4)) forward (
        .clock(clock), .write(write), .write_address(write_address), .data(write_data[TICK_BITS:0]), .take(take),
        .load(load), .valid(tick), .stops(tick && !runs), .restart(line), .position(tick_number),
        .idle_first(markers__forward__idle_first), .idle_count(markers__forward__idle_count),
        .first(markers__forward__first), .stop(markers__forward__stop), .imaging(markers__forward__imaging),
        .is_first(markers__forward__is_first), .is_stop(markers__forward__is_stop),
        .is_zero(markers__forward__is_zero), .is_valid(markers__forward__is_valid), .inside_2(forward_2)
    );
    window_reference #(.BITS(TICK_BITS), .ADDRESS(6)) backward (
        .clock(clock), .write(write), .write_address(write_address), .data(write_data[TICK_BITS:0]), .take(take),
        .load(load), .valid(tick), .stops(tick && !runs), .restart(line), .position(tick_number),
        .idle_first(markers__backward__idle_first), .idle_count(markers__backward__idle_count),
        .first(markers__backward__first), .stop(markers__backward__stop), .imaging(markers__backward__imaging),
        .is_first(markers__backward__is_first), .is_stop(markers__backward__is_stop),
        .is_zero(markers__backward__is_zero), .is_valid(markers__backward__is_valid), .inside_2(backward_2)
    );
    window_reference #(.BITS(LINE_BITS), .ADDRESS(8)) up (
        .clock(clock), .write(write), .write_address(write_address), .data(write_data[LINE_BITS:0]), .take(take),
        .load(load), .valid(tick && line), .stops(tick && !runs), .restart(frame), .position(line_number),
        .idle_first(markers__up__idle_first), .idle_count(markers__up__idle_count),
        .first(markers__up__first), .stop(markers__up__stop), .imaging(markers__up__imaging),
        .is_first(markers__up__is_first), .is_stop(markers__up__is_stop),
        .is_zero(markers__up__is_zero), .is_valid(markers__up__is_valid), .inside_2(up_2)
    );
    window_reference #(.BITS(LINE_BITS), .ADDRESS(10)) down (
        .clock(clock), .write(write), .write_address(write_address), .data(write_data[LINE_BITS:0]), .take(take),
        .load(load), .valid(tick && line), .stops(tick && !runs), .restart(frame), .position(line_number),
        .idle_first(markers__down__idle_first), .idle_count(markers__down__idle_count),
        .first(markers__down__first), .stop(markers__down__stop), .imaging(markers__down__imaging),
        .is_first(markers__down__is_first), .is_stop(markers__down__is_stop),
        .is_zero(markers__down__is_zero), .is_valid(markers__down__is_valid), .inside_2(down_2)
    );

    reg tick_1, tick_2, runs_1, runs_2, settles_1, settles_2, images_expected;
    initial begin
        tick_1 = 0;
        tick_2 = 0;
        runs_1 = 0;
        runs_2 = 0;
        settles_1 = 0;
        settles_2 = 0;
        images_expected = 0;
    end
    always @(posedge clock) begin
        tick_1 <= tick;
        tick_2 <= tick_1;
        if (tick) begin
            runs_1 <= runs;
            settles_1 <= left_now != 0;
        end
        if (tick_1) begin
            runs_2 <= runs_1;
            settles_2 <= settles_1;
        end
        if (tick_2) images_expected <= runs_2 && !settles_2 && (forward_2 || backward_2) && (up_2 || down_2);
    end
    always @* assert (images == images_expected);

`ifndef PROPERTIES_ALONE
    // What makes it inductive.
    wire markers__tick_1, markers__tick_2, markers__begins_1, markers__line_1, markers__runs_1, markers__runs_2;
    wire markers__settled_2;
    wire forward__runs_1, backward__runs_1, up__runs_1, down__runs_1;
    wire forward__runs_2, backward__runs_2, up__runs_2, down__runs_2;
    wire [TICK_BITS-1:0] forward__position_1, backward__position_1;
    wire [LINE_BITS-1:0] up__position_1, down__position_1;
    wire [7:0] markers__settle_left, markers__settle_lines, markers__settle_lines_word__idle;
    wire [7:0] left_then = !markers__tick_1 ? markers__settle_left
        : markers__begins_1 ? markers__settle_lines
        : markers__line_1 && markers__settle_left != 0 ? markers__settle_left - 1 : markers__settle_left;
    always @* begin
        assert (markers__tick_1 == tick_1 && markers__tick_2 == tick_2);
        assert (markers__runs_1 == runs_1 && markers__runs_2 == runs_2);
        assert (ran == runs_1 && forward__runs_1 == ran && backward__runs_1 == ran);
        assert (up__runs_1 == ran && down__runs_1 == ran);
        if (ran) assert (forward__position_1 == tick_before && backward__position_1 == tick_before);
        if (ran) assert (up__position_1 == line_before && down__position_1 == line_before);
        if (runs_2) assert (forward__runs_2 && backward__runs_2 && up__runs_2 && down__runs_2);
        assert (markers__settle_lines == settle && markers__settle_lines_word__idle == written_settle);
        assert (left_then == left);
        if (tick_1 && runs_1) assert (settles_1 == (left_then != 0));
        if (runs_2) assert (markers__settled_2 == !settles_2);
        if (!tick_1) assert (runs_1 == runs_2 && settles_1 == settles_2);
        if (tick_1 && runs_1 && !runs_2) assert (markers__begins_1);
        if (runs_2) assert (settles_2 == (markers__settle_left != 0));
    end
`endif
endmodule

// One window by its definition, first <= position < first + count, beside the registers of a dac_window.
module window_reference #(
    parameter BITS = 4,
    parameter ADDRESS = 4  // of `first`; the length is the word after it
) (
    input  wire            clock,
    input  wire            write,
    input  wire [3:0]      write_address,
    input  wire [BITS:0]   data,
    input  wire            take,
    input  wire            load,
    input  wire            valid,
    input  wire            stops,       // a tick while no scan plays
    input  wire            restart,
    input  wire [BITS-1:0] position,
    input  wire [BITS:0]   idle_first,  // registers of the window
    input  wire [BITS:0]   idle_count,
    input  wire [BITS:0]   first,
    input  wire [BITS:0]   stop,
    input  wire            imaging,
    input  wire            is_first,
    input  wire            is_stop,
    input  wire            is_zero,
    input  wire            is_valid,
    output wire            inside_2     // of the position two clocks ago, held
);
    // The window as written, and as it plays.
    reg [BITS:0] written_first, written_count, plays_first, plays_count;
    initial begin
        written_first = 0;
        written_count = 0;
        plays_first = 0;
        plays_count = 0;
    end
    always @(posedge clock) begin
        if (write && write_address == ADDRESS) written_first <= data;
        if (write && write_address == ADDRESS + 1) written_count <= data;
        if (take) begin
            plays_first <= written_first;
            plays_count <= written_count;
        end
    end
    always @* if (take) assume ({1'b0, written_first} + {1'b0, written_count} <= (1 << BITS));

    // Positions on their way, each with the window of its program.
    reg valid_1, runs_1, runs_2, restart_1;
    reg [BITS-1:0] position_1, position_2;
    reg [BITS:0] first_1, first_2, count_1, count_2;
    initial begin
        valid_1 = 0;
        runs_1 = 0;
        runs_2 = 0;
        restart_1 = 0;
        position_1 = 0;
        position_2 = 0;
        first_1 = 0;
        first_2 = 0;
        count_1 = 0;
        count_2 = 0;
    end
    always @(posedge clock) begin
        valid_1 <= valid;
        runs_1 <= (valid || runs_1) && !stops;
        if (valid) begin
            restart_1 <= restart;
            position_1 <= position;
            first_1 <= plays_first;
            count_1 <= plays_count;
        end
        if (valid_1) begin
            runs_2 <= runs_1;
            position_2 <= position_1;
            first_2 <= first_1;
            count_2 <= count_1;
        end
    end
    assign inside_2 = position_2 >= first_2 && {1'b0, position_2} < first_2 + count_2;

`ifndef PROPERTIES_ALONE
    // What makes it inductive.
    always @* begin
        assert (idle_first == written_first && idle_count == written_count);
        assert (first == plays_first && stop == plays_first + plays_count);
        assert ({1'b0, plays_first} + {1'b0, plays_count} <= (1 << BITS));
        assert ({1'b0, first_1} + {1'b0, count_1} <= (1 << BITS));
        assert (is_valid == valid_1);
        if (valid_1) begin
            assert (is_first == ({1'b0, position_1} == first_1));
            assert (is_stop == ({1'b0, position_1} == first_1 + count_1));
            assert (is_zero == restart_1);
            if (restart_1) assert (position_1 == 0);
        end
        // A position that is no restart follows the one before it, in the same program.
        if (valid_1 && runs_1 && !restart_1)
            assert (runs_2 && position_1 == position_2 + 1 && first_1 == first_2 && count_1 == count_2);
        if (!load && runs_1) assert (first_1 == plays_first && count_1 == plays_count);
        if (!valid_1 && runs_1)
            assert (runs_2 && position_1 == position_2 && first_1 == first_2 && count_1 == count_2);
        if (runs_2) assert (imaging == inside_2);
    end
`endif
endmodule

`default_nettype wire
