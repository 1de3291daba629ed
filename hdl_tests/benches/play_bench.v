// Bench of examples/verilog/play.v: prints the codes of so many ticks, one a line, from +ticks=N. With +gap=G the
// player gets a tick only every G + 1 clocks. A second instance plays y with the constants of the same header.
module play_bench;
    `include "annexin_200nm.vh"

    localparam LATENCY = 4;

    reg clock = 0, reset = 1;
    integer ticks, gap, clocks, printed;
    wire tick = !reset && clocks % (gap + 1) == 0;
    reg [LATENCY-1:0] leaving = 0;
    wire [23:0] x_code, y_code;

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
                $display("%0d %0d", x_code, y_code);
                printed = printed + 1;
            end
        end
        $finish(0);
    end

    always @(posedge clock) leaving <= {leaving[LATENCY-2:0], tick};
endmodule
