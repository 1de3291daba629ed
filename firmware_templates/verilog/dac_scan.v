// The scan: one counter for both axes. It decides what the next tick is, and when a committed program is taken.
//
// Requests are pulses of one clock, and act after a tick of the same clock. If several come together, the later in this
// list takes precedence: arm, trigger, park, reset. All outputs belong to the tick that `tick_out` announces,
// one clock after `tick`. A line has at least 8 ticks.

`default_nettype none

module dac_scan #(
    parameter TICK_BITS = 24,   // a line has at most 2^TICK_BITS ticks
    parameter LINE_BITS = 16,   // a frame has at most 2^LINE_BITS lines
    parameter FRAME_BITS = 16   // bits of the frame counter
) (
    input  wire                  clock,
    input  wire                  reset,
    input  wire                  write,
    input  wire [3:0]            write_address,
    input  wire [31:0]           write_data,
    input  wire                  tick,
    input  wire                  arm,
    input  wire [FRAME_BITS-1:0] arm_frames,  // with arm; 0: endless
    input  wire                  trigger,
    input  wire                  park,
    input  wire                  committed,   // a program waits to be taken
    input  wire                  withdraw,    // it does not after this clock
    input  wire                  keep,        // it continues the frame that plays, if it can
    input  wire                  at_frame,    // it is taken at the start of a frame
    input  wire                  loaded,      // there is a program to play
    output wire                  can_keep,    // the idle program can continue the frame of the one that plays
    output wire                  take,        // the tick of this clock takes the program
    output reg                   armed,
    output reg                   running,     // the next tick will play
    output wire                  due,         // it will begin a line
    // flags of the tick that tick_out announces
    output reg                   tick_out,
    output reg                   load,        // the first one of a new program
    output reg                   runs,        // a scan plays
    output reg                   begins,      // a scan or a program begins with it
    output reg                   line,        // the first tick of a line
    output reg                   frame,       // the first tick of a frame
    output reg                   y_advance,   // the tick advances y
    output reg [TICK_BITS-1:0]   tick_number,
    output reg [LINE_BITS-1:0]   line_number
);
    localparam [3:0] LINE_TICKS = 4'd0, FRAME_LINES = 4'd1, Y_STEPS = 4'd13;

    // The program. Numbers of ticks and lines are kept as what the counters are compared with.
    reg [TICK_BITS-1:0] idle_next_to_last, next_to_last_tick;
    reg [LINE_BITS-1:0] idle_last_line, last_line_number;
    reg idle_y_steps, y_steps;
    initial begin
        idle_next_to_last = 0;
        next_to_last_tick = 1;  // tick 0 of the first program, which is being loaded, is not the last but one
        idle_last_line = 0;
        last_line_number = 0;
        idle_y_steps = 1'b0;
        y_steps = 1'b0;
    end
    wire unused = &write_data;
    always @(posedge clock) begin
        if (write && write_address == LINE_TICKS) idle_next_to_last <= write_data[TICK_BITS-1:0] - 2;
        if (write && write_address == FRAME_LINES) idle_last_line <= write_data[LINE_BITS-1:0] - 1;
        if (write && write_address == Y_STEPS) idle_y_steps <= write_data[0];
        if (take) begin
            next_to_last_tick <= idle_next_to_last;
            last_line_number <= idle_last_line;
            y_steps <= idle_y_steps;
        end
    end
    // The advances of y follow from these.
    assign can_keep = idle_next_to_last == next_to_last_tick && idle_last_line == last_line_number &&
                      idle_y_steps == y_steps;

    // The next tick.
    reg [TICK_BITS-1:0] at_tick;
    initial at_tick = 0;
    reg [LINE_BITS-1:0] at_line;
    initial at_line = 0;
    reg first, last;              // the next tick is the first, the last of its line
    initial begin
        first = 1;
        last = 0;
    end
    reg top;                          // its line is the first of the frame
    initial top = 1;
    reg bottom, last_frame;            // its line, its frame is the last one; known soon after a line begins
    initial begin
        bottom = 0;
        last_frame = 0;
    end
    reg starts;                       // a trigger was taken
    initial starts = 0;
    reg endless;
    initial endless = 0;
    reg [FRAME_BITS-1:0] frames_left, armed_frames;
    initial begin
        frames_left = 0;
        armed_frames = 0;
    end

    assign due = running && first;
    wire waits = running && at_frame && !top && !starts;
    assign take = tick && committed && (!running || first) && !waits;
    wire plays = tick && running;
    wire fresh = starts || (take && !(keep && can_keep));
    wire frame_ends = plays && last && bottom;  // a line that is fresh does not end with its first tick
    // The first program is withdrawn: there is none to play. A tick would have taken it, since a scan that runs before
    // is at its first line.
    wire unloads = withdraw && !loaded && !(tick && committed);
    wire plays_on = running && !(frame_ends && last_frame);
    wire go = trigger && (armed || arm) && (loaded || (committed && (tick || !withdraw))) && !plays_on;

    initial begin
        armed = 1'b0;
        running = 1'b0;
        tick_out = 1'b0;
        load = 1'b0;
        runs = 1'b0;
    end

    always @(posedge clock) begin
        tick_out <= tick;
        load <= take;
        runs <= plays;
        begins <= plays && (starts || take);
        line <= plays && first;
        frame <= plays && first && (fresh || top);
        tick_number <= at_tick;
        line_number <= fresh ? {LINE_BITS{1'b0}} : at_line;

        if (plays) begin
            starts <= 1'b0;
            first <= last;
            last <= at_tick == next_to_last_tick;
            at_tick <= last ? {TICK_BITS{1'b0}} : at_tick + 1;
            if (fresh) begin
                at_line <= 0;
                top <= 1'b1;
            end else if (last) begin
                at_line <= bottom ? {LINE_BITS{1'b0}} : at_line + 1;
                top <= bottom;
            end
            if (frame_ends) frames_left <= frames_left - 1;
        end
        bottom <= at_line == last_line_number;
        last_frame <= frames_left == 1 && !endless;

        // Requests.
        if (arm) begin
            armed <= 1'b1;
            armed_frames <= arm_frames;
        end
        if (go) begin
            armed <= 1'b0;
            frames_left <= arm ? arm_frames : armed_frames;
            endless <= arm ? arm_frames == 0 : armed_frames == 0;
            at_tick <= 0;
            at_line <= 0;
            first <= 1'b1;
            last <= 1'b0;
            starts <= 1'b1;
        end
        if (park || reset) armed <= 1'b0;
        running <= ((plays_on && !unloads) || go) && !park && !reset;
    end

    always @(posedge clock)
        // Where y steps it goes on with a new line; otherwise with every tick.
        y_advance <= plays && (first || !y_steps);

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (TICK_BITS < 3 || TICK_BITS > 30) begin : guard_0
            dac_scan_TICK_BITS_is_not_3_to_30 stop ();
        end
        if (LINE_BITS < 1 || LINE_BITS > 16) begin : guard_1
            dac_scan_LINE_BITS_is_not_1_to_16 stop ();
        end
        if (FRAME_BITS < 1) begin : guard_2
            dac_scan_FRAME_BITS_is_less_than_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
