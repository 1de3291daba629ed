`default_nettype none

// Bench of one dac_boot whose files may be missing: whether it committed, whether it said so, and when it has ended.
module missing_bench #(
    parameter PROGRAM_FILE = "",
    parameter X_FILE = "",
    parameter Y_FILE = "",
    parameter FOURIER = 0,
    parameter X_WORDS = 1,
    parameter Y_WORDS = 1,
    parameter X_WORD_BITS = 16,
    parameter Y_WORD_BITS = 16,
    parameter X_HARMONICS = 0,
    parameter Y_HARMONICS = 0,
    parameter START_CLOCKS = 0
) (
    input  wire clock,
    output reg  committed,
    output wire missing,
    output reg  ended
);
    wire commit, booting;
    initial committed = 1'b0;
    initial ended = 1'b0;
    always @(posedge clock) begin
        if (commit !== 1'b0) committed <= 1'b1;
        if (!booting) ended <= 1'b1;
    end
    dac_boot #(
        .PROGRAM_FILE(PROGRAM_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE), .FOURIER(FOURIER), .X_WORDS(X_WORDS),
        .Y_WORDS(Y_WORDS), .X_WORD_BITS(X_WORD_BITS), .Y_WORD_BITS(Y_WORD_BITS), .X_HARMONICS(X_HARMONICS),
        .Y_HARMONICS(Y_HARMONICS), .START_CLOCKS(START_CLOCKS)
    ) boot (
        .clock(clock), .reset(1'b0), .host_write(1'b0), .host_region(3'd0), .host_address(16'd0), .host_data(32'd0),
        .host_commit(1'b0), .writable(1'b1), .write(), .write_region(), .write_address(), .write_data(),
        .commit(commit), .starting(), .booting(booting), .missing(missing)
    );
endmodule

`default_nettype wire
