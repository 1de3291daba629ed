`default_nettype none

// Bench of dac_fit: an entry a clock from writes.hex, {discard, write, page[1:0], address[3:0], data[31:0]}; prints
// `fits` on the clock of each.
module fit_bench;
    parameter DAC_BITS = 16;
    parameter X_INTERPOLATED = 1;
    parameter X_INDEX_BITS = 11;
    parameter X_WORD_BITS = 16;
    parameter Y_INTERPOLATED = 1;
    parameter Y_INDEX_BITS = 11;
    parameter Y_WORD_BITS = 16;
    parameter TICK_BITS = 24;
    parameter LINE_BITS = 16;
    parameter X_PERIOD_BITS = 25;
    parameter Y_PERIOD_BITS = 31;
    parameter HARMONICS = 0;
    parameter SHAPING = 0;
    parameter DEPTH = 1;

    reg [39:0] writes [0:DEPTH-1];
    reg [39:0] now, next;
    reg clock;
    wire fits;
    integer i;
    dac_fit #(
        .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .TICK_BITS(TICK_BITS),
        .LINE_BITS(LINE_BITS), .X_PERIOD_BITS(X_PERIOD_BITS), .Y_PERIOD_BITS(Y_PERIOD_BITS), .HARMONICS(HARMONICS),
        .SHAPING(SHAPING)
    ) fit (
        .clock(clock), .data(next[31:0]), .address(next[35:32]), .scan_write(now[38] && now[37:36] == 0),
        .x_write(now[38] && now[37:36] == 1), .y_write(now[38] && now[37:36] == 2),
        .discard(now[39]), .fits(fits)
    );
    initial begin
        $readmemh("writes.hex", writes);
        clock = 0;
        now = 0;
        for (i = 0; i <= DEPTH; i = i + 1) begin
            next = i < DEPTH ? writes[i] : 0;
            #1 if (i > 0) $display("%b", fits);
            #1 clock = 1;
            #1 clock = 0;
            now = next;
        end
        $finish;
    end
endmodule

`default_nettype wire
