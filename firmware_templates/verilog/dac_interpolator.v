// The sample between two table words: (here << GUARD_BITS) + round((there - here) fraction / 2^(15 - GUARD_BITS)),
// ties up.
//
// One sample per clock, LATENCY clocks after its input. GUARD_BITS is min(4, 25 - WORD_BITS).

`default_nettype none

module dac_interpolator #(
    parameter WORD_BITS = 16,
    parameter GUARD_BITS = 4,
    parameter PLAIN_MULTIPLIER = 0,
    parameter LATENCY = PLAIN_MULTIPLIER ? 5 : 10  // derived: do not set it
) (
    input  wire                                   clock,
    input  wire signed [WORD_BITS-1:0]            here,
    input  wire signed [WORD_BITS-1:0]            there,
    input  wire [14:0]                            fraction,
    output reg  signed [WORD_BITS+GUARD_BITS-1:0] sample
);
    localparam SAMPLE_BITS = WORD_BITS + GUARD_BITS;
    localparam DROP = 14 - GUARD_BITS;  // one bit less than the rounding drops: that bit decides how it rounds
    localparam STEP_BITS = SAMPLE_BITS + 2;

    reg signed [WORD_BITS:0] difference;
    wire signed [STEP_BITS-1:0] step;  // the way from `here`, in half units of the sample
    wire [WORD_BITS-1:0] from;

    always @(posedge clock) difference <= {there[WORD_BITS-1], there} - {here[WORD_BITS-1], here};

    generate
        if (PLAIN_MULTIPLIER) begin : plain
            reg [14:0] factor;
            always @(posedge clock) factor <= fraction;
            dac_multiply_plain #(
                .A_BITS(WORD_BITS + 1), .B_BITS(16), .DROP(DROP), .RESULT_BITS(STEP_BITS)
            ) multiply (
                .clock(clock), .a(difference), .b({1'b0, factor}), .low({DROP{1'b0}}), .result(step)
            );
        end else begin : digits
            wire [15:0] factor;
            dac_skew #(.DIGITS(8)) skew (.clock(clock), .value({1'b0, fraction}), .digits(factor));
            dac_multiply_digits #(
                .A_BITS(WORD_BITS + 1), .DIGITS(8), .DROP(DROP), .RESULT_BITS(STEP_BITS)
            ) multiply (
                .clock(clock), .a(difference), .low({DROP{1'b0}}), .digits(factor), .result(step)
            );
        end
    endgenerate

    dac_delay #(.BITS(WORD_BITS), .CLOCKS(LATENCY - 1)) start (.clock(clock), .in(here), .out(from));

    // The sample lies between two words, so the upper bits can be dropped. The added half rounds it.
    wire [SAMPLE_BITS:0] sum = {from, {GUARD_BITS{1'b0}}, 1'b1} + step[SAMPLE_BITS:0];
    wire unused = &{sum[0], step[STEP_BITS-1]};

    always @(posedge clock) sample <= sum[SAMPLE_BITS:1];

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (WORD_BITS < 8 || WORD_BITS > 24) begin : guard_0
            dac_interpolator_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (GUARD_BITS != (WORD_BITS > 21 ? 25 - WORD_BITS : 4)) begin : guard_1
            dac_interpolator_GUARD_BITS_follows_from_WORD_BITS stop ();
        end
        if (PLAIN_MULTIPLIER < 0 || PLAIN_MULTIPLIER > 1) begin : guard_2
            dac_interpolator_PLAIN_MULTIPLIER_is_not_0_to_1 stop ();
        end
        if (LATENCY != (PLAIN_MULTIPLIER != 0 ? 5 : 10)) begin : guard_3
            dac_interpolator_LATENCY_follows_from_PLAIN_MULTIPLIER stop ();
        end
    endgenerate
endmodule

`default_nettype wire
