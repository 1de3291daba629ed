// What sequencer_properties, play_properties, writes_properties and pair_program_properties look at: the parameters and
// ports of a harness, and a small dac_sequencer. The host may do anything on any clock.

#(
    parameter PLAIN_MULTIPLIER = 1,
    parameter LOW_AREA = 0,
    parameter FOURIER = 0,
    parameter SHAPING = 0,
    parameter CUBIC = 0,  // 1: both tables
    parameter ALTERNATE = 0
) (
    input wire        clock,
    input wire        reset,
    input wire        write,
    input wire [2:0]  write_region,
    input wire [15:0] write_address,
    input wire [31:0] write_data,
    input wire        commit,
    input wire        withdraw,
    input wire        arm,
    input wire [15:0] arm_frames,
    input wire        trigger,
    input wire        park,
    input wire        clear_faults,
    input wire        tick,
    input wire        underrun
);
    wire writable, refused, committed, armed, running, busy, strobe, swapped_marker;
    wire line_marker, frame_marker, pixel_marker, backward_marker, valid_marker, playing, parked;
    wire [7:0] x_code, y_code;
    wire [3:0] faults;
    wire [4*2-1:0] fault_counts;

    dac_sequencer #(
        .DAC_BITS(8), .X_INDEX_BITS(3), .X_WORD_BITS(8), .Y_INDEX_BITS(3), .Y_WORD_BITS(8), .TICK_BITS(4),
        .LINE_BITS(2), .PERIOD_BITS(8), .COUNT_BITS(2), .LOW_AREA(LOW_AREA),
        .PLAIN_MULTIPLIER((LOW_AREA && !FOURIER) || ALTERNATE ? 0 : PLAIN_MULTIPLIER), .HARMONICS(3),
        .FOURIER(FOURIER), .SHAPING(SHAPING), .ALTERNATE(ALTERNATE), .X_INTERPOLATED(CUBIC ? 3 : 1), .Y_INTERPOLATED(CUBIC ? 3 : 1)
    ) uut (
        .clock(clock), .reset(reset), .write(write), .write_region(write_region), .write_address(write_address),
        .write_data(write_data), .writable(writable), .refused(refused), .commit(commit), .commit_mode(2'd0),
        .withdraw(withdraw),
        .committed(committed), .arm(arm), .arm_frames(arm_frames), .trigger(trigger), .park(park),
        .clear_faults(clear_faults), .armed(armed), .running(running), .tick(tick), .underrun(underrun), .busy(busy),
        .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(line_marker), .frame_marker(frame_marker),
        .pixel_marker(pixel_marker), .backward_marker(backward_marker), .valid_marker(valid_marker),
        .swapped_marker(swapped_marker), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );
