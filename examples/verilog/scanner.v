// A whole scanner on an FPGA: plays the scan of annexin_200nm.vh on two serial converters that take bare words (AD5541A
// and alike), each with its data line, one clock and one select for both.
//
//     tablegen build examples/annexin_200nm.toml -o build
//     iverilog -g2005 -Ibuild -s scanner examples/verilog/scanner.v build/annexin_200nm_top.v build/dac_*.v
//
// annexin_200nm_top is the sequencer of the scan, with its boot and the coding of its converters; a build writes it for
// every scan. What follows it is yours: here a frame has the bits of a word, 16 for this scan. Converters with a frame
// of another form need its parameters at dac_spi.
//
// (The memory files are looked up where the simulation or the synthesis runs.) At power-up it boots the scan. While
// `run` is high it scans; low, it parks. `image` says that a pixel may be taken: inside the imaging window, settled, and
// without a fault.
//
// To let a host change the scan while it plays, connect it in place of the constants at `write` and the ports next to
// it.

`default_nettype none

module scanner #(
    parameter CLOCKS_PER_TICK = 100  // a 50 MHz clock, for the 500 kHz of the scan
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

    // Frames of both converters are as long as the wider word; a narrower one is in their low bits.
    localparam X_BITS = ANNEXIN_200NM_X_DAC_WORD_BITS, Y_BITS = ANNEXIN_200NM_Y_DAC_WORD_BITS;
    localparam FRAME_BITS = X_BITS > Y_BITS ? X_BITS : Y_BITS;
    localparam FRAME_CLOCKS = 2 * FRAME_BITS + 8;  // with the defaults of dac_spi

    generate
        if (CLOCKS_PER_TICK < FRAME_CLOCKS) begin : guard
            scanner_CLOCKS_PER_TICK_is_less_than_a_frame_takes stop ();
        end
    endgenerate

    reg [15:0] divider;
    reg tick, run_1, run_2, started, start;
    initial begin
        divider = 0;
        tick = 1'b0;
        {run_1, run_2, started, start} = 4'd0;
    end

    wire missed, missing, refused, strobe, swapped;
    wire [X_BITS-1:0] x_word;
    wire [Y_BITS-1:0] y_word;
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

    annexin_200nm_top #(.LOW_AREA(1), .CLOCKS_PER_TICK(CLOCKS_PER_TICK)) sequencer (
        .clock(clock), .reset(1'b0), .write(1'b0), .write_region(3'd0), .write_address(16'd0), .write_data(32'd0),
        .writable(), .refused(refused), .commit(1'b0), .commit_mode(2'd0), .withdraw(1'b0),
        .committed(), .can_keep(), .booting(), .missing(missing),
        .arm(start), .arm_frames(16'd0), .trigger(start), .park(!run_2), .clear_faults(1'b0), .armed(), .running(),
        .tick(tick), .underrun(missed), .busy(), .strobe(strobe), .x_code(), .y_code(), .x_word(x_word),
        .y_word(y_word), .line_marker(line), .frame_marker(frame), .pixel_marker(pixel), .backward_marker(backward),
        .valid_marker(image), .swapped_marker(swapped), .playing(), .parked(), .faults(faults), .fault_counts()
    );

    wire [FRAME_BITS+X_BITS-1:0] x_wide = {{FRAME_BITS{1'b0}}, x_word};
    wire [FRAME_BITS+Y_BITS-1:0] y_wide = {{FRAME_BITS{1'b0}}, y_word};

    dac_spi #(.WORD_BITS(FRAME_BITS), .FRAME_BITS(FRAME_BITS)) converters (
        .clock(clock), .reset(1'b0), .strobe(strobe), .x_word(x_wide[FRAME_BITS-1:0]),
        .y_word(y_wide[FRAME_BITS-1:0]), .sclk(sclk), .cs_x_n(select_n), .cs_y_n(), .mosi_x(x_data), .mosi_y(y_data),
        .ldac_n(load_n), .busy(), .missed(missed)
    );

    assign fault = faults != 4'd0 || missing || refused;
endmodule

`default_nettype wire
