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
        if (clocks == 12'd1400) ended <= 1'b1;
    end
    // A whole program: 48 words of registers, 16 and 8 of tables, 3 and 3 Fourier words; all but four of them 0.
    reg [2:0] region;
    reg [11:0] address;
    reg [31:0] word;
    always @* begin
        if (clocks < 12'd50) {region, address} = {3'd0, clocks - 12'd1};
        else if (clocks < 12'd66) {region, address} = {3'd1, clocks - 12'd50};
        else if (clocks < 12'd74) {region, address} = {3'd2, clocks - 12'd66};
        else if (clocks < 12'd77) {region, address} = {3'd3, clocks - 12'd74};
        else {region, address} = {3'd4, clocks - 12'd77};
        case (clocks)
            12'd1: word = 32'd8;
            12'd2: word = 32'd1;
            12'd27: word = {31'd0, X_HARMONICS};
            12'd43: word = {31'd0, Y_HARMONICS};
            default: word = 32'd0;
        endcase
    end
    dac_sequencer #(
        .X_INDEX_BITS(4), .Y_INDEX_BITS(3), .FOURIER(1), .HARMONICS(1), .PLAIN_MULTIPLIER(MULTIPLIER),
        .SINE_FILE(SINE_FILE)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(clocks >= 12'd1 && clocks < 12'd80 && clocks != 12'd49), .write_region(region),
        .write_address({4'd0, address}), .write_data(word), .writable(), .refused(refused), .commit(clocks == 12'd80),
        .commit_mode(2'd0),
        .withdraw(1'b0), .committed(committed), .arm(1'b0), .arm_frames(16'd0), .trigger(1'b0), .park(1'b0),
        .clear_faults(1'b0), .armed(), .running(), .tick(1'b0), .underrun(1'b0), .busy(), .strobe(), .x_code(),
        .y_code(), .line_marker(), .frame_marker(), .pixel_marker(), .backward_marker(), .valid_marker(),
        .swapped_marker(), .playing(), .parked(), .faults(), .fault_counts()
    );
endmodule

`default_nettype wire
