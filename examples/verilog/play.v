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

    play_serves this_scan ();

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


// A shaped scan is none for it: the output of `play_axis` is rounded, and no remainder is fed back.
// Nor is a sine: its pixels are not equal.
module play_serves;
    generate
        if (1) begin : scan
            `include "annexin_200nm.vh"

            if (ANNEXIN_200NM_SHAPING != 0) begin : guard
                play_plays_no_shaped_scan stop ();
            end
            if (ANNEXIN_200NM_PIXEL_INDEX_BITS != 0) begin : guard_pixels
                play_plays_no_table_of_pixels stop ();
            end
        end
    endgenerate
endmodule


// One axis. The code of a tick is valid four clocks after it, with a cubic table seven. Both multipliers of lines fit a
// 25 x 18 DSP block; the table, read at two places, a dual-port block RAM. A cubic table is play_spline's.
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

    // A cubic table has its sample on clock 5, and needs nothing of clocks 1 and 2.
    wire signed [SAMPLE_BITS-1:0] spline;
    generate
        if (INTERPOLATED == 3) begin : cubic
            play_spline #(.TABLE_FILE(TABLE_FILE), .INDEX_BITS(INDEX_BITS), .BITS(BITS)) words (
                .clock(clock), .phase(phase), .sample(spline)
            );
        end else begin : lines
            assign spline = 0;
        end
    endgenerate

    // Clock 3: gain and offset. Clock 4: rounded, ties up, and held inside the limits: never a wrap. Cubic: 6 and 7.
    reg signed [43:0] scaled;
    wire signed [43:0] unclamped = (scaled + HALF_CODE) >>> GAIN_Q;

    always @(posedge clock) begin
        scaled <= (INTERPOLATED == 3 ? spline : sample) * GAIN_WORD + OFFSET_WORD;
        code <= unclamped < CODE_MIN ? CODE_MIN : unclamped > CODE_MAX ? CODE_MAX : unclamped;
    end
endmodule

// The cubic B-spline of four neighbouring words, five clocks after its phase: 12 units are the LSB of a word. Horner's
// rule, with three products that are rounded, ties up; a phase may come on every clock.
module play_spline #(
    parameter TABLE_FILE = "",
    parameter INDEX_BITS = 3,
    parameter BITS = 14
) (
    input  wire                   clock,
    input  wire [31:0]            phase,
    output reg  signed [BITS+3:0] sample
);
    localparam FRACTION_BITS = 18;
    localparam signed [63:0] HALF = 64'sd1 <<< FRACTION_BITS;  // of 2^19, since a coefficient b has 2^k already

    reg signed [BITS-1:0] table_words [0:(1<<INDEX_BITS)-1];
    initial $readmemh(TABLE_FILE, table_words);

    // Clock 1: the words. The index of each wraps at the end of the table.
    wire [INDEX_BITS-1:0] index_0 = phase[31 -: INDEX_BITS];
    wire [INDEX_BITS-1:0] index_1 = index_0 + 1, index_2 = index_0 + 2, index_3 = index_0 + 3;
    reg signed [BITS-1:0] word_0, word_1, word_2, word_3;
    reg signed [FRACTION_BITS:0] fraction_1, fraction_2, fraction_3, fraction_4;

    // Clock 2: the coefficients. Clocks 3 to 5: a product each; the others wait for theirs.
    wire signed [63:0] c0 = word_0, c1 = word_1, c2 = word_2, c3 = word_3;
    reg signed [BITS+6:0] b0_2, b1_2, b2_2, b3_2, b0_3, b1_3, sum_3, b0_4, sum_4;
    wire signed [63:0] product_3 = b3_2 * fraction_2, product_4 = sum_3 * fraction_3, product_5 = sum_4 * fraction_4;

    always @(posedge clock) begin
        word_0 <= table_words[index_0];
        word_1 <= table_words[index_1];
        word_2 <= table_words[index_2];
        word_3 <= table_words[index_3];
        fraction_1 <= {1'b0, phase[31-INDEX_BITS -: FRACTION_BITS]};
        b0_2 <= 2 * (c0 + 4 * c1 + c2);
        b1_2 <= 12 * (c2 - c0);
        b2_2 <= 24 * (c0 - 2 * c1 + c2);
        b3_2 <= 16 * (c3 - c0 + 3 * (c1 - c2));
        fraction_2 <= fraction_1;
        sum_3 <= b2_2 + ((product_3 + HALF) >>> (FRACTION_BITS + 1));
        b1_3 <= b1_2;
        b0_3 <= b0_2;
        fraction_3 <= fraction_2;
        sum_4 <= b1_3 + ((product_4 + HALF) >>> (FRACTION_BITS + 1));
        b0_4 <= b0_3;
        fraction_4 <= fraction_3;
        sample <= b0_4 + ((product_5 + HALF) >>> (FRACTION_BITS + 1));
    end
endmodule

`default_nettype wire
