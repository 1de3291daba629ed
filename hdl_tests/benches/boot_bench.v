`default_nettype none

// Bench of one dac_boot: plays a stimulus, an entry a clock, and writes what left on every clock.
//
// STIMULUS is read by $readmemh: words of 64 bits,
// {9'd0, reset, writable, host_write, host_commit, host_region[2:0], host_address[15:0], host_data[31:0]}.
// There is no reset but those of the stimulus: the initial values have to do. CAPTURE gets a line a clock, the levels
// just before the rising edge: {missing, booting, write, commit}, region, address, data, all in hexadecimal.
module boot_bench #(
    parameter STIMULUS = "stimulus.hex",
    parameter CAPTURE = "capture.txt",
    parameter DEPTH = 1,
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
    output reg  done
);
    reg [63:0] stimulus [0:DEPTH-1];
    reg [63:0] entry;
    wire write, commit, booting, missing;
    wire [2:0] region;
    wire [15:0] address;
    wire [31:0] data;
    integer at, capture;

    initial begin
        $readmemh(STIMULUS, stimulus);
        capture = $fopen(CAPTURE, "w");
        done = 1'b0;
        at = 1;
        entry = stimulus[0];
    end

    always @(posedge clock) if (!done) begin
        $fwrite(capture, "%h %h %h %h\n", {missing, booting, write, commit}, region, address, data);
        if (at == DEPTH) begin
            $fclose(capture);
            done <= 1'b1;
        end else
            entry <= stimulus[at];
        at <= at + 1;
    end

    dac_boot #(
        .PROGRAM_FILE(PROGRAM_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE), .FOURIER(FOURIER), .X_WORDS(X_WORDS),
        .Y_WORDS(Y_WORDS), .X_WORD_BITS(X_WORD_BITS), .Y_WORD_BITS(Y_WORD_BITS), .X_HARMONICS(X_HARMONICS),
        .Y_HARMONICS(Y_HARMONICS), .START_CLOCKS(START_CLOCKS)
    ) boot (
        .clock(clock), .reset(entry[54]), .host_write(entry[52]), .host_region(entry[50:48]),
        .host_address(entry[47:32]), .host_data(entry[31:0]), .host_commit(entry[51]), .writable(entry[53]),
        .write(write), .write_region(region), .write_address(address), .write_data(data), .commit(commit),
        .starting(), .booting(booting), .missing(missing)
    );
endmodule

`default_nettype wire
