// Bench of program_loader: the loader, a boot program and a sequencer, with an asynchronous line to cocotb_loader.py.
//
// A command: `host_count` entries of `host_data` go onto the line, and `run_clocks` go by, or what comes first with
// `until_idle`: the loader has nothing more to do or to say. Then `done` is `go`. An entry is a byte; + 256: without
// its stop bit, + 512: a break of 12 bits, + 1024: a pulse of a quarter of a bit. `bit_time` is that of the host, in
// sixteenths of a clock.
// Every `tick_every` clocks there is a tick, `ticks_left` of them, or without end if all its bits are ones.
//
// line_log.v writes LINES.

`timescale 1ns / 1ps
`default_nettype none

module loader_bench #(
    parameter CLOCKS_PER_BIT = 8,
    parameter MEMORY_BYTES = 2048,
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 7,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 6,
    parameter Y_WORD_BITS = 16,
    parameter DAC_BITS = 16,
    parameter LOW_AREA = 0,
    parameter PLAIN_MULTIPLIER = 0,
    parameter COMMIT_MODES = 0,
    parameter FOURIER = 1,
    parameter HARMONICS = 16,
    parameter SINE_FILE = "",
    parameter X_CODE_MIN = 0,
    parameter X_CODE_MAX = 65535,
    parameter X_MAX_STEP = 65535,
    parameter Y_CODE_MIN = 0,
    parameter Y_CODE_MAX = 65535,
    parameter Y_MAX_STEP = 65535,
    parameter UPDATE_RATE = 500000,
    parameter SHAPING = 0,
    parameter BOOT_PROGRAM = "",  // none: it starts without one
    parameter BOOT_X = "",
    parameter BOOT_Y = "",
    parameter IDLE_FROM = 0,  // where the processor waits
    parameter IDLE_TO = 0,
    parameter LINES = ""
);
    localparam MOST = 1024;
    localparam [255:0] BOOT_HASH = 256'he0e1e2e3e4e5e6e7e8e9eaebecedeeeff0f1f2f3f4f5f6f7f8f9fafbfcfdfeff;

    reg clock = 0;
    reg go = 0, done = 0, until_idle = 0, permit = 1, reset = 0, underrun = 0;
    reg [31:0] run_clocks = 0, bit_time = 16 * CLOCKS_PER_BIT, tick_every = 64, boot_count = 0;
    reg [31:0] ticks_left = 0;
    reg ticks_set = 0;  // turns when ticks_left is to be taken
    reg [31:0] ticks_to_come = 0;
    reg ticks_seen = 0;
    reg [16*MOST-1:0] host_data = 0;
    reg [15:0] host_count = 0;
    reg [8*MOST-1:0] device_data = 0;
    reg [15:0] device_count = 0;
    reg finished = 0;

    initial while (!finished) begin
        #5 clock = 1;
        #5 clock = 0;
    end

    integer receiving = 0;
    wire booting, committed, writable, refused;

    // The host's transmitter. The line is what it is until `edge_in` more sixteenths have gone.
    reg host_line = 1;
    reg [15:0] sending = 0, at = 0;
    integer bit_at = -1, edge_in = 0;
    reg [31:0] clocks_left = 0;
    reg [7:0] idle = 0;  // clocks
    wire [15:0] entry = host_data[16*at +: 16];

    task next_level;
        begin
            bit_at = bit_at + 1;
            edge_in = edge_in + bit_time;
            if (entry[9]) begin
                host_line <= bit_at >= 12;
                if (bit_at > 13) bit_at = -1;
            end else if (entry[10]) begin
                host_line <= bit_at != 0;
                if (bit_at == 0) edge_in = edge_in - bit_time + bit_time / 4;
                if (bit_at > 2) bit_at = -1;
            end else begin
                host_line <= bit_at == 0 ? 1'b0 : bit_at < 9 ? entry[bit_at-1] : bit_at > 9 || !entry[8];
                if (bit_at > 9 + entry[8]) bit_at = -1;
            end
        end
    endtask

    wire device_line;
    reg [7:0] coming = 0;

    // What is written belongs to the clock that follows.
    always @(posedge clock) begin
        if (go != done && clocks_left == 0) begin
            clocks_left = run_clocks;
            at = 0;
            sending = host_count;
            device_count = 0;
            idle = 0;
        end
        if (sending != 0) begin
            edge_in = edge_in - 16;
            while (edge_in <= 0 && sending != 0) begin
                next_level;
                if (bit_at < 0) begin
                    edge_in = edge_in - bit_time;
                    at = at + 1;
                    sending = sending - 1;
                end
            end
        end
        if (loader.core.pc < IDLE_FROM || loader.core.pc > IDLE_TO || !loader.ready || receiving != 0 || sending != 0)
            idle = 0;
        else if ((ticks_to_come != 0 && ~ticks_to_come != 0) || booting || !(committed || writable))
            idle = 0;
        else if (idle != 255)
            idle = idle + 1;
        if (clocks_left != 0) begin
            clocks_left = clocks_left - 1;
            if (sending == 0 && until_idle && idle > 200) clocks_left = 0;
            if (clocks_left == 0) done <= go;
        end

        // Its receiver, after the command that emptied `device_data`: a byte that ends on that clock belongs to it.
        if (receiving == 0)
            receiving = device_line ? 0 : 1;
        else begin
            receiving = receiving + 1;
            if (receiving % CLOCKS_PER_BIT == CLOCKS_PER_BIT / 2) begin
                if (receiving > 9 * CLOCKS_PER_BIT) begin
                    if (!device_line) $display("a byte without a stop bit");
                    device_data[8*device_count +: 8] = coming;
                    device_count = device_count + 1;
                    receiving = 0;
                end else if (receiving > CLOCKS_PER_BIT)
                    coming = {device_line, coming[7:1]};
            end
        end
    end

    wire host_write, write, host_commit, commit, withdraw, arm, trigger, park, clear_faults;
    wire [1:0] commit_mode;
    wire can_keep;
    wire [2:0] host_region, region;
    wire [15:0] host_address, address, arm_frames;
    wire [31:0] host_word, word;
    wire strobe, line_marker, frame_marker, pixel_marker, backward_marker, valid_marker, swapped_marker;
    wire playing, parked;
    wire [3:0] faults;
    wire [63:0] fault_counts;
    wire [DAC_BITS-1:0] x_code, y_code;
    reg tick = 0;
    reg [31:0] divider = 0;
    wire busy;
    always @(posedge clock) begin
        divider <= divider + 1 >= tick_every ? 0 : divider + 1;
        tick <= ticks_to_come != 0 && divider == 0 && !booting;
        if (ticks_set != ticks_seen) begin
            ticks_seen <= ticks_set;
            ticks_to_come <= ticks_left;
        end else if (ticks_to_come != 0 && divider == 0 && !booting && ~ticks_to_come != 0)
            ticks_to_come <= ticks_to_come - 1;
    end

    program_loader #(
        .CLOCKS_PER_BIT(CLOCKS_PER_BIT), .MEMORY_BYTES(MEMORY_BYTES), .DAC_BITS(DAC_BITS),
        .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .COMMIT_MODES(COMMIT_MODES), .FOURIER(FOURIER),
        .HARMONICS(HARMONICS), .X_CODE_MIN(X_CODE_MIN), .X_CODE_MAX(X_CODE_MAX), .X_MAX_STEP(X_MAX_STEP),
        .Y_CODE_MIN(Y_CODE_MIN), .Y_CODE_MAX(Y_CODE_MAX), .Y_MAX_STEP(Y_MAX_STEP), .UPDATE_RATE(UPDATE_RATE), .SHAPING(SHAPING),
        .BOOT_HASH(BOOT_PROGRAM == "" ? 256'd0 : BOOT_HASH)
    ) loader (
        .clock(clock), .reset(reset), .line_in(host_line), .line_out(device_line), .permit(permit), .boot(boot_count),
        .booting(booting), .write(host_write), .write_region(host_region), .write_address(host_address),
        .write_data(host_word), .writable(writable), .refused(refused), .commit(host_commit), .commit_mode(commit_mode), .can_keep(can_keep),
        .withdraw(withdraw), .arm(arm), .arm_frames(arm_frames), .trigger(trigger), .park(park), .clear_faults(clear_faults),
        .strobe(strobe), .line_marker(line_marker), .frame_marker(frame_marker), .swapped_marker(swapped_marker),
        .playing(playing), .parked(parked), .faults(faults), .fault_counts(fault_counts)
    );

    generate
        if (BOOT_PROGRAM == "") begin : bare
            assign booting = 1'b0;
            assign {write, region, address, word, commit} =
                {host_write, host_region, host_address, host_word, host_commit};
        end else begin : booted
            dac_boot #(
                .PROGRAM_FILE(BOOT_PROGRAM), .X_FILE(BOOT_X), .X_WORDS(1 << X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
                .Y_FILE(BOOT_Y), .Y_WORDS(1 << Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .START_CLOCKS(0)
            ) boot (
                .clock(clock), .reset(1'b0), .host_write(host_write), .host_region(host_region),
                .host_address(host_address), .host_data(host_word), .host_commit(host_commit), .writable(writable),
                .write(write), .write_region(region), .write_address(address), .write_data(word), .commit(commit),
                .starting(), .booting(booting)
            );
        end
    endgenerate

    dac_sequencer #(
        .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .LOW_AREA(LOW_AREA),
        .PLAIN_MULTIPLIER(PLAIN_MULTIPLIER), .COMMIT_MODES(COMMIT_MODES), .FOURIER(FOURIER), .HARMONICS(HARMONICS), .SINE_FILE(SINE_FILE),
        .SHAPING(SHAPING)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(write), .write_region(region), .write_address(address), .write_data(word),
        .writable(writable), .refused(refused), .commit(commit), .commit_mode(commit_mode), .can_keep(can_keep), .withdraw(withdraw),
        .committed(committed), .arm(arm),
        .arm_frames(arm_frames), .trigger(trigger), .park(park), .clear_faults(clear_faults), .armed(), .running(),
        .tick(tick), .underrun(underrun), .busy(busy), .strobe(strobe), .x_code(x_code), .y_code(y_code),
        .line_marker(line_marker), .frame_marker(frame_marker), .pixel_marker(pixel_marker),
        .backward_marker(backward_marker), .valid_marker(valid_marker), .swapped_marker(swapped_marker),
        .playing(playing), .parked(parked), .faults(faults), .fault_counts(fault_counts)
    );

    line_log #(.DAC_BITS(DAC_BITS), .LINES(LINES)) lines (
        .clock(clock), .strobe(strobe), .x_code(x_code), .y_code(y_code), .markers({
            parked, playing, swapped_marker, valid_marker, backward_marker, pixel_marker, frame_marker, line_marker
        }), .faults(faults)
    );
endmodule

`default_nettype wire
