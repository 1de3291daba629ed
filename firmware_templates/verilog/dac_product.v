// The product of two signed numbers, exact, one a clock: `product` is that of a and b of two clocks ago.
//
// The registers are before and behind the product, where a multiplier block has its own. For a tool that leaves them
// outside the block there may be another file in the place of this one: that of the ECP5 is in ecp5/.

`default_nettype none

module dac_product #(
    parameter A_BITS = 17,
    parameter B_BITS = 16
) (
    input  wire                            clock,
    input  wire signed [A_BITS-1:0]        a,
    input  wire signed [B_BITS-1:0]        b,
    output reg  signed [A_BITS+B_BITS-1:0] product
);
    reg signed [A_BITS-1:0] a_in;
    reg signed [B_BITS-1:0] b_in;

    always @(posedge clock) begin
        a_in <= a;
        b_in <= b;
        product <= a_in * b_in;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (A_BITS < 1) begin : guard_0
            dac_product_A_BITS_is_less_than_1 stop ();
        end
        if (B_BITS < 1) begin : guard_1
            dac_product_B_BITS_is_less_than_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
