// Whether the idle program is complete: a commit of a part of a program is refused. The registers of one program would
// otherwise play over the table of another, and as valid.
//
// Counted are the words that were written since the last swap, in any order: those of the program words, and of each
// axis those of its table, or its Fourier words where the program has harmonics. After a withdrawal or a reset what was
// written stays. The inputs are those of the sequencer's port, so that a word that is written on the clock of a commit
// counts.

`default_nettype none

module dac_whole #(
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter HARMONICS = 0     // 0: there is no renderer
) (
    input  wire        clock,
    input  wire        write,   // one that is accepted
    input  wire [2:0]  region,
    input  wire [15:0] address,
    input  wire [31:0] data,
    input  wire        take,    // from now on the idle registers and the idle table are of two programs
    output wire        whole    // with the write of the last clock
);
    localparam [2:0] PROGRAM = 3'd0, X_TABLE = 3'd1, Y_TABLE = 3'd2, X_FOURIER = 3'd3, Y_FOURIER = 3'd4;
    localparam [11:0] SCAN_PAGE = 12'd0, X_PAGE = 12'd1, Y_PAGE = 12'd2;
    localparam [3:0] SCAN_WORDS = 4'd14, AXIS_WORDS = 4'd12;
    // The three pages have 38 words: a count from here to 64 shows in one bit whether they are there.
    localparam [6:0] FIRST = 7'd26;

    wire [11:0] page = address[15:4];
    wire scan = page == SCAN_PAGE && address[3:0] < SCAN_WORDS;
    wire x = page == X_PAGE && address[3:0] < AXIS_WORDS;
    wire y = page == Y_PAGE && address[3:0] < AXIS_WORDS;
    wire program_write = write && region == PROGRAM;

    reg [6:0] count;
    initial count = FIRST;
    wire counts = program_write && (scan || x || y);
    always @(posedge clock)
        if (take) count <= FIRST;  // nothing is written on that clock
        else if (counts && !count[6]) count <= count + 1;

    wire x_whole, y_whole;
    dac_whole_table #(.INTERPOLATED(X_INTERPOLATED), .INDEX_BITS(X_INDEX_BITS), .HARMONICS(HARMONICS)) x_table (
        .clock(clock), .take(take), .write_program(program_write && x),
        .write_table(write && region == X_TABLE), .write_fourier(write && region == X_FOURIER),
        .address(address[3:0]), .data(data), .whole(x_whole)
    );
    dac_whole_table #(.INTERPOLATED(Y_INTERPOLATED), .INDEX_BITS(Y_INDEX_BITS), .HARMONICS(HARMONICS)) y_table (
        .clock(clock), .take(take), .write_program(program_write && y),
        .write_table(write && region == Y_TABLE), .write_fourier(write && region == Y_FOURIER),
        .address(address[3:0]), .data(data), .whole(y_whole)
    );
    assign whole = count[6] && x_whole && y_whole;
endmodule

`default_nettype wire
