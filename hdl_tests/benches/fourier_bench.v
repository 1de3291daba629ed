// Bench of dac_fourier: renders one job after another from +jobs=FILE, and writes what comes out to +results=FILE.
//
// The jobs are 32-bit words for $readmemh: how many jobs; then for each one flags, axis, H, the clock of the event, how
// many coefficient words there are, and the words. Flags: 1 makes the event a second start, of the other axis, which is
// to be ignored; 2 makes it a reset; 4 makes it a write of a coefficient, which is to be ignored as well. 8 has the job
// started once more on the first clock that is not busy. The event comes so many clocks after busy has risen. Without
// words (0) a job renders what was written before.
//
// Results, one a line: "w busy axis address data" for a table word, "e clocks" at the end of a job: those that busy was
// high. After a job the bench waits for some clocks, in which nothing may come.

`timescale 1ns / 1ps
`default_nettype none

module fourier_bench;
    parameter X_INDEX_BITS = 3;
    parameter Y_INDEX_BITS = 3;
    parameter X_WORD_BITS = 16;
    parameter Y_WORD_BITS = 16;
    parameter HARMONICS = 7;
    parameter SINE_FILE = "sine.mem";
    parameter MULTIPLIER = 0;
    parameter JOB_WORDS = 65536;
    localparam PAUSE = 40;

    reg clock = 1'b0, reset = 1'b1, write = 1'b0, write_axis = 1'b0, start = 1'b0, axis = 1'b0;
    reg [10:0] write_address = 11'd0;
    reg [31:0] write_data = 32'd0;
    reg [9:0] harmonics = 10'd0;
    wire busy, table_write, table_axis;
    wire [15:0] table_address;
    wire [23:0] table_data;

    dac_fourier #(
        .X_INDEX_BITS(X_INDEX_BITS), .Y_INDEX_BITS(Y_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_WORD_BITS(Y_WORD_BITS), .HARMONICS(HARMONICS), .SINE_FILE(SINE_FILE), .MULTIPLIER(MULTIPLIER)
    ) renderer (
        .clock(clock), .reset(reset), .write(write), .write_axis(write_axis), .write_address(write_address),
        .write_data(write_data), .start(start), .axis(axis), .harmonics(harmonics), .busy(busy),
        .table_write(table_write), .table_axis(table_axis), .table_address(table_address), .table_data(table_data),
        .missing()
    );

    localparam [2:0] WAIT = 3'd0, HEADER = 3'd1, WRITE = 3'd2, START = 3'd3, RENDER = 3'd4, REST = 3'd5, DONE = 3'd6;
    reg [31:0] jobs [0:JOB_WORDS-1];
    reg [8*256-1:0] jobs_file, results_file;
    reg [2:0] state = WAIT;
    reg finished = 1'b0;
    integer results, at, left, words, event_clock, flags, clocks, pause, i;

    always #5 clock = !clock;

    initial begin
        for (i = 0; i < JOB_WORDS; i = i + 1) jobs[i] = 32'd0;
        if (!$value$plusargs("jobs=%s", jobs_file)) jobs_file = "jobs.mem";
        if (!$value$plusargs("results=%s", results_file)) results_file = "results.txt";
        $readmemh(jobs_file, jobs);
        results = $fopen(results_file, "w");
        left = jobs[0];
        at = 1;
        pause = 0;
    end

    // Outputs are looked at, and inputs changed, at the falling edge: between two clocks of the renderer.
    always @(negedge clock) begin
        if (table_write) $fwrite(results, "w %0d %0d %0d %0d\n", busy, table_axis, table_address, $signed(table_data));
        write <= 1'b0;
        start <= 1'b0;
        reset <= 1'b0;
        case (state)
            WAIT: begin
                reset <= pause < 2;
                pause = pause + 1;
                if (pause == 4) state <= HEADER;
            end
            HEADER:
                if (left == 0) begin
                    $fclose(results);
                    finished <= 1'b1;
                    state <= DONE;
                end else begin
                    left = left - 1;
                    flags = jobs[at];
                    axis <= jobs[at+1][0];
                    harmonics <= jobs[at+2][9:0];
                    event_clock = jobs[at+3];
                    words = jobs[at+4];
                    at = at + 5;
                    i = 0;
                    state <= WRITE;
                end
            WRITE:
                if (i == words) begin
                    start <= 1'b1;
                    clocks = 0;
                    state <= START;
                end else begin
                    write <= 1'b1;
                    write_axis <= axis;
                    write_address <= i[10:0];
                    write_data <= jobs[at];
                    at = at + 1;
                    i = i + 1;
                end
            START, RENDER: begin
                if (state == START && !busy) begin
                    $fwrite(results, "f not busy after start\n");
                end
                if (busy) clocks = clocks + 1;
                if (busy && clocks == event_clock) begin
                    if (flags[0]) begin
                        start <= 1'b1;
                        axis <= !axis;
                        harmonics <= 10'd1;
                    end
                    if (flags[1]) reset <= 1'b1;
                    if (flags[2]) begin
                        write <= 1'b1;
                        write_axis <= table_axis;
                        write_address <= 11'd1;
                        write_data <= 32'h12345678;
                    end
                end
                state <= RENDER;
                if (state == RENDER && !busy) begin
                    $fwrite(results, "e %0d\n", clocks);
                    pause = 0;
                    state <= REST;
                    if (flags[3]) begin
                        flags = 0;
                        clocks = 0;
                        start <= 1'b1;
                        state <= START;
                    end
                end
            end
            REST: begin
                pause = pause + 1;
                if (pause == PAUSE) state <= HEADER;
            end
            default: ;
        endcase
    end
endmodule

`default_nettype wire
