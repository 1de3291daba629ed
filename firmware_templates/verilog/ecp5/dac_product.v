// dac_product of the ECP5: a multiplier block MULT18X18D whose registers of inputs and output are used.
//
// `product` is that of a and b of two clocks ago, as there. A factor has at most 18 bits.

`default_nettype none

module dac_product #(
    parameter A_BITS = 17,
    parameter B_BITS = 16
) (
    input  wire                            clock,
    input  wire signed [A_BITS-1:0]        a,
    input  wire signed [B_BITS-1:0]        b,
    output wire signed [A_BITS+B_BITS-1:0] product
);
    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (A_BITS < 2 || A_BITS > 18) begin : guard_0
            dac_product_A_BITS_is_not_2_to_18 stop ();
        end
        if (B_BITS < 2 || B_BITS > 18) begin : guard_1
            dac_product_B_BITS_is_not_2_to_18 stop ();
        end
    endgenerate

    wire signed [31:0] a_long = a, b_long = b;
    wire [17:0] a_wide = a_long[17:0], b_wide = b_long[17:0];
    wire [35:0] whole;
    wire unused = &{a_long, b_long, whole};
    assign product = whole[A_BITS+B_BITS-1:0];

    MULT18X18D #(
        .REG_INPUTA_CLK("CLK0"), .REG_INPUTB_CLK("CLK0"), .REG_OUTPUT_CLK("CLK0"), .GSR("DISABLED")
    ) block (
        .A17(a_wide[17]), .A16(a_wide[16]), .A15(a_wide[15]), .A14(a_wide[14]), .A13(a_wide[13]), .A12(a_wide[12]),
        .A11(a_wide[11]), .A10(a_wide[10]), .A9(a_wide[9]), .A8(a_wide[8]), .A7(a_wide[7]), .A6(a_wide[6]),
        .A5(a_wide[5]), .A4(a_wide[4]), .A3(a_wide[3]), .A2(a_wide[2]), .A1(a_wide[1]), .A0(a_wide[0]),
        .B17(b_wide[17]), .B16(b_wide[16]), .B15(b_wide[15]), .B14(b_wide[14]), .B13(b_wide[13]), .B12(b_wide[12]),
        .B11(b_wide[11]), .B10(b_wide[10]), .B9(b_wide[9]), .B8(b_wide[8]), .B7(b_wide[7]), .B6(b_wide[6]),
        .B5(b_wide[5]), .B4(b_wide[4]), .B3(b_wide[3]), .B2(b_wide[2]), .B1(b_wide[1]), .B0(b_wide[0]), .C17(1'b0),
        .C16(1'b0), .C15(1'b0), .C14(1'b0), .C13(1'b0), .C12(1'b0), .C11(1'b0), .C10(1'b0), .C9(1'b0), .C8(1'b0),
        .C7(1'b0), .C6(1'b0), .C5(1'b0), .C4(1'b0), .C3(1'b0), .C2(1'b0), .C1(1'b0), .C0(1'b0), .SIGNEDA(1'b1),
        .SIGNEDB(1'b1), .SOURCEA(1'b0), .SOURCEB(1'b0), .CLK0(clock), .CE0(1'b1), .RST0(1'b0), .CLK1(1'b0),
        .CE1(1'b1), .RST1(1'b0), .CLK2(1'b0), .CE2(1'b1), .RST2(1'b0), .CLK3(1'b0), .CE3(1'b1), .RST3(1'b0),
        .P35(whole[35]), .P34(whole[34]), .P33(whole[33]), .P32(whole[32]), .P31(whole[31]), .P30(whole[30]),
        .P29(whole[29]), .P28(whole[28]), .P27(whole[27]), .P26(whole[26]), .P25(whole[25]), .P24(whole[24]),
        .P23(whole[23]), .P22(whole[22]), .P21(whole[21]), .P20(whole[20]), .P19(whole[19]), .P18(whole[18]),
        .P17(whole[17]), .P16(whole[16]), .P15(whole[15]), .P14(whole[14]), .P13(whole[13]), .P12(whole[12]),
        .P11(whole[11]), .P10(whole[10]), .P9(whole[9]), .P8(whole[8]), .P7(whole[7]), .P6(whole[6]), .P5(whole[5]),
        .P4(whole[4]), .P3(whole[3]), .P2(whole[2]), .P1(whole[1]), .P0(whole[0])
    );
endmodule

`default_nettype wire
