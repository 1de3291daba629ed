// The two-axis DAC sequencer: plays compensated scan lines, changes programs at line starts, and outputs markers.
//
//   host    writes the idle program (`write`, while `writable`), then pulses `commit`. Both axes change to the new
//           program at the first tick of a line, or at the next tick while nothing plays. docs/verilog.md has the map
//           of the program words. With COMMIT_MODES `commit_mode` says, on the clock of the commit, which line.
//   scan    `arm` and `trigger` start frames, `park` and `reset` end them. The slew guard limits every step.
//   tick    is one clock long, at the update rate of the converter. `strobe` comes with the codes and markers of a
//           tick: 36 clocks after it, 24 with PLAIN_MULTIPLIER = 1, 41 with LOW_AREA = 1 (`busy` is high until then).
//           With SHAPING it is a clock later, and two with LOW_AREA = 1. Where SHAPING is 3, ticks are at least 6
//           clocks apart: `busy` is high on the five after a tick. Where a table is cubic, a strobe comes 64, 57 or 90
//           clocks after its tick, and ticks are at least 11 clocks apart. With SLOW_PART it is 3 clocks later, and
//           `busy` is high while the line that the next tick begins is not ready. With ALTERNATE a strobe comes 48
//           clocks after its tick, and ticks are at least 2 clocks apart: `busy` is high on the one after a tick.
//
// docs/sequencer.md defines what happens on which tick, and every bit of every code. All inputs must be synchronous to
// `clock`. The design relies on power-up values of its registers, as FPGAs have them: a reset must not move a code.

`default_nettype none

module dac_sequencer #(
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 1,    // degree between words; 0: none, one word per advance; 1: lines; 3: cubic
    parameter X_INDEX_BITS = 11,     // a bank holds 2^X_INDEX_BITS words; an interpolated table has exactly this length
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter Y_WORD_BITS = 16,
    parameter TICK_BITS = 24,        // a line has at most 2^TICK_BITS ticks
    parameter LINE_BITS = 16,        // a frame has at most 2^LINE_BITS lines
    parameter PERIOD_BITS = 31,      // a period has less than 2^PERIOD_BITS advances
    parameter COUNT_BITS = 16,       // bits of a fault counter
    parameter PLAIN_MULTIPLIER = 0,  // 1: multiplies with `*`, in multiplier blocks; 0: in look-up tables
    parameter LOW_AREA = 0,          // 1: 41 clocks per sample, less area, no multiplier blocks
    parameter ALTERNATE = 0,         // 1: both axes by turns in one pipeline, 2 clocks per sample, less area
    parameter COMMIT_MODES = 0,      // 1: a commit has a mode
    parameter FOURIER = 0,           // 1: computes tables from Fourier words
    parameter HARMONICS = 64,        // with FOURIER: largest number of harmonics
    parameter SINE_FILE = "",        // with FOURIER: file with a quarter sine for the longer table
    parameter SHAPING = 0,           // highest order of shaping: 0 none, 1 first, 2 second, 3 scanner
    parameter SLOW_PART = 0,         // 1: plays programs with a slow part on both axes, and no others
    parameter SLOW_INDEX_BITS = 7,   // with SLOW_PART: a slow table has at most 2^SLOW_INDEX_BITS words
    parameter PIXEL_INDEX_BITS = 0,  // a bank holds the ticks of 2^(PIXEL_INDEX_BITS - 1) pixels a sweep; 0: of none
    parameter [63:0] X_POWER_UP_CODE = 0,  // output code before the first program
    parameter [63:0] Y_POWER_UP_CODE = 0
) (
    input  wire                    clock,
    input  wire                    reset,
    // writes to the idle program
    input  wire                    write,
    input  wire [2:0]              write_region,   // 0 program, 1, 2 tables, 3, 4 Fourier, 5, 6 slow parts; 7 pixels
    input  wire [15:0]             write_address,
    input  wire [31:0]             write_data,
    output wire                    writable,       // low: a write is refused
    output reg                     refused,        // a write or a commit was refused; holds until clear_faults or reset
    input  wire                    commit,
    input  wire [1:0]              commit_mode,    // with COMMIT_MODES: 0 line, 1 keep, 2 frame
    input  wire                    withdraw,
    output wire                    committed,
    output wire                    can_keep,       // the idle program can continue the frame of the one that plays
    // requests
    input  wire                    arm,
    input  wire [15:0]             arm_frames,     // 0: endless
    input  wire                    trigger,
    input  wire                    park,
    input  wire                    clear_faults,
    output wire                    armed,
    output wire                    running,        // the next tick will play
    // samples
    input  wire                    tick,
    input  wire                    underrun,       // an output missed a sample: counted as a fault
    output wire                    busy,
    output wire                    strobe,
    output wire [DAC_BITS-1:0]     x_code,
    output wire [DAC_BITS-1:0]     y_code,
    output wire                    line_marker,
    output wire                    frame_marker,
    output wire                    pixel_marker,
    output wire                    backward_marker,
    output wire                    valid_marker,
    output wire                    swapped_marker,
    output wire                    playing,
    output wire                    parked,
    output wire [3:0]              faults,         // slew, clamp, overrun, underrun
    output wire [4*COUNT_BITS-1:0] fault_counts
);
    localparam [2:0] PROGRAM = 3'd0, X_TABLE = 3'd1, Y_TABLE = 3'd2, X_FOURIER = 3'd3, Y_FOURIER = 3'd4;
    localparam [2:0] PIXEL_TICKS = 3'd7;
    localparam [3:0] AXIS_HARMONICS = 4'd10;
    localparam [15:0] PROGRAM_WORDS = 16'd48;
    localparam [31:0] LAST = 2 * HARMONICS;
    localparam [15:0] LAST_FOURIER = LAST[15:0];
    localparam [11:0] SCAN_PAGE = 12'd0, X_PAGE = 12'd1, Y_PAGE = 12'd2;
    localparam SPLINE = X_INTERPOLATED == 3 || Y_INTERPOLATED == 3 ? 1 : 0;
    localparam LATENCY =
        (SPLINE ? 43 : PLAIN_MULTIPLIER ? 10 : 15) + (PLAIN_MULTIPLIER ? 12 : 19) + (SHAPING != 0 ? 1 : 0);
    localparam SPACING = SPLINE ? 11 : SHAPING == 3 ? 6 : 1;  // least clocks from tick to tick
    localparam MARKERS_AT = 3, PIXELS_AT = PIXEL_INDEX_BITS != 0 ? 5 : MARKERS_AT;
    localparam LONGER_BITS = X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS;
    localparam X_PERIOD_BITS = TICK_BITS + 1;  // the period of x is a line

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (DAC_BITS < 8 || DAC_BITS > 24) begin : guard_0
            dac_sequencer_DAC_BITS_is_not_8_to_24 stop ();
        end
        if (X_INTERPOLATED != 0 && X_INTERPOLATED != 1 && X_INTERPOLATED != 3) begin : guard_1
            dac_sequencer_X_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (X_INDEX_BITS < 2 || X_INDEX_BITS > 16) begin : guard_2
            dac_sequencer_X_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (X_WORD_BITS < 8 || X_WORD_BITS > 24) begin : guard_3
            dac_sequencer_X_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (Y_INTERPOLATED != 0 && Y_INTERPOLATED != 1 && Y_INTERPOLATED != 3) begin : guard_4
            dac_sequencer_Y_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (Y_INDEX_BITS < 2 || Y_INDEX_BITS > 16) begin : guard_5
            dac_sequencer_Y_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (Y_WORD_BITS < 8 || Y_WORD_BITS > 24) begin : guard_6
            dac_sequencer_Y_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (TICK_BITS < 3 || TICK_BITS > 30) begin : guard_7
            dac_sequencer_TICK_BITS_is_not_3_to_30 stop ();
        end
        if (LINE_BITS < 1 || LINE_BITS > 16) begin : guard_8
            dac_sequencer_LINE_BITS_is_not_1_to_16 stop ();
        end
        if (PERIOD_BITS < 1 || PERIOD_BITS > 31) begin : guard_9
            dac_sequencer_PERIOD_BITS_is_not_1_to_31 stop ();
        end
        if (COUNT_BITS < 2 || COUNT_BITS > 32) begin : guard_10
            dac_sequencer_COUNT_BITS_is_not_2_to_32 stop ();
        end
        if (PLAIN_MULTIPLIER < 0 || PLAIN_MULTIPLIER > 1) begin : guard_11
            dac_sequencer_PLAIN_MULTIPLIER_is_not_0_to_1 stop ();
        end
        if (LOW_AREA < 0 || LOW_AREA > 1) begin : guard_12
            dac_sequencer_LOW_AREA_is_not_0_to_1 stop ();
        end
        if (COMMIT_MODES < 0 || COMMIT_MODES > 1) begin : guard_31
            dac_sequencer_COMMIT_MODES_is_not_0_to_1 stop ();
        end
        if (FOURIER < 0 || FOURIER > 1) begin : guard_13
            dac_sequencer_FOURIER_is_not_0_to_1 stop ();
        end
        if (HARMONICS < 1 || HARMONICS > 512) begin : guard_14
            dac_sequencer_HARMONICS_is_not_1_to_512 stop ();
        end
        if (X_POWER_UP_CODE >> DAC_BITS != 64'd0) begin : guard_15
            dac_sequencer_X_POWER_UP_CODE_has_more_than_DAC_BITS stop ();
        end
        if (Y_POWER_UP_CODE >> DAC_BITS != 64'd0) begin : guard_16
            dac_sequencer_Y_POWER_UP_CODE_has_more_than_DAC_BITS stop ();
        end
        if (SHAPING < 0 || SHAPING > 3) begin : guard_17
            dac_sequencer_SHAPING_is_not_0_to_3 stop ();
        end
        if (X_INTERPOLATED == 3 && (X_INDEX_BITS < 3 || X_INDEX_BITS > 14)) begin : guard_18
            dac_sequencer_X_INDEX_BITS_of_a_cubic_table_is_not_3_to_14 stop ();
        end
        if (X_INTERPOLATED == 3 && X_WORD_BITS > 21) begin : guard_19
            dac_sequencer_X_WORD_BITS_of_a_cubic_table_is_not_8_to_21 stop ();
        end
        if (Y_INTERPOLATED == 3 && (Y_INDEX_BITS < 3 || Y_INDEX_BITS > 14)) begin : guard_20
            dac_sequencer_Y_INDEX_BITS_of_a_cubic_table_is_not_3_to_14 stop ();
        end
        if (Y_INTERPOLATED == 3 && Y_WORD_BITS > 21) begin : guard_21
            dac_sequencer_Y_WORD_BITS_of_a_cubic_table_is_not_8_to_21 stop ();
        end
        // In low area only the renderer has a product to be multiplied in blocks.
        if (LOW_AREA != 0 && PLAIN_MULTIPLIER != 0 && FOURIER == 0) begin : guard_22
            dac_sequencer_PLAIN_MULTIPLIER_has_no_use_in_LOW_AREA_without_FOURIER stop ();
        end
        if (FOURIER != 0 && X_INTERPOLATED == 0 && Y_INTERPOLATED == 0) begin : guard_23
            dac_sequencer_FOURIER_renders_no_direct_table stop ();
        end
        if (FOURIER != 0 && HARMONICS >= 1 << (LONGER_BITS - 1)) begin : guard_24
            dac_sequencer_HARMONICS_is_not_less_than_half_of_the_longer_table stop ();
        end
        if (SLOW_PART < 0 || SLOW_PART > 1) begin : guard_25
            dac_sequencer_SLOW_PART_is_not_0_to_1 stop ();
        end
        if (SLOW_PART != 0 && (LOW_AREA == 0 || FOURIER != 0)) begin : guard_26
            dac_sequencer_SLOW_PART_needs_LOW_AREA_and_has_no_FOURIER stop ();
        end
        if (SLOW_PART != 0 && (X_INTERPOLATED == 0 || Y_INTERPOLATED == 0)) begin : guard_27
            dac_sequencer_SLOW_PART_plays_no_direct_table stop ();
        end
        if (SLOW_PART != 0 && (X_WORD_BITS > 21 || Y_WORD_BITS > 21)) begin : guard_28
            dac_sequencer_X_or_Y_WORD_BITS_with_SLOW_PART_are_not_8_to_21 stop ();
        end
        if (SLOW_PART != 0 && (X_INDEX_BITS > 14 || Y_INDEX_BITS > 14)) begin : guard_29
            dac_sequencer_X_or_Y_INDEX_BITS_with_SLOW_PART_are_more_than_14 stop ();
        end
        if (ALTERNATE < 0 || ALTERNATE > 1) begin : guard_32
            dac_sequencer_ALTERNATE_is_not_0_to_1 stop ();
        end
        if (ALTERNATE != 0 && (LOW_AREA != 0 || PLAIN_MULTIPLIER != 0 || FOURIER != 0 || SHAPING != 0)) begin : guard_33
            dac_sequencer_ALTERNATE_has_no_LOW_AREA_PLAIN_MULTIPLIER_FOURIER_or_SHAPING stop ();
        end
        if (ALTERNATE != 0 && SPLINE != 0) begin : guard_34
            dac_sequencer_ALTERNATE_plays_no_cubic_table stop ();
        end
        if (ALTERNATE != 0 && X_WORD_BITS != Y_WORD_BITS) begin : guard_35
            dac_sequencer_X_and_Y_WORD_BITS_with_ALTERNATE_are_not_the_same stop ();
        end
        // The half that rounds lies above the low word of the offset.
        if (ALTERNATE != 0 && (X_WORD_BITS > 21 ? 25 : X_WORD_BITS + 4) < DAC_BITS + 3) begin : guard_36
            dac_sequencer_X_WORD_BITS_with_ALTERNATE_are_less_than_DAC_BITS_takes stop ();
        end
        if (PIXEL_INDEX_BITS != 0 && (PIXEL_INDEX_BITS < 2 || PIXEL_INDEX_BITS > 16)) begin : guard_37
            dac_sequencer_PIXEL_INDEX_BITS_is_not_0_or_2_to_16 stop ();
        end
        if (PIXEL_INDEX_BITS != 0 && SLOW_PART != 0) begin : guard_38
            dac_sequencer_PIXEL_INDEX_BITS_has_no_SLOW_PART stop ();
        end
        if (SLOW_PART != 0 && (SLOW_INDEX_BITS < 3 || SLOW_INDEX_BITS > 14)) begin : guard_30
            dac_sequencer_SLOW_INDEX_BITS_is_not_3_to_14 stop ();
        end
    endgenerate

    // Writes go to the idle bank, one clock late. A commit is as late, so that it never overtakes a write.
    wire idle_writable, rendered, rendering, unrendered, slow_exists, slow_fits, checking, misfilled;
    reg host_write, host_commit, scan_written;
    initial begin
        host_write = 0;
        host_commit = 0;
        scan_written = 0;
    end
    // A write to a place that does not exist is refused: cut to the bits of a memory, its address would be another one.
    wire exists =
        write_region == PROGRAM ? write_address < PROGRAM_WORDS :
        write_region == X_TABLE ? write_address >> X_INDEX_BITS == 0 :
        write_region == Y_TABLE ? write_address >> Y_INDEX_BITS == 0 :
        slow_exists ||
        (PIXEL_INDEX_BITS != 0 && write_region == PIXEL_TICKS && write_address >> PIXEL_INDEX_BITS == 0) ||
        (FOURIER != 0 && (write_region == X_FOURIER || write_region == Y_FOURIER) && write_address <= LAST_FOURIER);
    wire accepted_write = write && writable && exists;
    reg scan_write, x_write, y_write;
    initial begin
        scan_write = 1'b0;
        x_write = 1'b0;
        y_write = 1'b0;
    end
    reg [2:0] region;
    initial region = 0;
    reg [15:0] address;
    initial address = 0;
    reg [31:0] data;
    initial data = 0;
    // A commit waits until the words just before it have been compared: whether windows have ticks for the pixels.
    wire waits = host_commit && (scan_write || scan_written);
    wire commits = host_commit && !scan_write && !scan_written;
    assign writable = !checking && idle_writable && !rendering && !host_commit;
    initial refused = 1'b0;
    always @(posedge clock) begin
        host_write <= accepted_write;
        scan_write <= accepted_write && write_region == PROGRAM && write_address[15:4] == SCAN_PAGE;
        x_write <= accepted_write && write_region == PROGRAM && write_address[15:4] == X_PAGE;
        y_write <= accepted_write && write_region == PROGRAM && write_address[15:4] == Y_PAGE;
        scan_written <= scan_write;
        host_commit <= ((commit && writable) || waits) && !withdraw && !reset;
        region <= write_region;
        address <= write_address;
        data <= write_data;
        if ((write && !(writable && exists)) || (commits && !fits) || misfilled || unrendered)
            refused <= 1'b1;
        else if (clear_faults || reset)
            refused <= 1'b0;
    end
    wire x_table_write, y_table_write;
    wire [15:0] table_address;
    wire [23:0] table_data;
    wire unused_bits = &{table_address, table_data};  // upper bits, unused for short tables and words

    // A program with a word that does not fit its register is not committed, nor is a part of a program, nor one with
    // more pixels than ticks of a window.
    wire words_fit, whole, pixels_fit;
    wire fits = words_fit && whole && slow_fits && pixels_fit;
    wire sound_commit;  // later where a table of pixels has to be read
    dac_fit #(
        .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .TICK_BITS(TICK_BITS),
        .LINE_BITS(LINE_BITS), .X_PERIOD_BITS(X_PERIOD_BITS), .Y_PERIOD_BITS(PERIOD_BITS),
        .HARMONICS(FOURIER ? HARMONICS : 0), .SHAPING(SHAPING)
    ) fit (
        .clock(clock), .data(write_data), .address(write_address[3:0]), .scan_write(scan_write), .x_write(x_write),
        .y_write(y_write), .discard(reset || withdraw), .fits(words_fit)
    );

    wire bank, loaded, take, drained;
    dac_bank banks (
        .clock(clock), .reset(reset), .commit(rendered), .withdraw(withdraw), .take(take), .drained(drained),
        .bank(bank), .committed(committed), .loaded(loaded), .writable(idle_writable)
    );

    dac_whole #(
        .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .Y_INTERPOLATED(Y_INTERPOLATED),
        .Y_INDEX_BITS(Y_INDEX_BITS), .HARMONICS(FOURIER ? HARMONICS : 0)
    ) parts (
        .clock(clock), .write(accepted_write), .region(write_region), .address(write_address), .data(write_data),
        .take(take), .whole(whole)
    );

    // The mode of a commit, for its program to be taken by.
    wire keep, at_frame, same_frame;
    assign can_keep = COMMIT_MODES != 0 && same_frame;
    generate
        if (COMMIT_MODES) begin : modes
            localparam [1:0] KEEP = 2'd1, FRAME = 2'd2;
            reg [1:0] mode;
            initial mode = 2'd0;
            always @(posedge clock) if (commit && writable) mode <= commit_mode;
            assign keep = mode == KEEP;
            assign at_frame = mode == FRAME;
        end else begin : one_mode
            assign {keep, at_frame} = 2'b00;
            wire unused_mode = &commit_mode;
        end
    endgenerate
    // With SLOW_PART a trigger may wait for its line, and so may a commit; a tick that begins a line may be too early.
    wire start, late, prepared, preparing;

    wire accepted_tick = tick && !busy;
    wire due;
    wire tick_0, load_0, runs_0, begins_0, line_0, frame_0, y_advance_0;
    wire [TICK_BITS-1:0] tick_number;
    wire [LINE_BITS-1:0] line_number;
    dac_scan #(.TICK_BITS(TICK_BITS), .LINE_BITS(LINE_BITS), .FRAME_BITS(16)) scan (
        .clock(clock), .reset(reset), .write(scan_write), .write_address(address[3:0]), .write_data(data),
        .tick(accepted_tick), .arm(arm), .arm_frames(arm_frames), .trigger(start), .park(park),
        .committed(committed), .withdraw(withdraw), .keep(keep), .at_frame(at_frame), .loaded(loaded),
        .can_keep(same_frame), .take(take), .armed(armed), .running(running), .due(due),
        .tick_out(tick_0), .load(load_0), .runs(runs_0), .begins(begins_0), .line(line_0), .frame(frame_0),
        .y_advance(y_advance_0), .tick_number(tick_number), .line_number(line_number)
    );

    // The request to clear faults takes effect with the next tick.
    reg clear_waits, clears_0;
    initial begin
        clear_waits = 0;
        clears_0 = 0;
    end
    always @(posedge clock) begin
        clear_waits <= clear_faults || reset || (clear_waits && !accepted_tick);
        if (accepted_tick) clears_0 <= clear_waits;
    end

    wire line_3, frame_3, pixel_3, backward_3, images_3;
    dac_markers #(
        .TICK_BITS(TICK_BITS), .LINE_BITS(LINE_BITS), .COMMIT_MODES(COMMIT_MODES), .PIXEL_INDEX_BITS(PIXEL_INDEX_BITS)
    ) markers (
        .clock(clock), .write(scan_write), .write_address(address[3:0]), .write_data(data), .take(take), .load(load_0),
        .tick(tick_0), .runs(runs_0), .begins(begins_0), .line(line_0), .frame(frame_0), .tick_number(tick_number),
        .line_number(line_number), .line_marker(line_3), .frame_marker(frame_3), .pixel_marker(pixel_3),
        .backward_marker(backward_3), .images(images_3), .pixels_fit(pixels_fit),
        .table_write(host_write && region == PIXEL_TICKS), .table_address(address), .discard(reset || withdraw),
        .commit(commits && fits), .bank(bank), .accepted(sound_commit), .checking(checking), .refused(misfilled)
    );

    wire done, x_reached, y_reached, x_clamped, y_clamped, overrun;
    wire runs_done, begins_done, swapped_done, clears_done;
    wire line_done, frame_done, pixel_done, backward_done, images_done;
    wire [DAC_BITS-1:0] x, y;

    generate
        if (LOW_AREA) begin : low_area
            wire x_done, y_done;
            reg works;
            initial works = 1'b0;
            always @(posedge clock) works <= accepted_tick || (works && !done);
            assign busy = works || late;
            assign overrun = tick && busy;
            assign done = Y_INTERPOLATED == 3 ? y_done : x_done;  // a spline takes longer, the others take the same
            assign drained = done;
            // The flags hold until the next tick.
            reg runs, begins, swapped;
            always @(posedge clock)
                if (tick_0) begin
                    runs <= runs_0;
                    begins <= begins_0;
                    swapped <= load_0;
                end
            assign runs_done = runs;
            assign begins_done = begins;
            assign swapped_done = swapped;
            assign clears_done = clears_0;
            assign {line_done, frame_done, pixel_done, backward_done, images_done} =
                {line_3, frame_3, pixel_3, backward_3, images_3};
            wire unused = &{x_done, y_done};

            if (SLOW_PART) begin : slow_part
                dac_slow_fit #(
                    .X_INDEX_BITS(X_INDEX_BITS), .Y_INDEX_BITS(Y_INDEX_BITS), .SLOW_INDEX_BITS(SLOW_INDEX_BITS),
                    .LINE_BITS(LINE_BITS)
                ) slow_words (
                    .clock(clock), .write(accepted_write), .region(write_region), .address(write_address),
                    .data(write_data), .discard(reset || withdraw), .take(take), .exists(slow_exists),
                    .fits(slow_fits)
                );
                dac_slow_part #(
                    .DAC_BITS(DAC_BITS), .LINE_BITS(LINE_BITS), .SHAPING(SHAPING), .X_INTERPOLATED(X_INTERPOLATED),
                    .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS), .Y_INTERPOLATED(Y_INTERPOLATED),
                    .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .SLOW_INDEX_BITS(SLOW_INDEX_BITS),
                    .PERIOD_BITS(X_PERIOD_BITS), .X_POWER_UP_CODE(X_POWER_UP_CODE), .Y_POWER_UP_CODE(Y_POWER_UP_CODE)
                ) axes (
                    .clock(clock), .scan_write(scan_write), .x_write(x_write), .y_write(y_write),
                    .word_write(host_write), .region(region), .address(address), .data(data), .commit(sound_commit),
                    .keeps(keep && same_frame), .at_frame(at_frame), .discard(reset || withdraw), .take(take),
                    .bank(bank), .loaded(loaded), .committed(committed),
                    .prepared(prepared), .preparing(preparing), .arm(arm), .armed(armed), .trigger(trigger),
                    .park(park || reset), .running(running), .first(due), .start(start), .late(late), .tick(tick_0),
                    .load(load_0), .runs(runs_0), .begins(begins_0), .line(line_0), .line_number(line_number),
                    .x_done(x_done), .x(x), .x_reached(x_reached), .x_clamped(x_clamped), .y_done(y_done), .y(y),
                    .y_reached(y_reached), .y_clamped(y_clamped)
                );
                wire unused_here = &{x_table_write, y_table_write, y_advance_0, frame_0};
            end else begin : tables
                dac_axis_serial #(
                    .INTERPOLATED(X_INTERPOLATED), .INDEX_BITS(X_INDEX_BITS), .WORD_BITS(X_WORD_BITS),
                    .DAC_BITS(DAC_BITS), .PERIOD_BITS(X_PERIOD_BITS), .SHAPING(SHAPING), .POWER_UP_CODE(X_POWER_UP_CODE)
                ) x_axis (
                    .clock(clock), .write(x_write), .write_address(address[3:0]), .write_data(data),
                    .table_write(x_table_write), .table_address(table_address[X_INDEX_BITS-1:0]),
                    .table_data(table_data[X_WORD_BITS-1:0]), .bank(bank), .loaded(loaded), .tick(tick_0),
                    .restart(line_0), .begins(begins_0), .advance(runs_0), .running(runs), .done(x_done), .code(x),
                    .reached(x_reached), .clamped(x_clamped)
                );
                dac_axis_serial #(
                    .INTERPOLATED(Y_INTERPOLATED), .INDEX_BITS(Y_INDEX_BITS), .WORD_BITS(Y_WORD_BITS),
                    .DAC_BITS(DAC_BITS), .PERIOD_BITS(PERIOD_BITS), .SHAPING(SHAPING), .POWER_UP_CODE(Y_POWER_UP_CODE)
                ) y_axis (
                    .clock(clock), .write(y_write), .write_address(address[3:0]), .write_data(data),
                    .table_write(y_table_write), .table_address(table_address[Y_INDEX_BITS-1:0]),
                    .table_data(table_data[Y_WORD_BITS-1:0]), .bank(bank), .loaded(loaded), .tick(tick_0),
                    .restart(frame_0), .begins(begins_0),
                    .advance(y_advance_0), .running(runs), .done(y_done), .code(y), .reached(y_reached),
                    .clamped(y_clamped)
                );
            end
        end
        if (ALTERNATE) begin : alternating
            localparam FLAGS_AT = 46;  // clocks from a tick's flags to its codes
            reg [5:0] at;  // counts clocks
            reg works;
            initial begin
                at = 6'd0;
                works = 1'b0;
            end
            always @(posedge clock) begin
                at <= at + 1;
                works <= accepted_tick;
            end
            assign busy = works;
            assign overrun = tick && busy;
            assign drained = swapped_done;

            dac_pair_delay #(.BITS(5), .CLOCKS(FLAGS_AT)) with_tick (
                .clock(clock), .at(at), .in({tick_0, runs_0, begins_0, load_0, clears_0}),
                .out({done, runs_done, begins_done, swapped_done, clears_done})
            );
            wire line_5, frame_5, backward_5, images_5;  // together with the pixel
            dac_delay #(.BITS(4), .CLOCKS(PIXELS_AT - MARKERS_AT)) to_pixels (
                .clock(clock), .in({line_3, frame_3, backward_3, images_3}),
                .out({line_5, frame_5, backward_5, images_5})
            );
            dac_pair_delay #(.BITS(5), .CLOCKS(FLAGS_AT - PIXELS_AT)) with_markers (
                .clock(clock), .at(at), .in({line_5, frame_5, pixel_3, backward_5, images_5}),
                .out({line_done, frame_done, pixel_done, backward_done, images_done})
            );
            wire reached, clamped;
            assign {x_reached, y_reached, x_clamped, y_clamped} = {reached, 1'b1, clamped, 1'b0};
            dac_pair #(
                .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS),
                .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .WORD_BITS(X_WORD_BITS),
                .PERIOD_BITS(PERIOD_BITS > X_PERIOD_BITS ? PERIOD_BITS : X_PERIOD_BITS),
                .X_POWER_UP_CODE(X_POWER_UP_CODE), .Y_POWER_UP_CODE(Y_POWER_UP_CODE)
            ) axes (
                .clock(clock), .at(at), .x_write(x_write), .y_write(y_write), .write_address(address[3:0]),
                .write_data(data), .x_table_write(x_table_write), .y_table_write(y_table_write),
                .table_address(table_address[LONGER_BITS-1:0]), .table_data(table_data[X_WORD_BITS-1:0]), .bank(bank),
                .tick(tick_0), .load(load_0), .runs(runs_0), .line(line_0), .frame(frame_0), .y_advance(y_advance_0),
                .reached(reached), .clamped(clamped), .x(x), .y(y)
            );
        end
        if (!LOW_AREA && !ALTERNATE) begin : pipelined
            // Bit i is the flag of the tick i clocks ago.
            reg [LATENCY-1:0] ticks, loads, runnings;
            initial begin
                ticks = 0;
                loads = 0;
                runnings = 0;
            end
            wire [LATENCY:0] ticks_now = {ticks, tick_0};
            wire [LATENCY:0] loads_now = {loads, load_0};
            wire [LATENCY:0] runnings_now = {runnings, runs_0};
            always @(posedge clock) begin
                ticks <= ticks_now[LATENCY-1:0];
                loads <= loads_now[LATENCY-1:0];
                runnings <= runnings_now[LATENCY-1:0];
            end
            if (SPACING != 1) begin : spaced
                reg [SPACING-3:0] recent;  // ticks; bit i: i + 1 clocks ago
                reg works;
                initial begin
                    recent = 0;
                    works = 1'b0;
                end
                always @(posedge clock) begin
                    recent <= {recent[SPACING-4:0], accepted_tick};
                    works <= accepted_tick || recent != 0;
                end
                assign busy = works;
            end else begin : any_clock
                assign busy = 1'b0;
            end
            assign overrun = tick && busy;
            assign done = ticks_now[LATENCY];
            assign runs_done = runnings_now[LATENCY];
            assign swapped_done = loads_now[LATENCY];
            assign drained = loads_now[LATENCY];

            wire begins_shaping;
            dac_delay #(.BITS(1), .CLOCKS(LATENCY)) with_tick (.clock(clock), .in(clears_0), .out(clears_done));
            dac_delay #(.BITS(1), .CLOCKS(LATENCY - 11)) to_shapers (
                .clock(clock), .in(begins_0), .out(begins_shaping)
            );
            dac_delay #(.BITS(1), .CLOCKS(11)) from_shapers (
                .clock(clock), .in(begins_shaping), .out(begins_done)
            );
            dac_delay #(.BITS(4), .CLOCKS(LATENCY - MARKERS_AT)) with_markers (
                .clock(clock), .in({line_3, frame_3, backward_3, images_3}),
                .out({line_done, frame_done, backward_done, images_done})
            );
            dac_delay #(.BITS(1), .CLOCKS(LATENCY - PIXELS_AT)) with_pixels (
                .clock(clock), .in(pixel_3), .out(pixel_done)
            );
            dac_axis #(
                .INTERPOLATED(X_INTERPOLATED), .INDEX_BITS(X_INDEX_BITS), .WORD_BITS(X_WORD_BITS), .DAC_BITS(DAC_BITS),
                .PERIOD_BITS(X_PERIOD_BITS), .PLAIN_MULTIPLIER(PLAIN_MULTIPLIER), .SHAPING(SHAPING),
                .SPLINE(SPLINE), .POWER_UP_CODE(X_POWER_UP_CODE)
            ) x_axis (
                .clock(clock), .write(x_write), .write_address(address[3:0]), .table_write(x_table_write),
                .table_address(table_address[X_INDEX_BITS-1:0]), .write_data(data),
                .table_data(table_data[X_WORD_BITS-1:0]),
                .take(take), .begins(begins_shaping), .ticks(ticks_now[LATENCY-4:0]), .loads(loads_now[LATENCY-4:0]),
                .runnings(runnings_now[LATENCY-4:0]),
                .bank(bank), .restart(line_0), .advance(runs_0), .code(x), .reached(x_reached), .clamped(x_clamped)
            );
            dac_axis #(
                .INTERPOLATED(Y_INTERPOLATED), .INDEX_BITS(Y_INDEX_BITS), .WORD_BITS(Y_WORD_BITS), .DAC_BITS(DAC_BITS),
                .PERIOD_BITS(PERIOD_BITS), .PLAIN_MULTIPLIER(PLAIN_MULTIPLIER), .SHAPING(SHAPING),
                .SPLINE(SPLINE), .POWER_UP_CODE(Y_POWER_UP_CODE)
            ) y_axis (
                .clock(clock), .write(y_write), .write_address(address[3:0]), .table_write(y_table_write),
                .table_address(table_address[Y_INDEX_BITS-1:0]), .write_data(data),
                .table_data(table_data[Y_WORD_BITS-1:0]),
                .take(take), .begins(begins_shaping), .ticks(ticks_now[LATENCY-4:0]), .loads(loads_now[LATENCY-4:0]),
                .runnings(runnings_now[LATENCY-4:0]),
                .bank(bank), .restart(frame_0), .advance(y_advance_0), .code(y), .reached(y_reached),
                .clamped(y_clamped)
            );
        end
    endgenerate

    generate
        if (SLOW_PART == 0) begin : straight
            assign {start, late, prepared, preparing} = {trigger, 1'b0, sound_commit, 1'b0};
            assign {slow_exists, slow_fits} = 2'b01;
            wire unused = &{due, late};
        end
    endgenerate

    dac_verdict #(
        .DAC_BITS(DAC_BITS), .COUNT_BITS(COUNT_BITS), .X_POWER_UP_CODE(X_POWER_UP_CODE),
        .Y_POWER_UP_CODE(Y_POWER_UP_CODE)
    ) verdict (
        .clock(clock), .tick(done), .runs(runs_done), .begins(begins_done), .swapped(swapped_done),
        .clears(clears_done),
        .line(line_done), .frame(frame_done), .pixel(pixel_done), .backward(backward_done), .images(images_done),
        .x(x), .y(y), .reached(x_reached && y_reached), .clamped(x_clamped || y_clamped), .overrun(overrun),
        .underrun(underrun), .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(line_marker),
        .frame_marker(frame_marker), .pixel_marker(pixel_marker), .backward_marker(backward_marker),
        .valid_marker(valid_marker), .swapped_marker(swapped_marker), .playing(playing), .parked(parked),
        .faults(faults),
        .fault_counts(fault_counts)
    );

    generate
        if (FOURIER) begin : fourier
            wire x_rendered, y_rendered;
            wire [15:0] rendered_address;
            wire [23:0] rendered_data;
            dac_render #(
                .X_INDEX_BITS(X_INDEX_BITS), .Y_INDEX_BITS(Y_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
                .Y_WORD_BITS(Y_WORD_BITS), .HARMONICS(HARMONICS), .SINE_FILE(SINE_FILE), .MULTIPLIER(PLAIN_MULTIPLIER)
            ) render (
                .clock(clock), .cancel(reset || withdraw),
                .write_x_harmonics(x_write && address[3:0] == AXIS_HARMONICS),
                .write_y_harmonics(y_write && address[3:0] == AXIS_HARMONICS),
                .write_x_word(host_write && region == X_FOURIER), .write_y_word(host_write && region == Y_FOURIER),
                .write_address(address[10:0]), .write_data(data), .commit(prepared), .rendered(rendered),
                .failed(unrendered), .rendering(rendering), .x_write(x_rendered), .y_write(y_rendered),
                .address(rendered_address), .data(rendered_data)
            );
            assign x_table_write = x_rendered || (host_write && region == X_TABLE);
            assign y_table_write = y_rendered || (host_write && region == Y_TABLE);
            assign table_address = rendering ? rendered_address : address;
            assign table_data = rendering ? rendered_data : data[23:0];
            wire unused_preparing = preparing;
        end else begin : uploaded
            assign rendered = prepared;
            assign rendering = preparing;
            assign unrendered = 1'b0;
            assign x_table_write = host_write && region == X_TABLE;
            assign y_table_write = host_write && region == Y_TABLE;
            assign table_address = address;
            assign table_data = data[23:0];
            wire unused_parameters = &{X_FOURIER, Y_FOURIER, AXIS_HARMONICS, LAST_FOURIER, SINE_FILE};
        end
    endgenerate
endmodule

`default_nettype wire
