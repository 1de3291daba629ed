// A whole scanner on an FPGA that takes new scans over a serial line: examples/verilog/scanner.v with a program_loader.
//
//     tablegen build examples/annexin_200nm.toml -o build
//     iverilog -g2005 -Ibuild -s linked_scanner examples/verilog/linked_scanner.v build/dac_*.v build/program_loader.v
//     tablegen trigger --port /dev/ttyUSB0
//     tablegen upload another_scan.toml --port /dev/ttyUSB0
//
// At power-up it boots the scan of the build and holds its park codes, until it is triggered over the line. `permit` is
// the interlock of the instrument: while it is low, no new scan becomes active and the old one continues. MEMORY_BYTES
// is enough for scans as Fourier words; 16384 is enough for the tables of this scan. X_MAX_STEP and the parameters next
// to it are limits that no scan may exceed: set those of your instrument. It serves the scans that scanner.v does:
// linked_scanner_serves, below, refuses the others.

`default_nettype none

module linked_scanner #(
    parameter CLOCKS_PER_TICK = 100,  // a 50 MHz clock, for the 500 kHz of the scan
    parameter CLOCKS_PER_BIT = 434,   // 115200 baud
    parameter MEMORY_BYTES = 2048,
    parameter SHAPING = 0,            // the highest order of shaping that it plays, 0 to 3
    parameter START_CLOCKS = 4096     // clocks after power-up before a block RAM is read
) (
    input  wire clock,
    input  wire line_in,
    output wire line_out,
    input  wire permit,
    output wire sclk,
    output wire select_n,
    output wire x_data,
    output wire y_data,
    output wire load_n,
    output wire line,
    output wire frame,
    output wire pixel,
    output wire backward,
    output wire image,
    output wire fault
);
    `include "annexin_200nm.vh"

    localparam HARMONICS = 127;

    linked_scanner_serves #(.CLOCKS_PER_TICK(CLOCKS_PER_TICK), .SHAPING(SHAPING), .HARMONICS(HARMONICS)) this_scan ();

    reg [15:0] divider;
    reg tick;
    initial begin
        divider = 0;
        tick = 1'b0;
    end
    always @(posedge clock) begin
        divider <= divider == CLOCKS_PER_TICK - 1 ? 16'd0 : divider + 16'd1;
        tick <= divider == 16'd0;
    end

    wire starting, booting;
    wire host_write, host_commit, write, commit, writable, withdraw, arm, trigger, park, clear_faults;
    wire [2:0] host_region, region;
    wire [15:0] host_address, address, arm_frames;
    wire [31:0] host_data, data;
    wire [1:0] commit_mode;
    wire can_keep;
    wire strobe, swapped, playing, parked, missed, missing, refused;
    wire [ANNEXIN_200NM_X_DAC_BITS-1:0] x_code, y_code;
    wire [ANNEXIN_200NM_X_DAC_WORD_BITS-1:0] x_word, y_word;
    wire [3:0] faults;
    wire [63:0] fault_counts;

    program_loader #(
        .CLOCKS_PER_BIT(CLOCKS_PER_BIT), .MEMORY_BYTES(MEMORY_BYTES), .DAC_BITS(ANNEXIN_200NM_X_DAC_BITS),
        .X_INTERPOLATED(ANNEXIN_200NM_X_INTERPOLATED), .X_INDEX_BITS(ANNEXIN_200NM_X_INDEX_BITS),
        .X_WORD_BITS(ANNEXIN_200NM_X_TABLE_BITS), .Y_INTERPOLATED(ANNEXIN_200NM_Y_INTERPOLATED),
        .Y_INDEX_BITS(ANNEXIN_200NM_Y_INDEX_BITS), .Y_WORD_BITS(ANNEXIN_200NM_Y_TABLE_BITS),
        .COMMIT_MODES(1), .FOURIER(1), .HARMONICS(HARMONICS), .SHAPING(SHAPING),
        .CONVERTER(ANNEXIN_200NM_X_DAC_WORD_BITS + 64 * ANNEXIN_200NM_X_DAC_TWOS_COMPLEMENT +
                   128 * ANNEXIN_200NM_X_DAC_LEFT_ALIGNED),
        .X_CODE_MIN(ANNEXIN_200NM_X_CODE_MIN), .X_CODE_MAX(ANNEXIN_200NM_X_CODE_MAX),
        .X_MAX_STEP(ANNEXIN_200NM_X_MAX_STEP),
        .Y_CODE_MIN(ANNEXIN_200NM_Y_CODE_MIN), .Y_CODE_MAX(ANNEXIN_200NM_Y_CODE_MAX),
        .Y_MAX_STEP(ANNEXIN_200NM_Y_MAX_STEP),
        .UPDATE_RATE(ANNEXIN_200NM_UPDATE_RATE_MILLIHZ / 1000), .BOOT_HASH(ANNEXIN_200NM_HASH)
    ) loader (
        .clock(clock), .reset(starting), .line_in(line_in), .line_out(line_out), .permit(permit), .boot(32'd0),
        .booting(booting), .write(host_write), .write_region(host_region), .write_address(host_address),
        .write_data(host_data), .writable(writable), .refused(refused), .commit(host_commit),
        .commit_mode(commit_mode), .can_keep(can_keep), .withdraw(withdraw), .arm(arm), .arm_frames(arm_frames),
        .trigger(trigger), .park(park), .clear_faults(clear_faults),
        .strobe(strobe), .line_marker(line), .frame_marker(frame), .swapped_marker(swapped), .playing(playing),
        .parked(parked), .faults(faults), .fault_counts(fault_counts)
    );

    dac_boot #(
        .PROGRAM_FILE(ANNEXIN_200NM_PROGRAM_FILE), .FOURIER(1), .START_CLOCKS(START_CLOCKS),
        .X_FILE(ANNEXIN_200NM_X_FOURIER_FILE), .X_WORDS(ANNEXIN_200NM_X_FOURIER_LENGTH), .X_WORD_BITS(32),
        .X_HARMONICS(ANNEXIN_200NM_X_HARMONICS),
        .Y_FILE(ANNEXIN_200NM_Y_FOURIER_FILE), .Y_WORDS(ANNEXIN_200NM_Y_FOURIER_LENGTH), .Y_WORD_BITS(32),
        .Y_HARMONICS(ANNEXIN_200NM_Y_HARMONICS)
    ) boot (
        .clock(clock), .reset(1'b0), .host_write(host_write), .host_region(host_region), .host_address(host_address),
        .host_data(host_data), .host_commit(host_commit), .writable(writable), .write(write), .write_region(region),
        .write_address(address), .write_data(data), .commit(commit), .starting(starting),
        .booting(booting), .missing(missing)
    );

    dac_sequencer #(
        .DAC_BITS(ANNEXIN_200NM_X_DAC_BITS),
        .X_INTERPOLATED(ANNEXIN_200NM_X_INTERPOLATED), .X_INDEX_BITS(ANNEXIN_200NM_X_INDEX_BITS),
        .X_WORD_BITS(ANNEXIN_200NM_X_TABLE_BITS),
        .Y_INTERPOLATED(ANNEXIN_200NM_Y_INTERPOLATED), .Y_INDEX_BITS(ANNEXIN_200NM_Y_INDEX_BITS),
        .Y_WORD_BITS(ANNEXIN_200NM_Y_TABLE_BITS),
        .LOW_AREA(1), .COMMIT_MODES(1), .FOURIER(1), .HARMONICS(HARMONICS), .SINE_FILE(ANNEXIN_200NM_SINE_FILE),
        .SHAPING(SHAPING)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(write), .write_region(region), .write_address(address), .write_data(data),
        .writable(writable), .refused(refused), .commit(commit), .commit_mode(commit_mode), .can_keep(can_keep),
        .withdraw(booting ? missing : withdraw),
        .committed(), .arm(arm),
        .arm_frames(arm_frames), .trigger(trigger), .park(park), .clear_faults(clear_faults), .armed(), .running(),
        .tick(tick && !booting), .underrun(missed), .busy(), .strobe(strobe), .x_code(x_code), .y_code(y_code),
        .line_marker(line), .frame_marker(frame), .pixel_marker(pixel), .backward_marker(backward),
        .valid_marker(image), .swapped_marker(swapped), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );

    dac_coding #(
        .BITS(ANNEXIN_200NM_X_DAC_BITS), .WORD_BITS(ANNEXIN_200NM_X_DAC_WORD_BITS),
        .TWOS_COMPLEMENT(ANNEXIN_200NM_X_DAC_TWOS_COMPLEMENT), .LEFT_ALIGNED(ANNEXIN_200NM_X_DAC_LEFT_ALIGNED)
    ) x_coding (.code(x_code), .word(x_word));
    dac_coding #(
        .BITS(ANNEXIN_200NM_Y_DAC_BITS), .WORD_BITS(ANNEXIN_200NM_Y_DAC_WORD_BITS),
        .TWOS_COMPLEMENT(ANNEXIN_200NM_Y_DAC_TWOS_COMPLEMENT), .LEFT_ALIGNED(ANNEXIN_200NM_Y_DAC_LEFT_ALIGNED)
    ) y_coding (.code(y_code), .word(y_word));

    dac_spi #(.WORD_BITS(ANNEXIN_200NM_X_DAC_WORD_BITS), .FRAME_BITS(16)) converters (
        .clock(clock), .reset(1'b0), .strobe(strobe), .x_word(x_word), .y_word(y_word), .sclk(sclk), .cs_x_n(select_n),
        .cs_y_n(), .mosi_x(x_data), .mosi_y(y_data), .ldac_n(load_n), .busy(), .missed(missed)
    );

    assign fault = faults != 4'd0 || missing || refused;
endmodule


// Which scans this device plays. The reason of a refusal is the name of a module that does not exist.
module linked_scanner_serves #(
    parameter CLOCKS_PER_TICK = 100,
    parameter SHAPING = 3,
    parameter HARMONICS = 127
);
    generate
        if (1) begin : scan
            `include "annexin_200nm.vh"

            localparam CUBIC = ANNEXIN_200NM_X_INTERPOLATED == 3 || ANNEXIN_200NM_Y_INTERPOLATED == 3;
            localparam CLOCKS = (CUBIC ? 90 : 41) + (SHAPING != 0 ? 2 : 0);

            if (ANNEXIN_200NM_X_DAC_WORD_BITS != 16 || ANNEXIN_200NM_Y_DAC_WORD_BITS != 16) begin : guard_0
                linked_scanner_serves_converters_with_words_of_16_bits stop ();
            end
            if (ANNEXIN_200NM_X_DAC_BITS != ANNEXIN_200NM_Y_DAC_BITS) begin : guard_1
                linked_scanner_serves_converters_of_the_same_bits stop ();
            end
            if (ANNEXIN_200NM_X_INTERPOLATED == 0 || ANNEXIN_200NM_Y_INTERPOLATED == 0) begin : guard_2
                linked_scanner_renders_no_direct_table stop ();
            end
            if (ANNEXIN_200NM_X_HARMONICS > HARMONICS || ANNEXIN_200NM_Y_HARMONICS > HARMONICS) begin : guard_3
                linked_scanner_HARMONICS_is_less_than_those_of_the_scan stop ();
            end
            if (ANNEXIN_200NM_SHAPING > SHAPING) begin : guard_4
                linked_scanner_SHAPING_is_less_than_that_of_the_scan stop ();
            end
            if (ANNEXIN_200NM_PIXEL_INDEX_BITS != 0) begin : guard_6
                linked_scanner_plays_no_table_of_pixels stop ();
            end
            if (CLOCKS_PER_TICK < CLOCKS) begin : guard_5
                linked_scanner_CLOCKS_PER_TICK_is_less_than_the_sequencer_takes stop ();
            end
        end
    endgenerate
endmodule

`default_nettype wire
