// A MULT18X18D of the ECP5, a signed multiplier of 18 by 18 bits, for simulations: yosys has its pins alone.
//
// By Lattice's TN1267, ECP5 and ECP5-5G sysDSP Usage Guide, as far as ecp5/dac_product.v uses it: registers of both
// inputs and of the output, on CLK0.

`timescale 1ns / 1ps
`default_nettype none

module MULT18X18D #(
    parameter REG_INPUTA_CLK = "NONE", REG_INPUTB_CLK = "NONE", REG_PIPELINE_CLK = "NONE", REG_OUTPUT_CLK = "NONE",
    parameter GSR = "ENABLED"
) (
    input wire  A17, A16, A15, A14, A13, A12, A11, A10, A9, A8, A7, A6,
    input wire  A5, A4, A3, A2, A1, A0,
    input wire  B17, B16, B15, B14, B13, B12, B11, B10, B9, B8, B7, B6,
    input wire  B5, B4, B3, B2, B1, B0,
    input wire  C17, C16, C15, C14, C13, C12, C11, C10, C9, C8, C7, C6,
    input wire  C5, C4, C3, C2, C1, C0,
    input wire  SIGNEDA, SIGNEDB, SOURCEA, SOURCEB,
    input wire  CLK0, CLK1, CLK2, CLK3, CE0, CE1, CE2, CE3, RST0, RST1, RST2, RST3,
    output wire P35, P34, P33, P32, P31, P30, P29, P28, P27, P26, P25, P24,
    output wire P23, P22, P21, P20, P19, P18, P17, P16, P15, P14, P13, P12,
    output wire P11, P10, P9, P8, P7, P6, P5, P4, P3, P2, P1, P0
);
    generate
        if (REG_PIPELINE_CLK != "NONE") begin : guard
            this_model_has_no_such_MULT18X18D stop ();
        end
    endgenerate

    wire signed [17:0] a = {
        A17, A16, A15, A14, A13, A12, A11, A10, A9, A8, A7, A6,
        A5, A4, A3, A2, A1, A0
    };
    wire signed [17:0] b = {
        B17, B16, B15, B14, B13, B12, B11, B10, B9, B8, B7, B6,
        B5, B4, B3, B2, B1, B0
    };
    reg signed [17:0] a_in, b_in;
    wire signed [17:0] a_now = REG_INPUTA_CLK == "CLK0" ? a_in : a, b_now = REG_INPUTB_CLK == "CLK0" ? b_in : b;
    wire signed [35:0] product = a_now * b_now;
    reg signed [35:0] out;
    always @(posedge CLK0) begin
        if (CE0) begin
            a_in <= a;
            b_in <= b;
            out <= product;
        end
        if (RST0) {a_in, b_in, out} <= 72'd0;
    end
    // Without the signs the cell multiplies other numbers.
    wire is_signed = SIGNEDA && SIGNEDB && !SOURCEA && !SOURCEB;
    assign {
        P35, P34, P33, P32, P31, P30, P29, P28, P27, P26, P25, P24,
        P23, P22, P21, P20, P19, P18, P17, P16, P15, P14, P13, P12,
        P11, P10, P9, P8, P7, P6, P5, P4, P3, P2, P1, P0
    } = is_signed ? (REG_OUTPUT_CLK == "CLK0" ? out : product) : 36'bx;
endmodule

`default_nettype wire
