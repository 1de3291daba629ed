// The markers of a tick, three clocks after it: line, frame, pixel, direction, imaging.
//
// The outputs hold from tick to tick. Windows of x count ticks of a line, windows of y count lines of a frame. With
// PIXEL_INDEX_BITS the pixel comes two clocks later, and a commit passes through here: dac_pixel_table.v says how long.

`default_nettype none

module dac_markers #(
    parameter TICK_BITS = 24,
    parameter LINE_BITS = 16,
    parameter COMMIT_MODES = 0,     // 1: a new program may begin with any line
    parameter PIXEL_INDEX_BITS = 0  // of a table of pixels; 0: there is none
) (
    input  wire                 clock,
    input  wire                 write,
    input  wire [3:0]           write_address,
    input  wire [31:0]          write_data,
    input  wire                 take,    // the tick of the next clock is the first one of a new program
    input  wire                 load,    // the tick of this clock is the first one of a new program
    input  wire                 tick,
    input  wire                 runs,
    input  wire                 begins,
    input  wire                 line,
    input  wire                 frame,
    input  wire [TICK_BITS-1:0] tick_number,
    input  wire [LINE_BITS-1:0] line_number,
    output reg                  line_marker,
    output reg                  frame_marker,
    output wire                 pixel_marker,
    output reg                  backward_marker,
    output reg                  images,          // the tick is inside both windows, after the settling lines
    output reg                  pixels_fit,      // used windows have ticks for those written three clocks ago or more
    // with PIXEL_INDEX_BITS
    input  wire                 table_write,
    input  wire [15:0]          table_address,
    input  wire                 discard,
    input  wire                 commit,
    input  wire                 bank,
    output wire                 accepted,
    output wire                 checking,
    output wire                 refused
);
    localparam [3:0] SETTLE_LINES = 4'd2, TURN_TICK = 4'd3, FORWARD_FIRST = 4'd4, FORWARD_COUNT = 4'd5;
    localparam [3:0] BACKWARD_FIRST = 4'd6, BACKWARD_COUNT = 4'd7, UP_FIRST = 4'd8, UP_COUNT = 4'd9;
    localparam [3:0] DOWN_FIRST = 4'd10, DOWN_COUNT = 4'd11, PIXELS = 4'd12, PIXEL_TABLE = 4'd14;

    // Clock 1: equalities. Clock 2: states. Clock 3: pixels and outputs.
    reg tick_1, tick_2, load_1;
    initial begin
        tick_1 = 0;
        tick_2 = 0;
        load_1 = 0;
    end
    reg runs_1, begins_1, line_1, frame_1, turn_1;
    initial begin
        runs_1 = 0;
        begins_1 = 0;
        line_1 = 0;
        frame_1 = 0;
        turn_1 = 0;
    end
    reg line_2, frame_2, runs_2, backward_2, settled_2;
    initial begin
        line_2 = 0;
        frame_2 = 0;
        runs_2 = 0;
        backward_2 = 0;
        settled_2 = 0;
    end
    always @(posedge clock) begin
        tick_1 <= tick;
        tick_2 <= tick_1;
        load_1 <= load;
    end

    wire forward_opens, forward_imaging, backward_opens, backward_imaging, up_imaging, down_imaging;
    wire unused_up, unused_down;
    wire [LINE_BITS:0] unused_up_count, unused_down_count;
    dac_window #(.BITS(TICK_BITS)) forward (
        .clock(clock), .write_first(write && write_address == FORWARD_FIRST),
        .write_count(write && write_address == FORWARD_COUNT), .data(write_data[TICK_BITS:0]), .load(take),
        .valid(tick), .restart(line), .position(tick_number), .opens(forward_opens), .imaging(forward_imaging),
        .idle_count(forward_count)
    );
    dac_window #(.BITS(TICK_BITS)) backward (
        .clock(clock), .write_first(write && write_address == BACKWARD_FIRST),
        .write_count(write && write_address == BACKWARD_COUNT), .data(write_data[TICK_BITS:0]), .load(take),
        .valid(tick), .restart(line), .position(tick_number), .opens(backward_opens), .imaging(backward_imaging),
        .idle_count(backward_count)
    );
    dac_window #(.BITS(LINE_BITS), .JUMPS(COMMIT_MODES)) up (
        .clock(clock), .write_first(write && write_address == UP_FIRST),
        .write_count(write && write_address == UP_COUNT), .data(write_data[LINE_BITS:0]), .load(take),
        .valid(tick && line), .restart(frame), .position(line_number), .opens(unused_up), .imaging(up_imaging),
        .idle_count(unused_up_count)
    );
    dac_window #(.BITS(LINE_BITS), .JUMPS(COMMIT_MODES)) down (
        .clock(clock), .write_first(write && write_address == DOWN_FIRST),
        .write_count(write && write_address == DOWN_COUNT), .data(write_data[LINE_BITS:0]), .load(take),
        .valid(tick && line), .restart(frame), .position(line_number), .opens(unused_down), .imaging(down_imaging),
        .idle_count(unused_down_count)
    );

    wire [TICK_BITS:0] turn_tick;
    wire [7:0] settle_lines;
    dac_register #(.BITS(TICK_BITS + 1)) turn_tick_word (
        .clock(clock), .write(write && write_address == TURN_TICK), .data(write_data[TICK_BITS:0]), .load(take),
        .value(turn_tick)
    );
    dac_register #(.BITS(8)) settle_lines_word (
        .clock(clock), .write(write && write_address == SETTLE_LINES), .data(write_data[7:0]), .load(load),
        .value(settle_lines)
    );
    // Window lengths of the idle program, and pixels less ticks of a window less 1: negative where each pixel has a
    // tick. With more pixels than ticks dac_pixels would count beyond its bits.
    wire [TICK_BITS:0] forward_count, backward_count;
    reg [TICK_BITS:0] idle_pixels, pixels;
    wire [TICK_BITS+1:0] idle_forward_less = {1'b0, idle_pixels} + {1'b1, ~forward_count};
    wire [TICK_BITS+1:0] idle_backward_less = {1'b0, idle_pixels} + {1'b1, ~backward_count};
    reg forward_has_ticks, backward_has_ticks;
    reg signed [TICK_BITS+1:0] pixels_less_1, forward_less, backward_less;
    initial begin
        idle_pixels = 0;
        pixels = 0;
        forward_has_ticks = 0;
        backward_has_ticks = 0;
        pixels_less_1 = 0;
        forward_less = 0;
        backward_less = 0;
        pixels_fit = 1'b0;
    end
    always @(posedge clock) begin
        if (write && write_address == PIXELS) idle_pixels <= write_data[TICK_BITS:0];
        if (write && write_address == FORWARD_COUNT) forward_has_ticks <= write_data[TICK_BITS:0] != 0;
        if (write && write_address == BACKWARD_COUNT) backward_has_ticks <= write_data[TICK_BITS:0] != 0;
        pixels_fit <= (idle_forward_less[TICK_BITS+1] || !forward_has_ticks) &&
                      (idle_backward_less[TICK_BITS+1] || !backward_has_ticks);
        if (load_1) begin
            pixels <= idle_pixels;
            pixels_less_1 <= $signed({1'b0, idle_pixels}) - 1;
            forward_less <= idle_forward_less;
            backward_less <= idle_backward_less;
        end
    end
    wire images_pixels = runs_2 && (forward_imaging || backward_imaging);
    wire counted;
    dac_pixels #(.BITS(TICK_BITS)) pixel_starts (
        .clock(clock), .tick(tick_2), .opens(forward_opens || backward_opens), .imaging(images_pixels),
        .pixels_less_1(pixels_less_1), .pixels_less_count_less_1(forward_imaging ? forward_less : backward_less),
        .pixel(counted)
    );
    generate
        if (PIXEL_INDEX_BITS != 0) begin : pixel_table
            dac_pixel_table #(.TICK_BITS(TICK_BITS), .INDEX_BITS(PIXEL_INDEX_BITS)) ticks (
                .clock(clock), .write_word(write && write_address == PIXEL_TABLE), .write_table(table_write),
                .table_address(table_address[PIXEL_INDEX_BITS-1:0]), .write_data(write_data),
                .idle_pixels(idle_pixels), .forward_count(forward_count), .backward_count(backward_count),
                .discard(discard), .commit(commit), .accepted(accepted), .checking(checking), .refused(refused),
                .bank(bank), .take(take), .load(load_1), .tick(tick_2), .forward_opens(forward_opens),
                .backward_opens(backward_opens), .imaging(images_pixels), .pixels(pixels), .counted(counted),
                .pixel(pixel_marker)
            );
            wire unused_address = &table_address;
        end else begin : equal_pixels
            assign pixel_marker = counted;
            assign {accepted, checking, refused} = {commit, 2'b00};
            wire unused_table = &{PIXEL_TABLE, table_write, table_address, discard, bank, pixels};
        end
    endgenerate

    reg [7:0] settle_left;  // settling lines left, including this one
    initial settle_left = 0;

    initial begin
        line_marker = 1'b0;
        frame_marker = 1'b0;
        backward_marker = 1'b0;
        images = 1'b0;
    end

    always @(posedge clock) begin
        if (tick) begin
            runs_1 <= runs;
            begins_1 <= begins;
            line_1 <= line;
            frame_1 <= frame;
            turn_1 <= {1'b0, tick_number} == turn_tick;
        end
        if (tick_1) begin
            runs_2 <= runs_1;
            line_2 <= line_1;
            frame_2 <= frame_1;
            backward_2 <= turn_1 || (backward_2 && !line_1);
            if (begins_1) begin
                settle_left <= settle_lines;
                settled_2 <= settle_lines == 0;
            end else if (line_1) begin
                settle_left <= settle_left == 0 ? 8'd0 : settle_left - 1;
                settled_2 <= settle_left <= 1;
            end
        end
        if (tick_2) begin
            line_marker <= line_2;
            frame_marker <= frame_2;
            backward_marker <= runs_2 && backward_2;
            images <= runs_2 && settled_2 && (forward_imaging || backward_imaging) && (up_imaging || down_imaging);
        end
    end
    wire unused = &{unused_up, unused_down, unused_up_count, unused_down_count, write_data};

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (TICK_BITS < 3 || TICK_BITS > 30) begin : guard_0
            dac_markers_TICK_BITS_is_not_3_to_30 stop ();
        end
        if (LINE_BITS < 1 || LINE_BITS > 16) begin : guard_1
            dac_markers_LINE_BITS_is_not_1_to_16 stop ();
        end
        if (PIXEL_INDEX_BITS != 0 && (PIXEL_INDEX_BITS < 2 || PIXEL_INDEX_BITS > 16)) begin : guard_2
            dac_markers_PIXEL_INDEX_BITS_is_not_0_or_2_to_16 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
