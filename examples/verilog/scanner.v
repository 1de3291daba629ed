// A whole scanner on an FPGA: plays the scan of annexin_200nm.vh on two 16-bit serial converters (AD5541A and alike,
// each with its data line, one clock and one select for both).
//
//     tablegen build examples/annexin_200nm.toml -o build
//     iverilog -g2005 -Ibuild -s scanner examples/verilog/scanner.v build/dac_*.v
//
// It plays scans of interpolated or cubic tables of up to 127 harmonics an axis on converters with words of 16 bits, of
// both axes the same. Others do not elaborate: scanner_serves, below, names the reason.
//
// (The memory files are looked up where the simulation or the synthesis runs.) At power-up it boots the scan from its
// Fourier words, and computes the tables from them. While `run` is high it scans; low, it parks.
// `image` says that a pixel may be taken: inside the imaging window, settled, and without a fault.
//
// To let a host change the scan while it plays, connect it in place of the constants at `host_write` and the ports next
// to it.

`default_nettype none

module scanner #(
    parameter CLOCKS_PER_TICK = 100,  // a 50 MHz clock, for the 500 kHz of the scan
    parameter SHAPING = 0             // of a shaped scan, ANNEXIN_200NM_SHAPING of its .vh
) (
    input  wire clock,
    input  wire run,
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

    scanner_serves #(.CLOCKS_PER_TICK(CLOCKS_PER_TICK), .SHAPING(SHAPING), .HARMONICS(HARMONICS)) this_scan ();

    reg [15:0] divider;
    reg tick, run_1, run_2, started, start;
    initial begin
        divider = 0;
        tick = 1'b0;
        {run_1, run_2, started, start} = 4'd0;
    end

    wire writable, write, commit, missed, missing, refused, strobe, swapped;
    wire [2:0] region;
    wire [15:0] address;
    wire [31:0] data;
    wire [ANNEXIN_200NM_X_DAC_BITS-1:0] x_code, y_code;
    wire [ANNEXIN_200NM_X_DAC_WORD_BITS-1:0] x_word, y_word;
    wire [3:0] faults;

    // The first tick takes the first program. A later program is taken at a line start and needs no trigger.
    reg loaded;
    initial loaded = 1'b0;
    always @(posedge clock) begin
        divider <= divider == CLOCKS_PER_TICK - 1 ? 16'd0 : divider + 16'd1;
        tick <= divider == 16'd0;
        run_1 <= run;
        run_2 <= run_1;
        if (strobe && swapped) loaded <= 1'b1;
        start <= loaded && run_2 && !started;
        started <= run_2 && (started || loaded);
    end

    dac_boot #(
        .PROGRAM_FILE(ANNEXIN_200NM_PROGRAM_FILE), .FOURIER(1),
        .X_FILE(ANNEXIN_200NM_X_FOURIER_FILE), .X_WORDS(ANNEXIN_200NM_X_FOURIER_LENGTH), .X_WORD_BITS(32),
        .X_HARMONICS(ANNEXIN_200NM_X_HARMONICS),
        .Y_FILE(ANNEXIN_200NM_Y_FOURIER_FILE), .Y_WORDS(ANNEXIN_200NM_Y_FOURIER_LENGTH), .Y_WORD_BITS(32),
        .Y_HARMONICS(ANNEXIN_200NM_Y_HARMONICS)
    ) boot (
        .clock(clock), .reset(1'b0), .host_write(1'b0), .host_region(3'd0), .host_address(16'd0), .host_data(32'd0),
        .host_commit(1'b0), .writable(writable), .write(write), .write_region(region), .write_address(address),
        .write_data(data), .commit(commit), .booting(), .missing(missing)
    );

    dac_sequencer #(
        .DAC_BITS(ANNEXIN_200NM_X_DAC_BITS),
        .X_INTERPOLATED(ANNEXIN_200NM_X_INTERPOLATED), .X_INDEX_BITS(ANNEXIN_200NM_X_INDEX_BITS),
        .X_WORD_BITS(ANNEXIN_200NM_X_TABLE_BITS),
        .Y_INTERPOLATED(ANNEXIN_200NM_Y_INTERPOLATED), .Y_INDEX_BITS(ANNEXIN_200NM_Y_INDEX_BITS),
        .Y_WORD_BITS(ANNEXIN_200NM_Y_TABLE_BITS),
        .LOW_AREA(1), .FOURIER(1), .HARMONICS(HARMONICS), .SINE_FILE(ANNEXIN_200NM_SINE_FILE), .SHAPING(SHAPING)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(write), .write_region(region), .write_address(address), .write_data(data),
        .writable(writable), .refused(refused), .commit(commit), .withdraw(1'b0), .committed(), .arm(start),
        .arm_frames(16'd0),
        .trigger(start), .park(!run_2), .clear_faults(1'b0), .armed(), .running(), .tick(tick), .underrun(missed),
        .busy(),
        .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(line), .frame_marker(frame),
        .pixel_marker(pixel),
        .backward_marker(backward), .valid_marker(image), .swapped_marker(swapped), .playing(), .parked(),
        .faults(faults),
        .fault_counts()
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
module scanner_serves #(
    parameter CLOCKS_PER_TICK = 100,
    parameter SHAPING = 3,
    parameter HARMONICS = 127
);
    localparam ANNEXIN_200NM_SHAPING = 0;  // a shaped scan has its own, which hides this one

    generate
        if (1) begin : scan
            `include "annexin_200nm.vh"

            localparam CUBIC = ANNEXIN_200NM_X_INTERPOLATED == 3 || ANNEXIN_200NM_Y_INTERPOLATED == 3;
            localparam CLOCKS = (CUBIC ? 90 : 41) + (SHAPING != 0 ? 2 : 0);

            if (ANNEXIN_200NM_X_DAC_WORD_BITS != 16 || ANNEXIN_200NM_Y_DAC_WORD_BITS != 16) begin : guard_0
                scanner_serves_converters_with_words_of_16_bits stop ();
            end
            if (ANNEXIN_200NM_X_DAC_BITS != ANNEXIN_200NM_Y_DAC_BITS) begin : guard_1
                scanner_serves_converters_of_the_same_bits stop ();
            end
            if (ANNEXIN_200NM_X_INTERPOLATED == 0 || ANNEXIN_200NM_Y_INTERPOLATED == 0) begin : guard_2
                scanner_renders_no_direct_table stop ();
            end
            if (ANNEXIN_200NM_X_HARMONICS > HARMONICS || ANNEXIN_200NM_Y_HARMONICS > HARMONICS) begin : guard_3
                scanner_HARMONICS_is_less_than_those_of_the_scan stop ();
            end
            if (ANNEXIN_200NM_SHAPING > SHAPING) begin : guard_4
                scanner_SHAPING_is_less_than_that_of_the_scan stop ();
            end
            if (CLOCKS_PER_TICK < CLOCKS) begin : guard_5
                scanner_CLOCKS_PER_TICK_is_less_than_the_sequencer_takes stop ();
            end
        end
    endgenerate
endmodule

`default_nettype wire
