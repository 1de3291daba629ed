// The sample between two table words, as in dac_interpolator in look-up tables, 10 clocks after the words. The fraction
// comes 3 clocks before them. What waits, waits in memories.

`default_nettype none

module dac_pair_interpolator #(
    parameter WORD_BITS = 16,
    parameter GUARD_BITS = 4
) (
    input  wire                                   clock,
    input  wire [5:0]                             at,        // counts clocks, from 0 at power-up
    input  wire signed [WORD_BITS-1:0]            here,
    input  wire signed [WORD_BITS-1:0]            there,
    input  wire [14:0]                            fraction,
    output reg  signed [WORD_BITS+GUARD_BITS-1:0] sample
);
    localparam SAMPLE_BITS = WORD_BITS + GUARD_BITS;
    localparam DROP = 14 - GUARD_BITS;  // one bit less than the rounding drops: that bit decides how it rounds
    localparam STEP_BITS = SAMPLE_BITS + 2;

    wire [14:0] with_words;
    wire [15:0] factor;
    dac_pair_delay #(.BITS(15), .CLOCKS(3)) to_words (.clock(clock), .at(at), .in(fraction), .out(with_words));
    dac_skew #(.DIGITS(8)) skew (.clock(clock), .value({1'b0, with_words}), .digits(factor));

    reg signed [WORD_BITS:0] difference;
    wire signed [STEP_BITS-1:0] step;  // the way from `here`, in half units of the sample
    always @(posedge clock) difference <= {there[WORD_BITS-1], there} - {here[WORD_BITS-1], here};
    dac_multiply_digits #(.A_BITS(WORD_BITS + 1), .DIGITS(8), .DROP(DROP), .RESULT_BITS(STEP_BITS)) multiply (
        .clock(clock), .a(difference), .low({DROP{1'b0}}), .digits(factor), .result(step)
    );

    wire [WORD_BITS-1:0] from;
    dac_pair_delay #(.BITS(WORD_BITS), .CLOCKS(9)) start (.clock(clock), .at(at), .in(here), .out(from));

    // The sample lies between two words, so the upper bits can be dropped. The added half rounds it.
    wire [SAMPLE_BITS:0] sum = {from, {GUARD_BITS{1'b0}}, 1'b1} + step[SAMPLE_BITS:0];
    wire unused = &{sum[0], step[STEP_BITS-1]};

    always @(posedge clock) sample <= sum[SAMPLE_BITS:1];

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (WORD_BITS < 8 || WORD_BITS > 24) begin : guard_0
            dac_pair_interpolator_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (GUARD_BITS != (WORD_BITS > 21 ? 25 - WORD_BITS : 4)) begin : guard_1
            dac_pair_interpolator_GUARD_BITS_follows_from_WORD_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
