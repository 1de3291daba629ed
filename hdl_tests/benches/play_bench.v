// Bench of examples/verilog/play.v: prints the codes of so many ticks, one a line, from +ticks=N. With +gap=G the
// player gets a tick only every G + 1 clocks. A second instance plays y with the constants of the same header.
module play_bench;
    `include "annexin_200nm.vh"

    // Clocks from a tick to its code; the code of an axis of lines waits for that of a cubic one.
    localparam CUBIC_X = ANNEXIN_200NM_X_INTERPOLATED == 3, CUBIC_Y = ANNEXIN_200NM_Y_INTERPOLATED == 3;
    localparam LATENCY = CUBIC_X || CUBIC_Y ? 7 : 4;

    reg clock = 0, reset = 1;
    integer ticks, gap, clocks, printed;
    wire tick = !reset && clocks % (gap + 1) == 0;
    reg [LATENCY-1:0] leaving = 0;
    wire [23:0] x_code, y_code;
    reg [3*24-1:0] x_waits, y_waits;
    wire [23:0] x_together = LATENCY == 7 && !CUBIC_X ? x_waits[3*24-1 -: 24] : x_code;
    wire [23:0] y_together = LATENCY == 7 && !CUBIC_Y ? y_waits[3*24-1 -: 24] : y_code;
    always @(posedge clock) begin
        x_waits <= {x_waits[2*24-1:0], x_code};
        y_waits <= {y_waits[2*24-1:0], y_code};
    end

    play x (.clock(clock), .reset(reset), .tick(tick), .code(x_code));

    play_axis #(
        .TABLE_FILE(ANNEXIN_200NM_Y_TABLE_FILE),
        .LENGTH(ANNEXIN_200NM_Y_TABLE_LENGTH),
        .BITS(ANNEXIN_200NM_Y_TABLE_BITS),
        .INTERPOLATED(ANNEXIN_200NM_Y_INTERPOLATED),
        .INDEX_BITS(ANNEXIN_200NM_Y_INDEX_BITS),
        .GUARD_BITS(ANNEXIN_200NM_Y_GUARD_BITS),
        .PERIOD(ANNEXIN_200NM_Y_PHASE_PERIOD),
        .STEP(ANNEXIN_200NM_Y_PHASE_STEP),
        .REMAINDER(ANNEXIN_200NM_Y_PHASE_REMAINDER),
        .HOLD(ANNEXIN_200NM_Y_HOLD_TICKS),
        .GAIN_WORD(ANNEXIN_200NM_Y_GAIN_WORD),
        .GAIN_Q(ANNEXIN_200NM_Y_GAIN_Q),
        .OFFSET_WORD(ANNEXIN_200NM_Y_OFFSET_WORD),
        .CODE_MIN(ANNEXIN_200NM_Y_CODE_MIN),
        .CODE_MAX(ANNEXIN_200NM_Y_CODE_MAX)
    ) y (.clock(clock), .reset(reset), .tick(tick), .code(y_code));

    always #5 clock = !clock;

    initial begin
        if (!$value$plusargs("ticks=%d", ticks)) ticks = 1;
        if (!$value$plusargs("gap=%d", gap)) gap = 0;
        clocks = 0;
        printed = 0;
        repeat (3) @(negedge clock);
        reset = 0;
        while (printed < ticks) begin
            @(negedge clock);
            clocks = clocks + 1;
            if (leaving[LATENCY-1]) begin
                $display("%0d %0d", x_together, y_together);
                printed = printed + 1;
            end
        end
        $finish(0);
    end

    always @(posedge clock) leaving <= {leaving[LATENCY-2:0], tick};
endmodule
