// What scan_properties and request_properties look at: dac_scan and dac_bank as dac_sequencer wires them. The parameters
// and ports of a harness, and these two. The host may do anything on any clock.

#(
    parameter TICK_BITS = 4,
    parameter LINE_BITS = 2,
    parameter FRAME_BITS = 3
) (
    input wire                  clock,
    input wire                  reset,
    input wire                  write,
    input wire [3:0]            write_address,
    input wire [31:0]           write_data,
    input wire                  commit,
    input wire [1:0]            commit_mode,  // 1 keep, 2 frame
    input wire                  withdraw,
    input wire                  arm,
    input wire [FRAME_BITS-1:0] arm_frames,
    input wire                  trigger,
    input wire                  park,
    input wire                  tick,
    input wire                  drained
);
    wire take, can_keep, committed, loaded, bank, writable, armed, running, tick_out, load, runs, begins, line, frame, y_advance;
    wire [TICK_BITS-1:0] tick_number;
    wire [LINE_BITS-1:0] line_number;
    reg [1:0] mode;  // of the commit
    initial mode = 0;
    always @(posedge clock) if (commit && writable) mode <= commit_mode;
    dac_bank banks (
        .clock(clock), .reset(reset), .commit(commit), .withdraw(withdraw), .take(take), .drained(drained),
        .bank(bank), .committed(committed), .loaded(loaded), .writable(writable)
    );
    dac_scan #(.TICK_BITS(TICK_BITS), .LINE_BITS(LINE_BITS), .FRAME_BITS(FRAME_BITS)) scan (
        .clock(clock), .reset(reset), .write(write && writable), .write_address(write_address), .write_data(write_data),
        .tick(tick), .arm(arm), .arm_frames(arm_frames), .trigger(trigger), .park(park), .committed(committed),
        .withdraw(withdraw), .keep(mode == 2'd1), .at_frame(mode == 2'd2), .loaded(loaded), .can_keep(can_keep),
        .take(take), .armed(armed), .running(running), .tick_out(tick_out), .load(load), .runs(runs),
        .begins(begins), .line(line), .frame(frame), .y_advance(y_advance), .tick_number(tick_number),
        .line_number(line_number)
    );
