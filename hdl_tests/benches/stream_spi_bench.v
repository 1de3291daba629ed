// The stream bench with the wires of a converter behind it: every code through dac_coding and dac_spi, as it would be
// sent.
//
// LEVELS gets a hexadecimal digit a clock, the levels {ldac_n, cs_n, mosi_y, mosi_x, sclk} of two chips in parallel
// in the order of two digits: {3'd0, ldac_n}, {cs_n, mosi_y, mosi_x, sclk}.

`timescale 1ns / 1ps
`default_nettype none

module stream_spi_bench #(
    parameter SCRIPT = "",
    parameter CAPTURE = "",
    parameter LEVELS = "",
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter Y_WORD_BITS = 16,
    parameter WORD_BITS = 16,
    parameter TWOS_COMPLEMENT = 0,
    parameter LEFT_ALIGNED = 0,
    parameter FRAME_BITS = 16,
    parameter PREFIX = 0
);
    stream_bench #(
        .SCRIPT(SCRIPT), .CAPTURE(CAPTURE), .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED),
        .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS), .Y_INTERPOLATED(Y_INTERPOLATED),
        .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS)
    ) bench ();

    // For the cocotb side of the bench.
    wire finished = bench.finished;
    wire [127:0] fault_counts = bench.fault_counts;
    wire [31:0] strobes = bench.strobes, ticks = bench.ticks, jitter = bench.jitter, latency = bench.latency;
    wire refused = bench.refused;

    wire [WORD_BITS-1:0] x_word, y_word;
    wire sclk, cs_n, unused_cs, mosi_x, mosi_y, ldac_n, busy, missed;
    dac_coding #(
        .BITS(DAC_BITS), .WORD_BITS(WORD_BITS), .TWOS_COMPLEMENT(TWOS_COMPLEMENT), .LEFT_ALIGNED(LEFT_ALIGNED)
    ) x_coding (.code(bench.x_code), .word(x_word));
    dac_coding #(
        .BITS(DAC_BITS), .WORD_BITS(WORD_BITS), .TWOS_COMPLEMENT(TWOS_COMPLEMENT), .LEFT_ALIGNED(LEFT_ALIGNED)
    ) y_coding (.code(bench.y_code), .word(y_word));
    dac_spi #(.WORD_BITS(WORD_BITS), .FRAME_BITS(FRAME_BITS), .X_PREFIX(PREFIX), .Y_PREFIX(PREFIX)) spi (
        .clock(bench.clock), .reset(1'b0), .strobe(bench.strobe), .x_word(x_word), .y_word(y_word), .sclk(sclk),
        .cs_x_n(cs_n), .cs_y_n(unused_cs), .mosi_x(mosi_x), .mosi_y(mosi_y), .ldac_n(ldac_n), .busy(busy),
        .missed(missed)
    );

    integer levels;
    initial levels = $fopen(LEVELS, "w");
    always @(negedge bench.clock) begin
        $fwrite(levels, "%h", {3'd0, ldac_n, cs_n, mosi_y, mosi_x, sclk});
        if (missed) $display("ERROR: a sample was not sent");
    end
    always @(posedge finished) $fclose(levels);
endmodule

`default_nettype wire
