// A coefficient times one digit of a sine word: the multiplier of dac_fourier.
//
// A sine word (0 .. 2^30) is a number of DIGIT_BITS-bit digits, and every clock gives the product of a coefficient with
// one digit of one word.
//
//   DIGIT_BITS = 2    16 digits of -2, -1, 0, 1, 2 (Booth's recoding: a pair of bits and the bit below it). The product
//                     is the coefficient, its double or nothing, to be added or to be taken off: no adder in here.
//   DIGIT_BITS = 16   2 digits of 0 .. 65535, and a plain `*` of 32 by 17 signed bits, registered before and after: two
//                     18 x 18 DSP blocks.
//
// The coefficient belongs one clock after the sine word and its digit's number, as block RAMs deliver them when one of
// them gets its address one register later. The product is valid 2 or 4 clocks after the sine word.
//
// `negative` comes with the product and says that it is to be subtracted.

`default_nettype none

module dac_fourier_product #(
    parameter DIGIT_BITS = 2  // 2 or 16
) (
    input  wire                         clock,
    input  wire        [30:0]           sine,
    input  wire        [3:0]            digit_number,  // 0 is the lowest digit
    input  wire signed [31:0]           coefficient,   // one clock later than sine
    output wire signed [DIGIT_BITS+31:0] product,
    output wire                         negative
);
    generate
        if (DIGIT_BITS == 2) begin : shift_and_add
            // Digit i is -2 b[2i+1] + b[2i] + b[2i-1]. The topmost, of a number below 2^31, is never negative.
            wire [32:0] moved = {1'b0, sine, 1'b0} >> {digit_number, 1'b0};
            wire unused = &{1'b0, moved[32:3]};

            reg [2:0] digit;
            wire once = digit[1] ^ digit[0];
            wire twice = digit == 3'b011 || digit == 3'b100;
            reg signed [33:0] multiple;
            reg take_off;

            initial begin
                digit = 3'b000;
                multiple = 34'sd0;
                take_off = 1'b0;
            end

            always @(posedge clock) begin
                digit <= moved[2:0];
                multiple <= twice ? {coefficient[31], coefficient, 1'b0} : once ? {{2{coefficient[31]}}, coefficient} :
                    34'sd0;
                take_off <= digit[2];
            end

            assign product = multiple;
            assign negative = take_off;
        end else begin : multiply
            wire [15:0] low = sine[15:0], high = {1'b0, sine[30:16]};
            reg [15:0] digit, digit_operand;
            reg signed [31:0] coefficient_operand;
            reg signed [48:0] multiplied, registered;

            initial begin
                digit = 16'd0;
                digit_operand = 16'd0;
                coefficient_operand = 32'sd0;
                multiplied = 49'sd0;
                registered = 49'sd0;
            end

            always @(posedge clock) begin
                digit <= digit_number[0] ? high : low;
                digit_operand <= digit;
                coefficient_operand <= coefficient;
                multiplied <= coefficient_operand * $signed({1'b0, digit_operand});
                registered <= multiplied;
            end

            wire unused = &{1'b0, digit_number[3:1], registered[48]};
            assign product = registered[47:0];
            assign negative = 1'b0;
        end
    endgenerate

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (DIGIT_BITS != 2 && DIGIT_BITS != 16) begin : guard_0
            dac_fourier_product_DIGIT_BITS_is_not_2_or_16 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
