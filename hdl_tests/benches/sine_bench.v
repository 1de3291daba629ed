`default_nettype none

// Bench of a dac_sequencer that renders, and whose sine may be missing: a program with a harmonic on each axis that
// asks for one is written and committed; whether it was taken for good, and whether a refusal was said.
module sine_bench #(
    parameter SINE_FILE = "",
    parameter MULTIPLIER = 0,
    parameter [0:0] X_HARMONICS = 1,
    parameter [0:0] Y_HARMONICS = 1
) (
    input  wire clock,
    output wire committed,
    output wire refused,
    output reg  ended
);
    reg [11:0] clocks;
    initial clocks = 12'd0;
    initial ended = 1'b0;
    always @(posedge clock) begin
        clocks <= clocks + 12'd1;
        if (clocks == 12'd1300) ended <= 1'b1;
    end
    reg [5:0] address;
    reg [31:0] word;
    always @*
        case (clocks)
            12'd1: {address, word} = {6'd0, 32'd8};
            12'd2: {address, word} = {6'd1, 32'd1};
            12'd3: {address, word} = {6'd26, 31'd0, X_HARMONICS};
            default: {address, word} = {6'd42, 31'd0, Y_HARMONICS};
        endcase
    dac_sequencer #(
        .X_INDEX_BITS(4), .Y_INDEX_BITS(3), .FOURIER(1), .HARMONICS(1), .PLAIN_MULTIPLIER(MULTIPLIER),
        .SINE_FILE(SINE_FILE)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(clocks >= 12'd1 && clocks <= 12'd4), .write_region(3'd0),
        .write_address({10'd0, address}), .write_data(word), .writable(), .refused(refused), .commit(clocks == 12'd5),
        .withdraw(1'b0), .committed(committed), .arm(1'b0), .arm_frames(16'd0), .trigger(1'b0), .park(1'b0),
        .clear_faults(1'b0), .armed(), .running(), .tick(1'b0), .underrun(1'b0), .busy(), .strobe(), .x_code(),
        .y_code(), .line_marker(), .frame_marker(), .pixel_marker(), .backward_marker(), .valid_marker(),
        .swapped_marker(), .playing(), .parked(), .faults(), .fault_counts()
    );
endmodule

`default_nettype wire
