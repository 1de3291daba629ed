// One sum of dac_fourier: the products of all terms with one digit, plus the carry from the digits below.
//
//   add      sum += or -= product, by `negative`
//   shift    sum = floor(sum / 2^DIGIT_BITS): go on to the next digit
//   clear    sum = 0
//
// It is a pipeline of two, operand and sum: `add` and `shift` are in the sum two clocks later, `clear` one clock later.
// A `shift` must not follow an `add` at once: a clock with neither lets the last product arrive. Everything else may
// come on every clock. The shifted sum passes through the operand while the sum itself becomes 0, so that nothing but
// a register is in front of the long carry chain.

`default_nettype none

module dac_fourier_sum #(
    parameter DIGIT_BITS = 2
) (
    input  wire                          clock,
    input  wire                          add,
    input  wire                          negative,
    input  wire signed [DIGIT_BITS+31:0] product,
    input  wire                          shift,
    input  wire                          clear,
    output reg  signed [DIGIT_BITS+32:0] sum
);
    reg signed [DIGIT_BITS+32:0] operand;
    reg one;  // -product is ~product + 1

    // The 1 enters as the carry of an extra lowest bit, which saves a second adder.
    wire [DIGIT_BITS+33:0] next = {sum, 1'b1} + {operand, one};
    wire unused = &{1'b0, next[0]};

    initial begin
        operand = 0;
        one = 1'b0;
        sum = 0;
    end

    always @(posedge clock) begin
        if (!add && !shift)
            operand <= 0;
        else if (shift)
            operand <= sum >>> DIGIT_BITS;
        else
            operand <= {product[DIGIT_BITS+31], product} ^ {(DIGIT_BITS+33){negative}};
        one <= add && negative;
        if (clear || shift)
            sum <= 0;
        else
            sum <= next[DIGIT_BITS+33:1];
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (DIGIT_BITS != 2 && DIGIT_BITS != 16) begin : guard_0
            dac_fourier_sum_DIGIT_BITS_is_not_2_or_16 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
