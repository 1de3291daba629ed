// Plays the scan of annexin_200nm.vh: the arithmetic that turns an emitted table into codes, and nothing else.
//
//     tablegen build examples/annexin_200nm.toml -o build
//     iverilog -g2005 -Ibuild examples/verilog/play.v            (the .mem files are looked up where it runs)
//
// `play` is the fast axis of that scan; another axis is another instance of `play_axis` with other constants of the
// header. Slew guard, markers and the change of programs while they play are the business of a sequencer.

`default_nettype none

module play (
    input  wire        clock,
    input  wire        reset,
    input  wire        tick,   // one clock long, at the DAC's update rate; it may stay high
    output wire [23:0] code
);
    `include "annexin_200nm.vh"

    play_axis #(
        .TABLE_FILE(ANNEXIN_200NM_X_TABLE_FILE),
        .LENGTH(ANNEXIN_200NM_X_TABLE_LENGTH),
        .BITS(ANNEXIN_200NM_X_TABLE_BITS),
        .INTERPOLATED(ANNEXIN_200NM_X_INTERPOLATED),
        .INDEX_BITS(ANNEXIN_200NM_X_INDEX_BITS),
        .GUARD_BITS(ANNEXIN_200NM_X_GUARD_BITS),
        .PERIOD(ANNEXIN_200NM_X_PHASE_PERIOD),
        .STEP(ANNEXIN_200NM_X_PHASE_STEP),
        .REMAINDER(ANNEXIN_200NM_X_PHASE_REMAINDER),
        .HOLD(ANNEXIN_200NM_X_HOLD_TICKS),
        .GAIN_WORD(ANNEXIN_200NM_X_GAIN_WORD),
        .GAIN_Q(ANNEXIN_200NM_X_GAIN_Q),
        .OFFSET_WORD(ANNEXIN_200NM_X_OFFSET_WORD),
        .CODE_MIN(ANNEXIN_200NM_X_CODE_MIN),
        .CODE_MAX(ANNEXIN_200NM_X_CODE_MAX)
    ) axis (.clock(clock), .reset(reset), .tick(tick), .code(code));
endmodule


// One axis. The code of a tick is valid four clocks after it. Both multipliers fit a 25 x 18 DSP block; the table,
// read at two places, a dual-port block RAM.
// Codes are straight binary; a converter in two's complement takes them with the top bit inverted.
module play_axis #(
    parameter TABLE_FILE = "",
    parameter LENGTH = 2,
    parameter BITS = 16,
    parameter INTERPOLATED = 1,
    parameter INDEX_BITS = 1,
    parameter GUARD_BITS = 4,
    parameter [31:0] PERIOD = 1,
    parameter [31:0] STEP = 0,
    parameter [31:0] REMAINDER = 0,
    parameter [31:0] HOLD = 1,
    parameter signed [17:0] GAIN_WORD = 0,
    parameter GAIN_Q = 20,
    parameter signed [43:0] OFFSET_WORD = 0,
    parameter signed [43:0] CODE_MIN = 0,
    parameter signed [43:0] CODE_MAX = 0
) (
    input  wire        clock,
    input  wire        reset,
    input  wire        tick,
    output reg  [23:0] code
);
    localparam FRACTION_BITS = 15;
    localparam DROPPED_BITS = FRACTION_BITS - GUARD_BITS;
    localparam SAMPLE_BITS = BITS + GUARD_BITS;
    localparam signed [39:0] HALF_SAMPLE = 40'sd1 <<< (DROPPED_BITS - 1);
    localparam signed [43:0] HALF_CODE = 44'sd1 <<< (GAIN_Q - 1);

    reg signed [BITS-1:0] table_words [0:LENGTH-1];
    initial $readmemh(TABLE_FILE, table_words);

    // Position: phase = floor(count 2^32 / PERIOD): adds an integer step, and one more whenever the remainder wraps.
    reg [31:0] held, count, phase, rest;
    wire [32:0] next_rest = {1'b0, rest} + {1'b0, REMAINDER};
    wire        wraps = next_rest >= {1'b0, PERIOD};

    always @(posedge clock)
        if (reset) begin
            held <= 32'd0;
            count <= 32'd0;
            phase <= 32'd0;
            rest <= 32'd0;
        end else if (tick) begin
            if (held + 32'd1 < HOLD)
                held <= held + 32'd1;
            else begin
                held <= 32'd0;
                count <= count + 32'd1 < PERIOD ? count + 32'd1 : 32'd0;
                phase <= phase + STEP + {31'd0, wraps};
                rest <= wraps ? next_rest[31:0] - PERIOD : next_rest[31:0];
            end
        end

    // Clock 1: two neighbouring words, and how far between them.
    wire [31:0] index = INTERPOLATED ? phase >> (32 - INDEX_BITS) : count;
    reg signed [BITS-1:0] here, there;
    reg signed [FRACTION_BITS:0] fraction;

    always @(posedge clock) begin
        here <= table_words[index];
        there <= table_words[index + 32'd1 < LENGTH ? index + 32'd1 : 32'd0];
        fraction <= INTERPOLATED ? (phase >> (32 - INDEX_BITS - FRACTION_BITS)) & ((1 << FRACTION_BITS) - 1) : 0;
    end

    // Clock 2: the line between them, rounded, ties up, with GUARD_BITS below the LSB of a word.
    wire signed [39:0] between = (there - here) * fraction;
    reg signed [SAMPLE_BITS-1:0] sample;

    always @(posedge clock)
        sample <= (here <<< GUARD_BITS) + ((between + HALF_SAMPLE) >>> DROPPED_BITS);

    // Clock 3: gain and offset. Clock 4: rounded, ties up, and held inside the limits: never a wrap.
    reg signed [43:0] scaled;
    wire signed [43:0] unclamped = (scaled + HALF_CODE) >>> GAIN_Q;

    always @(posedge clock) begin
        scaled <= sample * GAIN_WORD + OFFSET_WORD;
        code <= unclamped < CODE_MIN ? CODE_MIN : unclamped > CODE_MAX ? CODE_MAX : unclamped;
    end
endmodule

`default_nettype wire
