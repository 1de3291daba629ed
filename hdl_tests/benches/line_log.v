// The log of the lines that a sequencer plays: LINES gets six hexadecimal numbers for each, as
// tests/helpers/line_log.py has them.

`timescale 1ns / 1ps
`default_nettype none

module line_log #(
    parameter DAC_BITS = 16,
    parameter LINES = ""
) (
    input  wire                clock,
    input  wire                strobe,
    input  wire [DAC_BITS-1:0] x_code,
    input  wire [DAC_BITS-1:0] y_code,
    input  wire [7:0]          markers,  // parked, playing, swapped, valid, backward, pixel, frame, line
    input  wire [3:0]          faults
);
    integer log, i;
    reg [31:0] generation = 0, log_generation = 0, line = 0, ticks = 0, crc = 0;
    reg [7:0] all = 0;
    reg [3:0] last_faults = 0;
    wire playing = markers[6], swapped = markers[5], frame_marker = markers[1], line_marker = markers[0];
    wire [31:0] x_wide = x_code, y_wide = y_code;
    reg [71:0] record;

    task end_line;
        begin
            if (ticks != 0) begin
                $fwrite(log, "%h %h %h %h %h %h\n", log_generation, line, ticks, ~crc, all, {4'd0, last_faults});
                $fflush(log);
            end
            ticks = 0;
            crc = 32'hffffffff;
            all = 0;
        end
    endtask

    initial log = $fopen(LINES, "w");
    always @(posedge clock)
        if (strobe) begin
            if (line_marker || !playing) end_line;
            if (swapped) generation = generation + 1;
            if (line_marker) line = frame_marker ? 0 : line + 1;
            log_generation = generation;
            if (playing) begin
                record = {markers, y_wide, x_wide};
                crc = crc ^ record[31:0];
                for (i = 0; i < 72; i = i + 1) begin
                    if (i == 32) crc = crc ^ record[63:32];
                    if (i == 64) crc = crc ^ record[71:64];
                    crc = crc[0] ? (crc >> 1) ^ 32'hedb88320 : crc >> 1;
                end
                all = all | markers;
                ticks = ticks + 1;
                last_faults = faults;
            end
        end
endmodule

`default_nettype wire
