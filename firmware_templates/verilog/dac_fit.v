// Whether the idle program fits the registers of the device: a commit of any other program is refused. A line of 429
// ticks would otherwise become one of 173 where TICK_BITS = 8.
//
// A word that does not fit spoils the idle program, until a withdrawal or a reset discards it. Nothing can be committed
// before a line's length was written, at power-up and after a spoilt program was discarded.

`default_nettype none

module dac_fit #(
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter Y_WORD_BITS = 16,
    parameter TICK_BITS = 24,
    parameter LINE_BITS = 16,
    parameter X_PERIOD_BITS = 25,
    parameter Y_PERIOD_BITS = 31,
    parameter HARMONICS = 0,    // 0: there is no renderer, and the number of harmonics is not used
    parameter SHAPING = 0       // highest order of shaping
) (
    input  wire        clock,
    input  wire [31:0] data,        // of the write on the next clock
    input  wire [3:0]  address,
    input  wire        scan_write,  // a write of this clock, to one of the three pages
    input  wire        x_write,
    input  wire        y_write,
    input  wire        discard,
    output wire        fits         // with the write of this clock
);
    localparam [3:0] LINE_TICKS = 4'd0, FRAME_LINES = 4'd1, SETTLE_LINES = 4'd2, TURN_TICK = 4'd3, TICKS_END = 4'd8;
    localparam [3:0] LINES_END = 4'd12, PIXELS = 4'd12, Y_STEPS = 4'd13;
    localparam [3:0] REMAINDER = 4'd1, PERIOD = 4'd2, GAIN = 4'd3, OFFSET_LOW = 4'd4, OFFSET_HIGH = 4'd5;
    localparam [3:0] CODES = 4'd6, CODES_END = 4'd10, AXIS_HARMONICS = 4'd10, SHAPING_WORD = 4'd11;
    localparam [31:0] MOST_HARMONICS = HARMONICS, HIGHEST_ORDER = SHAPING;
    localparam X_HIGH_BITS = X_WORD_BITS > 21 ? 25 : X_WORD_BITS + 4;  // of the offset above its low word, signed
    localparam Y_HIGH_BITS = Y_WORD_BITS > 21 ? 25 : Y_WORD_BITS + 4;

    // What the word would fit. A line has 8 ticks or more, a frame has a line or more, and neither has more than its
    // counter counts; a table without interpolation has a word for every advance, and needs no phase.
    wire within_x_table = data >> (X_INDEX_BITS + 1) == 0 && !(data[X_INDEX_BITS] && data[X_INDEX_BITS-1:0] != 0);
    wire within_y_table = data >> (Y_INDEX_BITS + 1) == 0 && !(data[Y_INDEX_BITS] && data[Y_INDEX_BITS-1:0] != 0);
    wire within_x_period = data >> (X_PERIOD_BITS - 1) <= 32'd1;
    wire within_y_period = data >> (Y_PERIOD_BITS - 1) <= 32'd1;
    wire within_tick = data >> (TICK_BITS + 1) == 0;
    wire within_line = data >> (LINE_BITS + 1) == 0;
    reg is_tick, is_line, is_line_ticks, is_frame_lines, is_flag, is_short, is_code, is_gain, is_low;
    reg is_x_high, is_y_high, is_x_period, is_y_period, is_harmonics, is_shaping;
    always @(posedge clock) begin
        is_tick <= within_tick;
        is_line <= within_line;
        is_line_ticks <= within_tick && (data[TICK_BITS] ? data[TICK_BITS-1:0] == 0 : data[TICK_BITS:3] != 0);
        is_frame_lines <= within_line && (data[LINE_BITS] != (data[LINE_BITS-1:0] != 0));
        is_flag <= data[31:1] == 0;
        is_short <= data[31:8] == 0;
        is_code <= data[31:DAC_BITS] == 0;
        is_gain <= data[31:17] == 15'd0 || data[31:17] == {15{1'b1}};
        is_low <= data[31:18] == 14'd0;
        is_x_high <= data[31:X_HIGH_BITS-1] == 0 || &data[31:X_HIGH_BITS-1];
        is_y_high <= data[31:Y_HIGH_BITS-1] == 0 || &data[31:Y_HIGH_BITS-1];
        is_x_period <= X_INTERPOLATED != 0 ? within_x_period : within_x_table;
        is_y_period <= Y_INTERPOLATED != 0 ? within_y_period : within_y_table;
        is_harmonics <= HARMONICS == 0 || data <= MOST_HARMONICS;
        // Only the scanner's order has a zero, of 128 at most.
        is_shaping <= data[31:16] == 0 && data[7:2] == 0 && (data & 32'd3) <= HIGHEST_ORDER &&
                      (data[1:0] == 2'd3 ? !(data[15] && data[14:8] != 0) : data[15:8] == 0);
    end

    // What it has to fit, by its address; what is not named takes any word. All of this is known on the clock of the
    // write, so that little is left to do on that of a commit.
    reg of_tick, of_line, of_line_ticks, of_frame_lines, of_flag, of_short, of_code, of_gain, of_low, of_high;
    reg of_x_period, of_y_period, of_harmonics, of_shaping;
    always @(posedge clock) begin
        of_line_ticks <= address == LINE_TICKS;
        of_frame_lines <= address == FRAME_LINES;
        of_short <= address == SETTLE_LINES;
        of_tick <= (address >= TURN_TICK && address < TICKS_END) || address == PIXELS;
        of_line <= address >= TICKS_END && address < LINES_END;
        of_flag <= address == Y_STEPS;
        of_x_period <= address == PERIOD || (X_INTERPOLATED != 0 && address == REMAINDER);
        of_y_period <= address == PERIOD || (Y_INTERPOLATED != 0 && address == REMAINDER);
        of_gain <= address == GAIN;
        of_low <= address == OFFSET_LOW;
        of_high <= address == OFFSET_HIGH;
        of_code <= address >= CODES && address < CODES_END;
        of_harmonics <= address == AXIS_HARMONICS;
        of_shaping <= address == SHAPING_WORD;
    end

    wire scan_spoils = (of_line_ticks && !is_line_ticks) || (of_frame_lines && !is_frame_lines) ||
                       (of_short && !is_short) || (of_tick && !is_tick) || (of_line && !is_line) ||
                       (of_flag && !is_flag);
    wire axis_spoils = (of_gain && !is_gain) || (of_low && !is_low) || (of_code && !is_code) ||
                       (of_harmonics && !is_harmonics) || (of_shaping && !is_shaping);
    wire x_spoils = axis_spoils || (of_x_period && !is_x_period) || (of_high && !is_x_high);
    wire y_spoils = axis_spoils || (of_y_period && !is_y_period) || (of_high && !is_y_high);
    wire spoils = (scan_write && scan_spoils) || (x_write && x_spoils) || (y_write && y_spoils);
    wire begins = scan_write && of_line_ticks;

    reg spoilt, empty;
    initial begin
        spoilt = 1'b0;
        empty = 1'b1;
    end
    always @(posedge clock) begin
        if (spoils)
            spoilt <= 1'b1;
        else if (discard)
            spoilt <= 1'b0;
        if (begins)
            empty <= 1'b0;
        else if (discard && spoilt)
            empty <= 1'b1;
    end

    assign fits = !spoilt && !spoils && (!empty || begins);

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (DAC_BITS < 8 || DAC_BITS > 24) begin : guard_0
            dac_fit_DAC_BITS_is_not_8_to_24 stop ();
        end
        if ((X_INTERPOLATED != 0 && X_INTERPOLATED != 1 && X_INTERPOLATED != 3) ||
            (Y_INTERPOLATED != 0 && Y_INTERPOLATED != 1 && Y_INTERPOLATED != 3)) begin : guard_1
            dac_fit_X_or_Y_INTERPOLATED_are_not_0_1_or_3 stop ();
        end
        if (X_INDEX_BITS < 2 || X_INDEX_BITS > 16 || Y_INDEX_BITS < 2 || Y_INDEX_BITS > 16) begin : guard_2
            dac_fit_X_or_Y_INDEX_BITS_are_not_2_to_16 stop ();
        end
        if (X_WORD_BITS < 8 || X_WORD_BITS > 24 || Y_WORD_BITS < 8 || Y_WORD_BITS > 24) begin : guard_3
            dac_fit_X_or_Y_WORD_BITS_are_not_8_to_24 stop ();
        end
        if (TICK_BITS < 3 || TICK_BITS > 30) begin : guard_4
            dac_fit_TICK_BITS_is_not_3_to_30 stop ();
        end
        if (LINE_BITS < 1 || LINE_BITS > 16) begin : guard_5
            dac_fit_LINE_BITS_is_not_1_to_16 stop ();
        end
        if (X_PERIOD_BITS < 1 || X_PERIOD_BITS > 31 || Y_PERIOD_BITS < 1 || Y_PERIOD_BITS > 31) begin : guard_6
            dac_fit_X_or_Y_PERIOD_BITS_are_not_1_to_31 stop ();
        end
        if (HARMONICS < 0 || HARMONICS > 512) begin : guard_7
            dac_fit_HARMONICS_is_not_0_to_512 stop ();
        end
        if (SHAPING < 0 || SHAPING > 3) begin : guard_8
            dac_fit_SHAPING_is_not_0_to_3 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
