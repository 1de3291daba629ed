// Both axes with a slow part, and which line of which program is worked out for them.
//
// While a line plays, the next one is worked out. A commit is `prepared` when line 0 of its program is, or with `keeps`
// the line that is due: at once where no scan runs, else in the line after it, and the scan goes on as it is until
// then; with `at_frame` in the last line of a frame. Where no scan runs it is line 0 of the program that plays, for the
// next trigger; a trigger before that waits, armed, until a park or a reset. `late`: the next line is not ready.

`default_nettype none

module dac_slow_part #(
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 3,
    parameter X_INDEX_BITS = 6,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 3,
    parameter Y_INDEX_BITS = 6,
    parameter Y_WORD_BITS = 16,
    parameter SLOW_INDEX_BITS = 7,
    parameter LINE_BITS = 16,
    parameter PERIOD_BITS = 25,
    parameter SHAPING = 0,          // highest order of shaping
    parameter [63:0] X_POWER_UP_CODE = 0,
    parameter [63:0] Y_POWER_UP_CODE = 0
) (
    input  wire                 clock,
    // writes to the idle program
    input  wire                 scan_write,
    input  wire                 x_write,
    input  wire                 y_write,
    input  wire                 word_write,    // to another region than the program words
    input  wire [2:0]           region,
    input  wire [15:0]          address,
    input  wire [31:0]          data,
    // program and scan
    input  wire                 commit,
    input  wire                 keeps,         // the committed program continues the frame
    input  wire                 at_frame,      // it begins with a frame
    input  wire                 discard,
    input  wire                 take,
    input  wire                 bank,
    input  wire                 loaded,
    input  wire                 committed,
    output wire                 prepared,      // one clock: the committed program can be taken
    output reg                  preparing,
    input  wire                 arm,
    input  wire                 armed,
    input  wire                 trigger,
    input  wire                 park,          // or a reset
    input  wire                 running,
    input  wire                 first,         // the next tick of a running scan is the first one of a line
    output wire                 start,         // the trigger that the scan gets
    output wire                 late,
    // the tick
    input  wire                 tick,
    input  wire                 load,
    input  wire                 runs,
    input  wire                 begins,
    input  wire                 line,
    input  wire [LINE_BITS-1:0] line_number,
    output wire                 x_done,
    output wire [DAC_BITS-1:0]  x,
    output wire                 x_reached,
    output wire                 x_clamped,
    output wire                 y_done,
    output wire [DAC_BITS-1:0]  y,
    output wire                 y_reached,
    output wire                 y_clamped
);
    localparam [2:0] X_TABLE = 3'd1, Y_TABLE = 3'd2, X_PARTS = 3'd5, Y_PARTS = 3'd6;
    localparam [3:0] FRAME_LINES = 4'd1;
    localparam INDEX_BITS = X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS;
    localparam WORD_BITS = X_WORD_BITS > Y_WORD_BITS ? X_WORD_BITS : Y_WORD_BITS;

    reg [LINE_BITS:0] lines_0, lines_1;  // of a frame, of the program of each bank
    wire [LINE_BITS:0] playing_lines = bank ? lines_1 : lines_0;
    always @(posedge clock)
        if (scan_write && address[3:0] == FRAME_LINES) begin
            if (bank) lines_0 <= data[LINE_BITS:0];
            else lines_1 <= data[LINE_BITS:0];
        end

    // The line that is needed next, and the one that is worked out, or was: this one, or line 0 in its place.
    reg [LINE_BITS-1:0] next_line;
    reg is_first;  // it is line 0
    reg is_idle;   // it is a line of the idle program
    wire [LINE_BITS-1:0] line_at = is_first ? {LINE_BITS{1'b0}} : next_line;
    wire ended;
    wire [LINE_BITS:0] after = {1'b0, line_number} + 1;
    wire [LINE_BITS-1:0] line_after = line && after != playing_lines ? after[LINE_BITS-1:0] : {LINE_BITS{1'b0}};
    wire changes = tick && (line || load);
    wire needs_idle = preparing && (!running || is_idle);
    wire prepares = preparing && (!at_frame || line_after == {LINE_BITS{1'b0}});  // from the line that begins
    wire from_0 = !keeps && !at_frame;  // the idle program begins with its line 0, whatever line is due
    wire needs_first = !running || (needs_idle && from_0);
    wire other = needs_idle != is_idle || (needs_first != is_first && next_line != {LINE_BITS{1'b0}});
    wire anew = changes || other;
    wire ready = ended && !other;  // and not on the clock of `changes`, on which no tick is accepted
    wire waits_for_line = preparing && is_idle && !committed;
    initial begin
        preparing = 1'b0;
        next_line = 0;
        is_first = 1'b0;
        is_idle = 1'b0;
    end
    always @(posedge clock) begin
        preparing <= (commit || preparing) && !discard && !take;
        if (!running)
            next_line <= {LINE_BITS{1'b0}};
        else if (changes)
            next_line <= line_after;
        if (anew) begin
            is_idle <= changes ? prepares : needs_idle;
            is_first <= changes ? preparing && from_0 : needs_first;
        end
    end
    assign prepared = waits_for_line && ready && !changes;
    // On the clock before a prepared program is committed, a tick would not take it, and play its line as an old one.
    assign late = running && first && (!ready || waits_for_line);

    // A trigger of a scan that runs is the matter of dac_scan. A tick that takes a program at rest leaves its line 0.
    reg waits;
    initial waits = 1'b0;
    wire can_start = running || (ready && !changes && !take);
    wire asks = (trigger && (arm || armed)) || waits;
    always @(posedge clock) waits <= asks && !can_start && !park && (loaded || (committed && !discard));
    assign start = (trigger || waits) && can_start;

    reg half;
    initial half = 1'b0;
    always @(posedge clock) half <= half ^ changes;

    reg [1:0] ticks;  // the axes write the offset of the tick
    initial ticks = 2'd0;
    always @(posedge clock) ticks <= {ticks[0], tick};
    wire enable = ticks == 2'd0;
    wire is_y, write, write_table, write_offset, write_ramp;
    wire [3:0] page_address, write_address;
    wire [SLOW_INDEX_BITS-1:0] slow_index;
    wire [INDEX_BITS-1:0] index;
    wire [6:0] knot;
    wire [31:0] page_word, write_data;
    wire [WORD_BITS-1:0] fast, slow, table_data;
    wire [7:0] second;
    wire [17:0] gain;
    wire [15:0] ratio;
    wire [43:0] offset, ramp, x_offset, y_offset;
    wire unused = &{index, table_data};  // upper bits, unused for the shorter table
    dac_slow_store #(.INDEX_BITS(INDEX_BITS), .WORD_BITS(WORD_BITS), .SLOW_INDEX_BITS(SLOW_INDEX_BITS)) store (
        .clock(clock), .write_page(x_write || y_write),
        .write_fast(word_write && (region == X_TABLE || region == Y_TABLE)),
        .write_part(word_write && (region == X_PARTS || region == Y_PARTS)), .write_bank(!bank),
        .write_axis(y_write || region == Y_TABLE || region == Y_PARTS), .write_address(address), .write_data(data),
        .enable(enable), .bank(bank ^ is_idle), .axis(is_y), .page_address(page_address), .index(index),
        .slow_index(slow_index), .knot(knot), .page_word(page_word), .fast(fast), .second(second), .slow(slow),
        .gain(gain), .ratio(ratio)
    );
    dac_slow_engine #(
        .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS), .Y_INDEX_BITS(Y_INDEX_BITS),
        .Y_WORD_BITS(Y_WORD_BITS), .SLOW_INDEX_BITS(SLOW_INDEX_BITS), .LINE_BITS(LINE_BITS)
    ) engine (
        .clock(clock), .enable(enable), .start(anew), .line(line_at),
        .lines(bank ^ is_idle ? lines_1 : lines_0), .done(ended), .axis(is_y), .page_address(page_address),
        .slow_index(slow_index), .knot(knot), .page_word(page_word), .fast(fast), .second(second), .slow(slow),
        .gain(gain), .ratio(ratio), .write(write), .write_address(write_address), .write_data(write_data),
        .index(index), .write_table(write_table), .table_data(table_data), .write_offset(write_offset),
        .offset(offset), .offset_here(is_y ? y_offset : x_offset), .write_ramp(write_ramp), .ramp(ramp)
    );

    dac_slow_axis #(
        .INTERPOLATED(X_INTERPOLATED), .INDEX_BITS(X_INDEX_BITS), .WORD_BITS(X_WORD_BITS), .DAC_BITS(DAC_BITS),
        .PERIOD_BITS(PERIOD_BITS), .SHAPING(SHAPING), .POWER_UP_CODE(X_POWER_UP_CODE)
    ) x_axis (
        .clock(clock), .write(write && !is_y), .write_address(write_address), .write_data(write_data),
        .table_write(write_table && !is_y), .table_address(index[X_INDEX_BITS-1:0]),
        .table_data(table_data[X_WORD_BITS-1:0]), .write_offset(write_offset && !is_y), .offset(offset),
        .write_ramp(write_ramp && !is_y), .ramp(ramp), .next_offset(x_offset), .half(half), .loaded(loaded),
        .tick(tick), .next(changes), .line(line), .begins(begins), .runs(runs), .done(x_done), .code(x),
        .reached(x_reached), .clamped(x_clamped)
    );
    dac_slow_axis #(
        .INTERPOLATED(Y_INTERPOLATED), .INDEX_BITS(Y_INDEX_BITS), .WORD_BITS(Y_WORD_BITS), .DAC_BITS(DAC_BITS),
        .PERIOD_BITS(PERIOD_BITS), .SHAPING(SHAPING), .POWER_UP_CODE(Y_POWER_UP_CODE)
    ) y_axis (
        .clock(clock), .write(write && is_y), .write_address(write_address), .write_data(write_data),
        .table_write(write_table && is_y), .table_address(index[Y_INDEX_BITS-1:0]),
        .table_data(table_data[Y_WORD_BITS-1:0]), .write_offset(write_offset && is_y), .offset(offset),
        .write_ramp(write_ramp && is_y), .ramp(ramp), .next_offset(y_offset), .half(half), .loaded(loaded),
        .tick(tick), .next(changes), .line(line), .begins(begins), .runs(runs), .done(y_done), .code(y),
        .reached(y_reached), .clamped(y_clamped)
    );

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if ((X_INTERPOLATED != 1 && X_INTERPOLATED != 3) ||
            (Y_INTERPOLATED != 1 && Y_INTERPOLATED != 3)) begin : guard_0
            dac_slow_part_X_or_Y_INTERPOLATED_are_not_1_or_3 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
