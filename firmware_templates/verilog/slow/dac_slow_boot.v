// Loads the slow parts of a program at power-up, and then lets dac_boot load the rest of it and commit.
//
// It stands between dac_boot and the sequencer. SLOW_FILE is <name>_slow.mem of a build: of x and then of y the words
// of the second table, of the slow table, the gains and the ratios. Until they are written, `boot_writable` is low to
// dac_boot, whose `booting` therefore spans both; afterwards everything passes through. As in dac_boot, `missing` is
// high in simulation where the file does not have all of its words: withdraw while it is, so that nothing is committed.
// Give both modules the same `reset` and the same START_CLOCKS; dac_boot.v says what these are for.

`default_nettype none

module dac_slow_boot #(
    parameter SLOW_FILE = "",
    parameter X_TABLE_WORDS = 64,  // words of the second table of x, as many as its table has
    parameter X_SLOW_WORDS = 64,   // words of its slow table
    parameter X_KNOTS = 17,        // its gains, and its ratios
    parameter Y_TABLE_WORDS = 64,
    parameter Y_SLOW_WORDS = 64,
    parameter Y_KNOTS = 17,
    parameter WORD_BITS = 18,      // bits of a word in SLOW_FILE: 18, or those of a wider table
    parameter START_CLOCKS = 4096  // clocks after power-up before the first read
) (
    input  wire        clock,
    input  wire        reset,           // starts the boot again
    // from dac_boot
    input  wire        boot_write,
    input  wire [2:0]  boot_region,
    input  wire [15:0] boot_address,
    input  wire [31:0] boot_data,
    input  wire        boot_commit,
    output wire        boot_writable,
    // to the sequencer
    input  wire        writable,
    output wire        write,
    output wire [2:0]  write_region,
    output wire [15:0] write_address,
    output wire [31:0] write_data,
    output wire        commit,
    output reg         missing          // the file has not all of its words
);
    localparam X_WORDS = X_TABLE_WORDS + X_SLOW_WORDS + 2 * X_KNOTS;
    localparam WORDS = X_WORDS + Y_TABLE_WORDS + Y_SLOW_WORDS + 2 * Y_KNOTS;
    localparam ADDRESS_BITS = $clog2(WORDS);
    localparam [31:0] LAST = WORDS - 1;
    localparam [31:0] LAST_X_TABLE = X_TABLE_WORDS - 1, LAST_X_SLOW = X_SLOW_WORDS - 1, LAST_X_KNOT = X_KNOTS - 1;
    localparam [31:0] LAST_Y_TABLE = Y_TABLE_WORDS - 1, LAST_Y_SLOW = Y_SLOW_WORDS - 1, LAST_Y_KNOT = Y_KNOTS - 1;
    localparam [2:0] X_PARTS = 3'd5, Y_PARTS = 3'd6;
    localparam START_BITS = START_CLOCKS > 0 ? $clog2(START_CLOCKS + 1) : 1;
    localparam [31:0] START = START_CLOCKS;

    generate
        if (X_TABLE_WORDS < 8 || X_TABLE_WORDS > 16384) begin : guard_0
            dac_slow_boot_X_TABLE_WORDS_is_not_8_to_16384 stop ();
        end
        if (X_SLOW_WORDS < 8 || X_SLOW_WORDS > 16384) begin : guard_1
            dac_slow_boot_X_SLOW_WORDS_is_not_8_to_16384 stop ();
        end
        if (X_KNOTS < 2 || X_KNOTS > 65) begin : guard_2
            dac_slow_boot_X_KNOTS_is_not_2_to_65 stop ();
        end
        if (Y_TABLE_WORDS < 8 || Y_TABLE_WORDS > 16384) begin : guard_3
            dac_slow_boot_Y_TABLE_WORDS_is_not_8_to_16384 stop ();
        end
        if (Y_SLOW_WORDS < 8 || Y_SLOW_WORDS > 16384) begin : guard_4
            dac_slow_boot_Y_SLOW_WORDS_is_not_8_to_16384 stop ();
        end
        if (Y_KNOTS < 2 || Y_KNOTS > 65) begin : guard_5
            dac_slow_boot_Y_KNOTS_is_not_2_to_65 stop ();
        end
        if (WORD_BITS < 18 || WORD_BITS > 21) begin : guard_6
            dac_slow_boot_WORD_BITS_is_not_18_to_21 stop ();
        end
        if (START_CLOCKS < 0 || START_CLOCKS > 16777216) begin : guard_7
            dac_slow_boot_START_CLOCKS_is_not_0_to_16777216 stop ();
        end
        if (SLOW_FILE == "") begin : guard_8
            dac_slow_boot_SLOW_FILE_is_not_set stop ();
        end
    endgenerate

    // The bit above a word marks a memory that no file has filled, as in dac_boot.
    reg [WORD_BITS:0] words [0:WORDS-1];
`ifdef SYNTHESIS
    localparam SYNTHESISED = 1;
`else
    localparam SYNTHESISED = 0;
`endif
    initial begin
        if (SLOW_FILE == "" || !SYNTHESISED) words[WORDS-1] = {1'b1, {WORD_BITS{1'b0}}};
        if (SLOW_FILE != "") $readmemh(SLOW_FILE, words);
    end

    // A word is read on one clock and written on the next; both wait while the sequencer accepts no write.
    reg [START_BITS-1:0] waited;
    wire started = waited == START[START_BITS-1:0];
    reg [ADDRESS_BITS-1:0] read_at;
    reg reading, writing;
    reg [WORD_BITS:0] word;
    reg is_y;             // what the word is, and its address in it
    reg [1:0] part;
    reg [13:0] place;
    wire loading = reading || writing;
    wire now = writing && writable;
    wire [31:0] last_place = part[1] ? (is_y ? LAST_Y_KNOT : LAST_X_KNOT) :
                             part[0] ? (is_y ? LAST_Y_SLOW : LAST_X_SLOW) : (is_y ? LAST_Y_TABLE : LAST_X_TABLE);
    wire ends = place == last_place[13:0];

    initial begin
        waited = 0;
        read_at = 0;
        reading = 1'b1;
        writing = 1'b0;
        is_y = 1'b0;
        part = 2'd0;
        place = 14'd0;
        missing = 1'b0;
    end

    always @(posedge clock) begin
        if (!started) waited <= waited + 1'b1;
        if (writable) begin
            word <= words[read_at];
            writing <= reading && started;
        end
        if (reading && started && writable) begin
            read_at <= read_at + 1'b1;
            if (read_at == LAST[ADDRESS_BITS-1:0]) reading <= 1'b0;
        end
        if (now) begin
            place <= ends ? 14'd0 : place + 1'b1;
            if (ends) {is_y, part} <= {is_y, part} + 1'b1;
        end
        if (reset) begin
            read_at <= 0;
            reading <= 1'b1;
            writing <= 1'b0;
            is_y <= 1'b0;
            part <= 2'd0;
            place <= 14'd0;
        end
        missing <= !reset && (missing || (now && word[WORD_BITS]));
    end

    wire [WORD_BITS+31:0] wide = {{32{word[WORD_BITS-1]}}, word[WORD_BITS-1:0]};
    wire unused = &{START, LAST, last_place, wide};

    assign boot_writable = writable && !loading;
    assign write = loading ? now : boot_write;
    assign write_region = !loading ? boot_region : is_y ? Y_PARTS : X_PARTS;
    assign write_address = loading ? {part, place} : boot_address;
    assign write_data = loading ? wide[31:0] : boot_data;
    assign commit = !loading && boot_commit;
endmodule

`default_nettype wire
