// dac_slow_boot, wherever the sequencer lets it wait and whenever it begins again: since the last reset it has written
// the first words of its file, in order, each once, sign-extended, to the part, region and address of its number. It
// writes one on every clock on which it may, from the first such clock after the start on. Until all are written
// dac_boot may not write and does not commit; afterwards everything passes through.
//
// Word n of the file is n * 79337 modulo 2^18, which is another one for each n. The tables are the shortest ones; y has
// a knot more than x.

`default_nettype none

module slow_boot_properties #(
    parameter START_CLOCKS = 2,
    parameter WAITS = 1  // 0: it is never reset and never waits, for counterexamples that are 40 words deep
) (
    input wire        clock,
    input wire        reset,
    input wire        boot_write,
    input wire [2:0]  boot_region,
    input wire [15:0] boot_address,
    input wire [31:0] boot_data,
    input wire        boot_commit,
    input wire        writable
);
    localparam TABLE_WORDS = 8, SLOW_WORDS = 8, X_KNOTS = 2, Y_KNOTS = 3;
    localparam X_WORDS = TABLE_WORDS + SLOW_WORDS + 2 * X_KNOTS;
    localparam WORDS = X_WORDS + TABLE_WORDS + SLOW_WORDS + 2 * Y_KNOTS;
    wire boot_writable, write, commit, missing;
    wire [2:0] write_region;
    wire [15:0] write_address;
    wire [31:0] write_data;
    dac_slow_boot #(
        .SLOW_FILE("words.mem"), .X_TABLE_WORDS(TABLE_WORDS), .X_SLOW_WORDS(SLOW_WORDS), .X_KNOTS(X_KNOTS),
        .Y_TABLE_WORDS(TABLE_WORDS), .Y_SLOW_WORDS(SLOW_WORDS), .Y_KNOTS(Y_KNOTS), .START_CLOCKS(START_CLOCKS)
    ) uut (
        .clock(clock), .reset(reset), .boot_write(boot_write), .boot_region(boot_region),
        .boot_address(boot_address), .boot_data(boot_data), .boot_commit(boot_commit), .boot_writable(boot_writable),
        .writable(writable), .write(write), .write_region(write_region), .write_address(write_address),
        .write_data(write_data), .commit(commit), .missing(missing)
    );

    always @* if (WAITS == 0) assume (writable && !reset);

    // How many words were written since power-up or the last reset, and whether the first one was read.
    reg [5:0] words;
    reg reads;
    reg [1:0] clocks;  // since power-up
    initial {words, reads, clocks} = 0;
    wire loads = words != WORDS;
    always @(posedge clock) begin
        if (clocks != START_CLOCKS) clocks <= clocks + 1;
        if (loads && write) words <= words + 1;
        if (writable && clocks == START_CLOCKS) reads <= 1;
        if (reset) {words, reads} <= 0;
    end

    // Where word n goes to.
    wire is_y = words >= X_WORDS;
    wire [5:0] at = words - (is_y ? X_WORDS : 0), knots = is_y ? Y_KNOTS : X_KNOTS;
    localparam GAINS = TABLE_WORDS + SLOW_WORDS;
    wire [15:0] address = at < TABLE_WORDS ? at : at < GAINS ? 16'h4000 + at - TABLE_WORDS :
                          at < GAINS + knots ? 16'h8000 + at - GAINS : 16'hC000 + at - GAINS - knots;
    wire signed [17:0] word = words * 18'd79337;
    wire signed [31:0] data = word;

    // The properties.
    always @* begin
        if (loads) begin
            assert (write == (reads && writable) && !boot_writable && !commit);
            if (write) assert (write_region == (is_y ? 6 : 5) && write_address == address && write_data == data);
        end else begin
            assert (write == boot_write && boot_writable == writable && commit == boot_commit);
            assert (write_region == boot_region && write_address == boot_address && write_data == boot_data);
        end
        assert (!missing);
    end
    always @* cover (!loads && write);

`ifndef PROPERTIES_ALONE
    // What makes them inductive.
    wire [1:0] uut__waited, uut__part;
    wire [5:0] uut__read_at;
    wire uut__reading, uut__writing, uut__is_y;
    wire [18:0] uut__word;
    wire [13:0] uut__place;
    always @* begin
        assert (words <= WORDS && uut__waited == clocks && clocks <= START_CLOCKS);
        assert (uut__writing == (reads && loads) && uut__reading == (words + uut__writing != WORDS));
        if (uut__reading) assert (uut__read_at == words + uut__writing);
        if (uut__writing) assert (uut__word == {1'b0, word});
        if (loads) assert (uut__is_y == is_y && {uut__part, uut__place} == address);
        if (!reads) assert (words == 0);
    end
`endif
endmodule

`default_nettype wire
