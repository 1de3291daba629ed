// One product of Horner's rule, in look-up tables and a digit a clock: a sum by a fraction.
//
// Digits are of base 4, as in dac_multiply_digits, the least significant one first, and come from the clock after
// `load` on. Ten clocks after that clock `product` is floor(sum digits / 4^10), and `half` the highest bit that it
// dropped. The next load may come on that clock.

`default_nettype none

module dac_spline_step #(
    parameter BITS = 21  // of the sum, signed
) (
    input  wire                   clock,
    input  wire                   load,
    input  wire signed [BITS-1:0] sum,      // with `load`
    input  wire [1:0]             digit,    // 0: -1, 1: 0, 2: 1, 3: 2
    output reg  signed [BITS-1:0] product,
    output reg                    half
);
    reg signed [BITS-1:0] factor;
    wire minus = digit == 2'd0;
    wire [BITS+1:0] term = digit == 2'd0 ? ~{{2{factor[BITS-1]}}, factor} :
                           digit == 2'd1 ? {BITS+2{1'b0}} :
                           digit == 2'd2 ? {{2{factor[BITS-1]}}, factor} :
                                           {factor[BITS-1], factor, 1'b0};
    // The lowest position only makes the carry that -factor needs beside the inverse of factor.
    wire [BITS+2:0] total = {{2{product[BITS-1]}}, product, 1'b1} + {term, minus};
    wire unused = &total[1:0];

    always @(posedge clock) begin
        if (load) factor <= sum;
        if (load)
            product <= 0;
        else
            product <= total[BITS+2:3];
        half <= total[2];
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 2) begin : guard_0
            dac_spline_step_BITS_is_less_than_2 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
