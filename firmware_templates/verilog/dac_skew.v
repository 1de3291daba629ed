// Recodes a multiplier for dac_multiply_digits: the digits of `value` + 0101..01, digit i delayed by i clocks.
//
// The sum takes a clock: digit 0 is there one clock after `value`.

`default_nettype none

module dac_skew #(
    parameter DIGITS = 8
) (
    input  wire                clock,
    input  wire [2*DIGITS-1:0] value,
    output wire [2*DIGITS-1:0] digits
);
    reg [2*DIGITS-1:0] recoded;
    initial recoded = 0;

    always @(posedge clock) recoded <= value + {DIGITS{2'b01}};

    genvar i;
    generate
        for (i = 0; i < DIGITS; i = i + 1) begin : digit
            dac_delay #(.BITS(2), .CLOCKS(i)) later (.clock(clock), .in(recoded[2*i +: 2]), .out(digits[2*i +: 2]));
        end
    endgenerate

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (DIGITS < 1) begin : guard_0
            dac_skew_DIGITS_is_less_than_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
