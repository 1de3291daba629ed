// The output z of soft_core.v: a second sequencer, whose x is z, with registers of its own on the same bus.
//
// It is part of the device where the scan of the build has z: soft_core.vh then has its constants, with the prefix
// SCAN_Z_. `done`, `failed` and `read_data` answer an access to its registers. soft_core_both.v keeps both sequencers
// on the same ticks.

`default_nettype none

module soft_core_z #(
    parameter CLOCKS_PER_TICK = 100,
    parameter COUNT_BITS = 16
) (
    input  wire        clock,
    input  wire        reset,
    input  wire        permit,
    // the bus
    input  wire        access,
    input  wire        write,
    input  wire [17:0] address,
    input  wire [3:0]  bytes,
    input  wire [31:0] data,
    output wire [31:0] read_data,
    output wire        done,
    output wire        failed,
    // requests to x and y, and what becomes of them
    input  wire        commit,
    input  wire        withdraw,
    input  wire        trigger,
    input  wire        park,
    output wire        xy_commits,
    output wire        xy_withdraws,
    output wire        xy_starts,
    output wire        xy_parks,
    // the sequencer of x and y
    input  wire        writable,
    input  wire        committed,
    input  wire        armed,
    input  wire        running,
    input  wire        strobe,
    input  wire        playing,
    input  wire [4:0]  markers,   // swapped, backward, pixel, frame, line
    output wire        committing,
    output wire        starting,
    output wire        tick,
    // z
    output wire        z_strobe,
    output wire        z_data,
    output reg  [15:0] line_number,
    output reg  [31:0] swaps,
    output wire        image,     // z is where it should be, or rests
    output wire        fault
);
    `include "soft_core.vh"

    wire z_commit, z_withdraw, z_trigger, z_park, clear_faults, arm;
    wire z_commits, z_withdraws, z_starts, z_parks, apart;
    wire host_write, z_writable, refused, z_committed, can_keep, z_armed, z_running, busy, missed;
    wire z_playing, parked, line, frame, pixel, backward, valid, swapped;
    wire [1:0] commit_mode;
    wire [2:0] region;
    wire [15:0] word_address, arm_frames;
    wire [31:0] word;
    wire [3:0] faults;
    wire [4*COUNT_BITS-1:0] fault_counts;
    dac_wishbone #(
        .DAC_BITS(SCAN_Z_X_DAC_BITS), .COUNT_BITS(COUNT_BITS), .X_INTERPOLATED(SCAN_Z_X_INTERPOLATED),
        .X_INDEX_BITS(SCAN_Z_X_INDEX_BITS), .X_WORD_BITS(SCAN_Z_X_TABLE_BITS),
        .Y_INTERPOLATED(SCAN_Z_Y_INTERPOLATED), .Y_INDEX_BITS(SCAN_Z_Y_INDEX_BITS),
        .Y_WORD_BITS(SCAN_Z_Y_TABLE_BITS), .COMMIT_MODES(1), .SLOW_PART(1), .SLOW_INDEX_BITS(SCAN_Z_SLOW_INDEX_BITS)
    ) registers (
        .clock(clock), .reset(reset), .wb_cyc_i(access), .wb_stb_i(access), .wb_we_i(write), .wb_adr_i(address),
        .wb_sel_i(bytes), .wb_dat_i(data), .wb_dat_o(read_data), .wb_ack_o(done), .wb_err_o(failed), .irq(),
        .write(host_write), .write_region(region), .write_address(word_address), .write_data(word),
        .writable(z_writable), .refused(refused), .commit(z_commit), .commit_mode(commit_mode),
        .withdraw(z_withdraw), .committed(z_committed), .can_keep(can_keep), .booting(1'b0), .missing(1'b0), .arm(arm),
        .arm_frames(arm_frames), .trigger(z_trigger), .park(z_park), .clear_faults(clear_faults), .armed(z_armed),
        .running(z_running), .busy(busy), .playing(z_playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );

    soft_core_both #(
        .CLOCKS_PER_TICK(CLOCKS_PER_TICK), .SLOW_PART(SCAN_SLOW_PART), .MARKERS(5)
    ) both (
        .clock(clock), .permit(permit), .commit(commit), .z_commit(z_commit), .withdraw(withdraw),
        .z_withdraw(z_withdraw), .trigger(trigger), .z_trigger(z_trigger), .park(park), .z_park(z_park),
        .xy_commits(xy_commits), .z_commits(z_commits), .xy_withdraws(xy_withdraws), .z_withdraws(z_withdraws),
        .xy_starts(xy_starts), .z_starts(z_starts), .xy_parks(xy_parks), .z_parks(z_parks), .writable(writable),
        .z_writable(z_writable), .committed(committed), .z_committed(z_committed), .armed(armed), .running(running),
        .z_running(z_running), .strobe(strobe), .z_strobe(z_strobe), .playing(playing), .z_playing(z_playing),
        .markers(markers), .z_markers({swapped, backward, pixel, frame, line}), .committing(committing),
        .starting(starting), .apart(apart), .tick(tick)
    );

    wire [SCAN_Z_X_DAC_BITS-1:0] z_code, rest_code;
    dac_sequencer #(
        .DAC_BITS(SCAN_Z_X_DAC_BITS), .COUNT_BITS(COUNT_BITS), .X_INTERPOLATED(SCAN_Z_X_INTERPOLATED),
        .X_INDEX_BITS(SCAN_Z_X_INDEX_BITS), .X_WORD_BITS(SCAN_Z_X_TABLE_BITS),
        .Y_INTERPOLATED(SCAN_Z_Y_INTERPOLATED), .Y_INDEX_BITS(SCAN_Z_Y_INDEX_BITS),
        .Y_WORD_BITS(SCAN_Z_Y_TABLE_BITS), .LOW_AREA(1), .COMMIT_MODES(1), .SLOW_PART(1),
        .SLOW_INDEX_BITS(SCAN_Z_SLOW_INDEX_BITS)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(host_write), .write_region(region), .write_address(word_address),
        .write_data(word), .writable(z_writable), .refused(refused), .commit(z_commits), .commit_mode(commit_mode),
        .withdraw(z_withdraws), .committed(z_committed), .can_keep(can_keep), .arm(arm), .arm_frames(arm_frames),
        .trigger(z_starts), .park(z_parks), .clear_faults(clear_faults), .armed(z_armed), .running(z_running),
        .tick(tick), .underrun(missed || apart), .busy(busy), .strobe(z_strobe), .x_code(z_code), .y_code(rest_code),
        .line_marker(line), .frame_marker(frame), .pixel_marker(pixel), .backward_marker(backward),
        .valid_marker(valid), .swapped_marker(swapped), .playing(z_playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );
    assign fault = faults != 4'd0 || refused;
    assign image = valid || !z_playing;

    initial line_number = 16'd0;
    initial swaps = 32'd0;
    always @(posedge clock) if (z_strobe) begin
        if (line || !z_playing) line_number <= frame || !z_playing ? 16'd0 : line_number + 16'd1;
        if (swapped) swaps <= swaps + 32'd1;
    end

    // The converter of z has clock, select and load of the others, which are sent on the same clocks.
    wire [15:0] z_word;
    dac_coding #(
        .BITS(SCAN_Z_X_DAC_BITS), .WORD_BITS(SCAN_Z_X_DAC_WORD_BITS),
        .TWOS_COMPLEMENT(SCAN_Z_X_DAC_TWOS_COMPLEMENT), .LEFT_ALIGNED(SCAN_Z_X_DAC_LEFT_ALIGNED)
    ) z_coding (.code(z_code), .word(z_word));
    dac_spi #(.WORD_BITS(16), .FRAME_BITS(16)) converter (
        .clock(clock), .reset(1'b0), .strobe(z_strobe), .x_word(z_word), .y_word(16'd0), .sclk(), .cs_x_n(),
        .cs_y_n(), .mosi_x(z_data), .mosi_y(), .ldac_n(), .busy(), .missed(missed)
    );

    // The reason of a refusal is the name of a module that does not exist.
    generate
        if (SCAN_Z_X_DAC_WORD_BITS != 16) begin : guard_0
            soft_core_serves_converters_with_words_of_16_bits stop ();
        end
        if (CLOCKS_PER_TICK < SCAN_Z_CLOCKS) begin : guard_1
            soft_core_CLOCKS_PER_TICK_is_less_than_z_takes stop ();
        end
    endgenerate
endmodule

`default_nettype wire
