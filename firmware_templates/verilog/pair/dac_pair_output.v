// From sample to target of both axes, by turns: clamp(round((gain sample + offset) / 2^GAIN_Q), code_min, code_max),
// ties up; the park code where no scan plays. Never a wrap.
//
// GAIN_Q is 16 + SAMPLE_BITS - DAC_BITS, at least 19: the half that rounds is then above the low word of the offset.
// The target is there 16 clocks after the sample. Each word of a new program is loaded in the clock before its first
// sample meets it: load_X is high with that of x, and a clock later with that of y.

`default_nettype none

module dac_pair_output #(
    parameter SAMPLE_BITS = 20,
    parameter DAC_BITS = 16,
    parameter [63:0] X_POWER_UP_CODE = 0,
    parameter [63:0] Y_POWER_UP_CODE = 0
) (
    input  wire                          clock,
    input  wire                          load_hold,  // the gain, three clocks before load_low
    input  wire [17:0]                   gain_word,  // a clock before load_hold
    input  wire                          load_low,   // and the first digit of the gain
    input  wire [17:0]                   low_word,
    input  wire                          load_high,
    input  wire [SAMPLE_BITS-1:0]        high_word,
    input  wire                          load_min,
    input  wire                          load_max,
    input  wire                          load_park,
    input  wire [DAC_BITS-1:0]           code_word,  // with the last three
    input  wire signed [SAMPLE_BITS-1:0] sample,
    input  wire                          running,    // a scan plays; belongs to the sample of 15 clocks ago
    output reg  [DAC_BITS-1:0]           target,
    output reg                           clamped     // with its target, where a scan plays: a limit has changed it
);
    localparam GAIN_Q = 16 + SAMPLE_BITS - DAC_BITS;
    localparam A_BITS = GAIN_Q > SAMPLE_BITS ? GAIN_Q : SAMPLE_BITS;
    localparam HIGH_BITS = SAMPLE_BITS;  // of the sum, above the low word of the offset
    localparam CODE_BITS = DAC_BITS + 2;

    // Both gains go round while the digits take them. Digit i of an axis is taken i clocks after the first one: an even
    // digit always finds its axis in one place, an odd digit in the other.
    reg [19:0] recoded;
    wire [19:0] held, held_other;
    always @(posedge clock) recoded <= {{2{gain_word[17]}}, gain_word} + {10{2'b01}};
    dac_pair_ring #(.BITS(20)) gains (
        .clock(clock), .load(load_hold), .value(recoded), .now(held), .other(held_other)
    );
    wire [19:0] gain, gain_other;
    reg [8:0] loading;
    initial loading = 9'd0;
    always @(posedge clock) loading <= {loading[7:0], load_low};
    wire [9:0] load_digit = {loading, load_low};
    genvar i;
    generate
        for (i = 0; i < 10; i = i + 1) begin : digit
            dac_pair_ring #(.BITS(2), .POWER_UP_NOW(1), .POWER_UP_OTHER(1)) word (
                .clock(clock), .load(load_digit[i]), .value(i % 2 == 0 ? held[2*i +: 2] : held_other[2*i +: 2]),
                .now(gain[2*i +: 2]), .other(gain_other[2*i +: 2])
            );
        end
    endgenerate

    wire [17:0] low, low_other;
    dac_pair_ring #(.BITS(18)) lows (
        .clock(clock), .load(load_low), .value(low_word), .now(low), .other(low_other)
    );
    wire signed [A_BITS-1:0] multiplicand =
        {{A_BITS-SAMPLE_BITS+1{sample[SAMPLE_BITS-1]}}, sample[SAMPLE_BITS-2:0]};
    wire [GAIN_Q:0] half = {2'b01, {GAIN_Q-1{1'b0}}};
    wire [GAIN_Q-1:0] with_half = half[GAIN_Q-1:0] | {{GAIN_Q-18{1'b0}}, low};
    wire signed [HIGH_BITS-1:0] product;
    dac_multiply_digits #(
        .A_BITS(A_BITS), .DIGITS(10), .DROP(18), .LOW_BITS(GAIN_Q), .RESULT_BITS(HIGH_BITS)
    ) multiply (
        .clock(clock), .a(multiplicand), .low(with_half), .digits(gain), .result(product)
    );

    wire signed [HIGH_BITS-1:0] high, high_other;
    dac_pair_ring #(.BITS(HIGH_BITS)) highs (
        .clock(clock), .load(load_high), .value(high_word), .now(high), .other(high_other)
    );
    wire [DAC_BITS-1:0] min_inverse, min_inverse_last, max_inverse, max_inverse_last, park, park_other;
    dac_pair_ring #(.BITS(DAC_BITS)) mins (
        .clock(clock), .load(load_min), .value(~code_word), .now(min_inverse), .other(min_inverse_last)
    );
    dac_pair_ring #(.BITS(DAC_BITS)) maxs (
        .clock(clock), .load(load_max), .value(~code_word), .now(max_inverse), .other(max_inverse_last)
    );
    dac_pair_ring #(
        .BITS(DAC_BITS), .POWER_UP_NOW(X_POWER_UP_CODE[31:0]), .POWER_UP_OTHER(Y_POWER_UP_CODE[31:0])
    ) parks (
        .clock(clock), .load(load_park), .value(code_word), .now(park), .other(park_other)
    );

    // sum is the rounded code, and a fraction.
    wire signed [HIGH_BITS-1:0] sum = product + high;
    reg signed [CODE_BITS-1:0] code, code_1;
    reg [CODE_BITS:0] over_min;
    reg [CODE_BITS-2:0] held_up, held_up_1;  // not below code_min, and so not negative
    reg [CODE_BITS-1:0] over_max;            // less 1
    reg [DAC_BITS-1:0] limited;
    reg was_low, was_low_1, clamps;
    wire is_low = over_min[CODE_BITS];
    wire is_high = !over_max[CODE_BITS-1];
    wire unused = &{gain_other, low_other, high_other, park_other, half, sum, over_min, over_max, held_up_1, code_1};

    initial begin
        target = Y_POWER_UP_CODE[DAC_BITS-1:0];
        clamped = 1'b0;
    end

    always @(posedge clock) begin
        code <= sum[HIGH_BITS-1 -: CODE_BITS];

        over_min <= {code[CODE_BITS-1], code} + {3'b111, min_inverse} + 1;
        code_1 <= code;

        held_up <= is_low ? {1'b0, ~min_inverse_last} : code_1[CODE_BITS-2:0];
        was_low <= is_low;

        over_max <= {1'b0, held_up} + {2'b11, max_inverse};
        held_up_1 <= held_up;
        was_low_1 <= was_low;

        limited <= is_high ? ~max_inverse_last : held_up_1[DAC_BITS-1:0];
        clamps <= was_low_1 || is_high;

        target <= running ? limited : park;
        clamped <= clamps;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (SAMPLE_BITS < 12 || SAMPLE_BITS > 25) begin : guard_0
            dac_pair_output_SAMPLE_BITS_is_not_12_to_25 stop ();
        end
        if (DAC_BITS < 2) begin : guard_1
            dac_pair_output_DAC_BITS_is_less_than_2 stop ();
        end
        if (SAMPLE_BITS < DAC_BITS + 3) begin : guard_2
            dac_pair_output_SAMPLE_BITS_are_less_than_DAC_BITS_takes stop ();
        end
        if (X_POWER_UP_CODE >> DAC_BITS != 64'd0) begin : guard_3
            dac_pair_output_X_POWER_UP_CODE_has_more_than_DAC_BITS stop ();
        end
        if (Y_POWER_UP_CODE >> DAC_BITS != 64'd0) begin : guard_4
            dac_pair_output_Y_POWER_UP_CODE_has_more_than_DAC_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
