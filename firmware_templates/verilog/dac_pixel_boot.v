// Loads the table of pixels of a program at power-up, and then lets dac_boot load the rest of it and commit.
//
// It stands between dac_boot and the sequencer. PIXEL_FILE is <name>_pixels.mem of a build: the ticks of each pixel of
// the forward window, then of the backward one. Until they are written, `boot_writable` is low to dac_boot, whose
// `booting` therefore spans both; afterwards everything passes through. As in dac_boot, `missing` is high in simulation
// where the file does not have all of its words: withdraw while it is, so that nothing is committed. Give both modules
// the same `reset` and the same START_CLOCKS; dac_boot.v says what these are for.

`default_nettype none

module dac_pixel_boot #(
    parameter PIXEL_FILE = "",
    parameter PIXELS = 64,         // of a window; the file has twice as many words
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
    localparam WORDS = 2 * PIXELS;
    localparam ADDRESS_BITS = $clog2(WORDS);
    localparam [31:0] LAST = WORDS - 1;
    localparam [2:0] PIXEL_TICKS = 3'd7;
    localparam START_BITS = START_CLOCKS > 0 ? $clog2(START_CLOCKS + 1) : 1;
    localparam [31:0] START = START_CLOCKS;

    generate
        if (PIXELS < 1 || PIXELS > 32768) begin : guard_0
            dac_pixel_boot_PIXELS_is_not_1_to_32768 stop ();
        end
        if (START_CLOCKS < 0 || START_CLOCKS > 16777216) begin : guard_1
            dac_pixel_boot_START_CLOCKS_is_not_0_to_16777216 stop ();
        end
        if (PIXEL_FILE == "") begin : guard_2
            dac_pixel_boot_PIXEL_FILE_is_not_set stop ();
        end
    endgenerate

    // The bit above a word marks a memory that no file has filled, as in dac_boot.
    reg [16:0] words [0:WORDS-1];
`ifdef SYNTHESIS
    localparam SYNTHESISED = 1;
`else
    localparam SYNTHESISED = 0;
`endif
    initial begin
        if (PIXEL_FILE == "" || !SYNTHESISED) words[WORDS-1] = {1'b1, 16'd0};
        if (PIXEL_FILE != "") $readmemh(PIXEL_FILE, words);
    end

    // A word is read on one clock and written on the next; both wait while the sequencer accepts no write.
    reg [START_BITS-1:0] waited;
    wire started = waited == START[START_BITS-1:0];
    reg [ADDRESS_BITS-1:0] read_at, place;
    reg reading, writing;
    reg [16:0] word;
    wire loading = reading || writing;
    wire now = writing && writable;

    initial begin
        waited = 0;
        read_at = 0;
        place = 0;
        reading = 1'b1;
        writing = 1'b0;
        missing = 1'b0;
    end

    always @(posedge clock) begin
        if (!started) waited <= waited + 1'b1;
        if (writable) begin
            word <= words[read_at];
            place <= read_at;
            writing <= reading && started;
        end
        if (reading && started && writable) begin
            read_at <= read_at + 1'b1;
            if (read_at == LAST[ADDRESS_BITS-1:0]) reading <= 1'b0;
        end
        if (reset) begin
            read_at <= 0;
            reading <= 1'b1;
            writing <= 1'b0;
        end
        missing <= !reset && (missing || (now && word[16]));
    end

    wire [ADDRESS_BITS+15:0] wide_place = {16'd0, place};
    wire unused = &{START, LAST, wide_place};

    assign boot_writable = writable && !loading;
    assign write = loading ? now : boot_write;
    assign write_region = loading ? PIXEL_TICKS : boot_region;
    assign write_address = loading ? wide_place[15:0] : boot_address;
    assign write_data = loading ? {16'd0, word[15:0]} : boot_data;
    assign commit = !loading && boot_commit;
endmodule

`default_nettype wire
