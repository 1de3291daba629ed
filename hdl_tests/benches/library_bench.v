// dac_library with a memory of programs and a dac_sequencer behind it: programs are picked in turn while a scan plays.
//
// PICKS has numbers, PICK_COUNT of them. After each pick the bench waits for the swap, or for `failed`, and plays some
// ticks. CAPTURE gets a line for each: "p NUMBER", "f" where a pick failed, "t SWAPPED X Y FAULTS" a tick.

`default_nettype none
`timescale 1ns / 1ps

module library_bench #(
    parameter CAPTURE = "capture.txt",
    parameter PICKS = "picks.hex",
    parameter PICK_COUNT = 1,
    parameter MEMORY = "memory.mem",
    parameter MEMORY_WORDS = 1,
    parameter MEMORY_CLOCKS = 1,   // from memory_read to memory_ready
    parameter FOURIER = 0,
    parameter TICKS = 300
);
    `include "lines_library.vh"

    localparam ADDRESS_BITS = 20;
    reg clock = 1'b0, pick = 1'b0, tick = 1'b0, start = 1'b0;
    reg [15:0] number = 16'd0;
    reg [31:0] memory [0:MEMORY_WORDS-1];
    reg [15:0] picks [0:PICK_COUNT-1];
    initial begin
        $readmemh(MEMORY, memory);
        $readmemh(PICKS, picks);
    end
    always #5 clock = !clock;

    wire busy, failed, memory_read, writable, write, commit, withdraw, refused, committed, strobe, swapped, playing;
    wire [ADDRESS_BITS-1:0] memory_address;
    wire [2:0] region;
    wire [15:0] address, x_code, y_code;
    wire [31:0] data;
    wire [3:0] faults;

    reg [7:0] delay = 8'd0;
    reg memory_ready = 1'b0;
    reg [31:0] memory_data = 32'd0;
    always @(posedge clock) begin
        if (delay != 0) delay <= delay - 8'd1;
        else if (memory_read) delay <= MEMORY_CLOCKS;
        memory_ready <= delay == 1 || (MEMORY_CLOCKS == 0 && memory_read);
        memory_data <= memory_ready ? 32'hDEADBEEF : memory[memory_address];
    end

    dac_library #(.PROGRAMS(LINES_LIBRARY_PROGRAMS), .ADDRESS_BITS(ADDRESS_BITS)) picker (
        .clock(clock), .reset(1'b0), .pick(pick), .number(number), .busy(busy), .failed(failed),
        .memory_read(memory_read), .memory_address(memory_address), .memory_ready(memory_ready),
        .memory_data(memory_data), .writable(writable), .committed(committed), .write(write), .write_region(region),
        .write_address(address), .write_data(data), .commit(commit), .withdraw(withdraw)
    );

    dac_sequencer #(
        .DAC_BITS(LINES_LIBRARY_DAC_BITS),
        .X_INTERPOLATED(LINES_LIBRARY_X_INTERPOLATED), .X_INDEX_BITS(LINES_LIBRARY_X_INDEX_BITS),
        .X_WORD_BITS(LINES_LIBRARY_X_WORD_BITS), .Y_INTERPOLATED(LINES_LIBRARY_Y_INTERPOLATED),
        .Y_INDEX_BITS(LINES_LIBRARY_Y_INDEX_BITS), .Y_WORD_BITS(LINES_LIBRARY_Y_WORD_BITS),
        .TICK_BITS(LINES_LIBRARY_TICK_BITS), .LINE_BITS(LINES_LIBRARY_LINE_BITS),
        .PERIOD_BITS(LINES_LIBRARY_PERIOD_BITS), .PLAIN_MULTIPLIER(1), .FOURIER(FOURIER),
        .HARMONICS(LINES_LIBRARY_HARMONICS), .SHAPING(LINES_LIBRARY_SHAPING), .SINE_FILE(LINES_LIBRARY_SINE_FILE)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(write), .write_region(region), .write_address(address), .write_data(data),
        .writable(writable), .refused(refused), .commit(commit), .commit_mode(2'd0), .withdraw(withdraw),
        .committed(committed), .arm(start),
        .arm_frames(16'd0), .trigger(start), .park(1'b0), .clear_faults(1'b0), .armed(), .running(), .tick(tick),
        .underrun(1'b0), .busy(), .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(), .frame_marker(),
        .pixel_marker(), .backward_marker(), .valid_marker(), .swapped_marker(swapped), .playing(playing), .parked(),
        .faults(faults), .fault_counts()
    );

    integer file, at, waited;
    reg any;

    task play(input integer ticks);
        integer played;
        for (played = 0; played < ticks; played = played + 1) begin
            @(negedge clock) tick = 1'b1;
            @(negedge clock) tick = 1'b0;
            while (!strobe) @(negedge clock);
            $fwrite(file, "t %0d %0d %0d %0d\n", swapped, x_code, y_code, faults);
        end
    endtask

    initial begin
        file = $fopen(CAPTURE, "w");
        any = 1'b0;
        for (at = 0; at < PICK_COUNT; at = at + 1) begin
            @(negedge clock) begin
                number = picks[at];
                pick = 1'b1;
            end
            $fwrite(file, "p %0d\n", number);
            @(negedge clock) pick = 1'b0;
            while (busy) @(negedge clock);
            @(negedge clock);
            if (failed) $fwrite(file, "f\n");
            else begin
                waited = 0;
                while (!committed && waited < 300000) begin
                    @(negedge clock) waited = waited + 1;
                end
                if (!any) begin
                    play(1);
                    @(negedge clock) start = 1'b1;
                    @(negedge clock) start = 1'b0;
                end
                any = 1'b1;
            end
            play(TICKS);
        end
        $fclose(file);
        $finish;
    end
endmodule

`default_nettype wire
