// result = floor((a b + low) / 2^DROP), exact, one a clock, in look-up tables: no multiplier block is needed.
//
// b is cut into digits of base 4, each of them -1, 0, 1 or 2, and stage i adds digit i times a. Adding 1 in every
// digit's place, 01 01 .. 01 in binary, does the recoding: the digits of b + 0101..01 are those of b, plus 1. The
// least significant digit comes first and what a stage has finished is shifted out, so that no adder is wider than a
// is. Such a digit and two bits of a are the four inputs of a look-up table.
//
// Digit i must come i clocks after a, so that a constant b needs no delay line, and a new one can follow its first a.
// The result is valid DIGITS clocks after a.

`default_nettype none

module dac_multiply_digits #(
    parameter A_BITS = 17,      // a is signed
    parameter DIGITS = 8,       // -(4^DIGITS - 1) / 3 <= b <= 2 (4^DIGITS - 1) / 3
    parameter DROP = 10,        // 0 .. A_BITS
    parameter LOW_BITS = DROP,  // 1 .. A_BITS
    parameter RESULT_BITS = 23  // at most A_BITS + 2 DIGITS - DROP are of use
) (
    input  wire                          clock,
    input  wire signed [A_BITS-1:0]      a,
    input  wire [LOW_BITS-1:0]           low,     // unsigned; comes with a
    input  wire [2*DIGITS-1:0]           digits,  // the digits of b + 0101..01
    output wire signed [RESULT_BITS-1:0] result
);
    localparam PAIRS_DROPPED = DROP / 2 < DIGITS ? DROP / 2 : DIGITS;
    localparam KEPT = 2 * (DIGITS - PAIRS_DROPPED);  // finished bits that are part of the result
    localparam WIDE = A_BITS + KEPT;
    localparam SHIFT = DROP - 2 * PAIRS_DROPPED;

    // sums[i] is what stage i has of the sum above the bits that are finished, kept[i] those finished bits.
    reg signed [A_BITS-1:0] sums [0:DIGITS-1];
    reg signed [A_BITS-1:0] delayed [0:DIGITS-1];
    reg [KEPT+3:0] kept [0:DIGITS-1];

    genvar i;
    generate
        for (i = 0; i < DIGITS; i = i + 1) begin : stage
            wire [A_BITS:0] so_far;
            wire signed [A_BITS-1:0] factor;
            wire [KEPT+3:0] finished;
            if (i == 0) begin : first
                assign so_far = {{A_BITS+1-LOW_BITS{1'b0}}, low};
                assign factor = a;
                assign finished = {KEPT+4{1'b0}};
            end else begin : later
                assign so_far = {sums[i-1][A_BITS-1], sums[i-1]};
                assign factor = delayed[i-1];
                assign finished = kept[i-1];
            end

            wire [1:0] digit = digits[2*i +: 2];
            wire minus = digit == 2'd0;
            wire [A_BITS+1:0] term = digit == 2'd0 ? ~{{2{factor[A_BITS-1]}}, factor} :
                                     digit == 2'd1 ? {A_BITS+2{1'b0}} :
                                     digit == 2'd2 ? {{2{factor[A_BITS-1]}}, factor} :
                                                     {factor[A_BITS-1], factor, 1'b0};
            // The lowest position only makes the carry that -a needs beside the inverse of a.
            wire [A_BITS+2:0] total = {so_far[A_BITS], so_far, 1'b1} + {term, minus};
            wire unused = &{total[0], finished[1:0]};

            initial begin
                sums[i] = 0;
                delayed[i] = 0;
                kept[i] = 0;
            end
            always @(posedge clock) begin
                sums[i] <= total[A_BITS+2:3];
                delayed[i] <= factor;
                kept[i] <= i < PAIRS_DROPPED ? {KEPT+4{1'b0}} : {total[2:1], finished[KEPT+3:2]};
            end
        end
    endgenerate

    wire signed [WIDE+3:0] whole = {sums[DIGITS-1], kept[DIGITS-1]};
    wire signed [WIDE+3:0] shifted = whole >>> (SHIFT + 4);  // 4 places more than are kept: none may be 0 wide
    wire unused_high = &shifted;
    generate
        if (RESULT_BITS > WIDE + 4) begin : extended
            assign result = {{RESULT_BITS-WIDE-4{shifted[WIDE+3]}}, shifted};
        end else begin : cut
            assign result = shifted[RESULT_BITS-1:0];
        end
    endgenerate

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (A_BITS < 1) begin : guard_0
            dac_multiply_digits_A_BITS_is_less_than_1 stop ();
        end
        if (DIGITS < 2) begin : guard_1
            dac_multiply_digits_DIGITS_is_less_than_2 stop ();
        end
        if (DROP < 0) begin : guard_2
            dac_multiply_digits_DROP_is_less_than_0 stop ();
        end
        if (LOW_BITS < 1 || LOW_BITS > A_BITS + 1) begin : guard_3
            dac_multiply_digits_LOW_BITS_is_not_1_to_A_BITS_and_1 stop ();
        end
        if (RESULT_BITS < 1) begin : guard_4
            dac_multiply_digits_RESULT_BITS_is_less_than_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
