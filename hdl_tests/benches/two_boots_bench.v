`default_nettype none

// Bench of a dac_boot with another boot behind it: with PIXELS a dac_pixel_boot, as in the top of a scan with a table of
// pixels, else a dac_slow_boot, as in that of a scan at an angle. Plays a stimulus, an entry a clock, and writes what
// left on every clock. STIMULUS and CAPTURE are those of boot_bench.
module two_boots_bench #(
    parameter STIMULUS = "stimulus.hex",
    parameter CAPTURE = "capture.txt",
    parameter DEPTH = 1,
    parameter PROGRAM_FILE = "",
    parameter X_FILE = "",
    parameter Y_FILE = "",
    parameter SLOW_FILE = "",
    parameter PIXEL_FILE = "",
    parameter PIXELS = 0,
    parameter X_WORDS = 8,
    parameter Y_WORDS = 8,
    parameter X_WORD_BITS = 16,
    parameter Y_WORD_BITS = 16,
    parameter X_SLOW_WORDS = 8,
    parameter Y_SLOW_WORDS = 8,
    parameter X_KNOTS = 2,
    parameter Y_KNOTS = 2,
    parameter WORD_BITS = 18,
    parameter START_CLOCKS = 0
) (
    input  wire clock,
    output reg  done
);
    reg [63:0] stimulus [0:DEPTH-1];
    reg [63:0] entry;
    wire booting, table_missing, other_missing, rest_write, rest_commit, rest_writable, write, commit;
    wire [2:0] rest_region, region;
    wire [15:0] rest_address, address;
    wire [31:0] rest_data, data;
    wire missing = table_missing || other_missing;
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
        .PROGRAM_FILE(PROGRAM_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE), .X_WORDS(X_WORDS), .Y_WORDS(Y_WORDS),
        .X_WORD_BITS(X_WORD_BITS), .Y_WORD_BITS(Y_WORD_BITS), .START_CLOCKS(START_CLOCKS)
    ) boot (
        .clock(clock), .reset(entry[54]), .host_write(entry[52]), .host_region(entry[50:48]),
        .host_address(entry[47:32]), .host_data(entry[31:0]), .host_commit(entry[51]), .writable(rest_writable),
        .write(rest_write), .write_region(rest_region), .write_address(rest_address), .write_data(rest_data),
        .commit(rest_commit), .starting(), .booting(booting), .missing(table_missing)
    );
    generate if (PIXELS != 0) begin : pixels
        dac_pixel_boot #(
            .PIXEL_FILE(PIXEL_FILE), .PIXELS(PIXELS), .START_CLOCKS(START_CLOCKS)
        ) boot (
            .clock(clock), .reset(entry[54]), .boot_write(rest_write), .boot_region(rest_region),
            .boot_address(rest_address), .boot_data(rest_data), .boot_commit(rest_commit), .boot_writable(rest_writable),
            .writable(entry[53]), .write(write), .write_region(region), .write_address(address), .write_data(data),
            .commit(commit), .missing(other_missing)
        );
    end else begin : slow_parts
        dac_slow_boot #(
            .SLOW_FILE(SLOW_FILE), .X_TABLE_WORDS(X_WORDS), .X_SLOW_WORDS(X_SLOW_WORDS), .X_KNOTS(X_KNOTS), .Y_TABLE_WORDS(Y_WORDS),
            .Y_SLOW_WORDS(Y_SLOW_WORDS), .Y_KNOTS(Y_KNOTS), .WORD_BITS(WORD_BITS), .START_CLOCKS(START_CLOCKS)
        ) boot (
            .clock(clock), .reset(entry[54]), .boot_write(rest_write), .boot_region(rest_region),
            .boot_address(rest_address), .boot_data(rest_data), .boot_commit(rest_commit), .boot_writable(rest_writable),
            .writable(entry[53]), .write(write), .write_region(region), .write_address(address), .write_data(data),
            .commit(commit), .missing(other_missing)
        );
    end endgenerate
endmodule

`default_nettype wire
