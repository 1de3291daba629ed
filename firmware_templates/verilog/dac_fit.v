// Whether every word of the idle program was written and fits its register: a commit of any other program is refused.
// A line of 429 ticks would otherwise become one of 173 where TICK_BITS = 8.
//
// A flag a word says that it is wrong: from power-up on, until a value that fits is written. To write a right value
// over a wrong one is enough. `fits` includes the write of this clock.

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
    parameter HARMONICS = 0  // 0: there is no renderer, and the number of harmonics is not used
) (
    input  wire        clock,
    input  wire        scan_write,
    input  wire        x_write,
    input  wire        y_write,
    input  wire [3:0]  address,
    input  wire [31:0] data,
    output wire        fits
);
    localparam SCAN_WORDS = 14;

    // A line has 8 ticks or more, a frame has a line or more, and neither has more than its counter counts.
    wire is_tick = data >> (TICK_BITS + 1) == 0;
    wire is_line = data >> (LINE_BITS + 1) == 0;
    wire is_line_ticks = is_tick && (data[TICK_BITS] ? data[TICK_BITS-1:0] == 0 : data[TICK_BITS:3] != 0);
    wire is_frame_lines = is_line && (data[LINE_BITS] != (data[LINE_BITS-1:0] != 0));
    wire is_flag = data[31:1] == 0;
    wire is_short = data[31:8] == 0;
    wire [SCAN_WORDS-1:0] right = {
        is_flag, is_tick, {4{is_line}}, {4{is_tick}}, is_tick, is_short, is_frame_lines, is_line_ticks
    };
    reg [SCAN_WORDS-1:0] wrong;
    wire [SCAN_WORDS-1:0] wrong_now;
    initial wrong = {SCAN_WORDS{1'b1}};
    always @(posedge clock) wrong <= wrong_now;
    genvar i;
    generate
        for (i = 0; i < SCAN_WORDS; i = i + 1) begin : word
            assign wrong_now[i] = scan_write && address == i ? !right[i] : wrong[i];
        end
    endgenerate

    wire x_fits, y_fits;
    dac_fit_axis #(
        .DAC_BITS(DAC_BITS), .INTERPOLATED(X_INTERPOLATED), .INDEX_BITS(X_INDEX_BITS), .WORD_BITS(X_WORD_BITS),
        .PERIOD_BITS(X_PERIOD_BITS), .HARMONICS(HARMONICS)
    ) x (.clock(clock), .write(x_write), .address(address), .data(data), .fits(x_fits));
    dac_fit_axis #(
        .DAC_BITS(DAC_BITS), .INTERPOLATED(Y_INTERPOLATED), .INDEX_BITS(Y_INDEX_BITS), .WORD_BITS(Y_WORD_BITS),
        .PERIOD_BITS(Y_PERIOD_BITS), .HARMONICS(HARMONICS)
    ) y (.clock(clock), .write(y_write), .address(address), .data(data), .fits(y_fits));

    assign fits = wrong_now == 0 && x_fits && y_fits;
endmodule

`default_nettype wire
