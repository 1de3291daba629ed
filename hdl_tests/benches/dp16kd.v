// A DP16KD of the ECP5, a block RAM of 1024 words of 18 bits, for simulations of netlists: yosys has its pins alone.
//
// By Lattice's TN1264, ECP5 and ECP5-5G Memory Usage Guide, as far as yosys and ecp5/dac_memory.v use it: both ports on
// rising edges, without resets and chip selects, an output register on port B alone; 36 bits are written on port A and
// read on port B. Of 9 bits a port of 1, 2 or 4 bits has 8. +asleep is the number of clocks after power-up for which every
// word reads as 0.

`timescale 1ns / 1ps
`default_nettype none

module DP16KD #(
    parameter [319:0] INITVAL_00 = 0, INITVAL_01 = 0, INITVAL_02 = 0, INITVAL_03 = 0,
    parameter [319:0] INITVAL_04 = 0, INITVAL_05 = 0, INITVAL_06 = 0, INITVAL_07 = 0,
    parameter [319:0] INITVAL_08 = 0, INITVAL_09 = 0, INITVAL_0A = 0, INITVAL_0B = 0,
    parameter [319:0] INITVAL_0C = 0, INITVAL_0D = 0, INITVAL_0E = 0, INITVAL_0F = 0,
    parameter [319:0] INITVAL_10 = 0, INITVAL_11 = 0, INITVAL_12 = 0, INITVAL_13 = 0,
    parameter [319:0] INITVAL_14 = 0, INITVAL_15 = 0, INITVAL_16 = 0, INITVAL_17 = 0,
    parameter [319:0] INITVAL_18 = 0, INITVAL_19 = 0, INITVAL_1A = 0, INITVAL_1B = 0,
    parameter [319:0] INITVAL_1C = 0, INITVAL_1D = 0, INITVAL_1E = 0, INITVAL_1F = 0,
    parameter [319:0] INITVAL_20 = 0, INITVAL_21 = 0, INITVAL_22 = 0, INITVAL_23 = 0,
    parameter [319:0] INITVAL_24 = 0, INITVAL_25 = 0, INITVAL_26 = 0, INITVAL_27 = 0,
    parameter [319:0] INITVAL_28 = 0, INITVAL_29 = 0, INITVAL_2A = 0, INITVAL_2B = 0,
    parameter [319:0] INITVAL_2C = 0, INITVAL_2D = 0, INITVAL_2E = 0, INITVAL_2F = 0,
    parameter [319:0] INITVAL_30 = 0, INITVAL_31 = 0, INITVAL_32 = 0, INITVAL_33 = 0,
    parameter [319:0] INITVAL_34 = 0, INITVAL_35 = 0, INITVAL_36 = 0, INITVAL_37 = 0,
    parameter [319:0] INITVAL_38 = 0, INITVAL_39 = 0, INITVAL_3A = 0, INITVAL_3B = 0,
    parameter [319:0] INITVAL_3C = 0, INITVAL_3D = 0, INITVAL_3E = 0, INITVAL_3F = 0,
    parameter [31:0] DATA_WIDTH_A = 18, DATA_WIDTH_B = 18,
    parameter REGMODE_A = "NOREG", REGMODE_B = "NOREG", RESETMODE = "SYNC", ASYNC_RESET_RELEASE = "SYNC",
    parameter CSDECODE_A = "0b000", CSDECODE_B = "0b000", WRITEMODE_A = "NORMAL", WRITEMODE_B = "NORMAL",
    parameter CLKAMUX = "CLKA", CLKBMUX = "CLKB", GSR = "ENABLED"
) (
    input wire  DIA17, DIA16, DIA15, DIA14, DIA13, DIA12, DIA11, DIA10, DIA9,
    input wire  DIA8, DIA7, DIA6, DIA5, DIA4, DIA3, DIA2, DIA1, DIA0,
    input wire  ADA13, ADA12, ADA11, ADA10, ADA9, ADA8, ADA7, ADA6, ADA5,
    input wire  ADA4, ADA3, ADA2, ADA1, ADA0,
    output wire DOA17, DOA16, DOA15, DOA14, DOA13, DOA12, DOA11, DOA10, DOA9,
    output wire DOA8, DOA7, DOA6, DOA5, DOA4, DOA3, DOA2, DOA1, DOA0,
    input wire  CEA, OCEA, CLKA, WEA, RSTA, CSA2, CSA1, CSA0,
    input wire  DIB17, DIB16, DIB15, DIB14, DIB13, DIB12, DIB11, DIB10, DIB9,
    input wire  DIB8, DIB7, DIB6, DIB5, DIB4, DIB3, DIB2, DIB1, DIB0,
    input wire  ADB13, ADB12, ADB11, ADB10, ADB9, ADB8, ADB7, ADB6, ADB5,
    input wire  ADB4, ADB3, ADB2, ADB1, ADB0,
    output wire DOB17, DOB16, DOB15, DOB14, DOB13, DOB12, DOB11, DOB10, DOB9,
    output wire DOB8, DOB7, DOB6, DOB5, DOB4, DOB3, DOB2, DOB1, DOB0,
    input wire  CEB, OCEB, CLKB, WEB, RSTB, CSB2, CSB1, CSB0
);
    localparam [20479:0] CONTENTS = {
        INITVAL_3F, INITVAL_3E, INITVAL_3D, INITVAL_3C, INITVAL_3B, INITVAL_3A, INITVAL_39, INITVAL_38,
        INITVAL_37, INITVAL_36, INITVAL_35, INITVAL_34, INITVAL_33, INITVAL_32, INITVAL_31, INITVAL_30,
        INITVAL_2F, INITVAL_2E, INITVAL_2D, INITVAL_2C, INITVAL_2B, INITVAL_2A, INITVAL_29, INITVAL_28,
        INITVAL_27, INITVAL_26, INITVAL_25, INITVAL_24, INITVAL_23, INITVAL_22, INITVAL_21, INITVAL_20,
        INITVAL_1F, INITVAL_1E, INITVAL_1D, INITVAL_1C, INITVAL_1B, INITVAL_1A, INITVAL_19, INITVAL_18,
        INITVAL_17, INITVAL_16, INITVAL_15, INITVAL_14, INITVAL_13, INITVAL_12, INITVAL_11, INITVAL_10,
        INITVAL_0F, INITVAL_0E, INITVAL_0D, INITVAL_0C, INITVAL_0B, INITVAL_0A, INITVAL_09, INITVAL_08,
        INITVAL_07, INITVAL_06, INITVAL_05, INITVAL_04, INITVAL_03, INITVAL_02, INITVAL_01, INITVAL_00
    };
    localparam WIDE = DATA_WIDTH_A == 36;

    generate
        if ((DATA_WIDTH_B == 36) != WIDE || CLKAMUX != "CLKA" || CLKBMUX != "CLKB" || REGMODE_A != "NOREG" ||
                (REGMODE_B != "NOREG" && (WIDE || REGMODE_B != "OUTREG")) ||
                (!WIDE && (WRITEMODE_A == "NORMAL" || WRITEMODE_B == "NORMAL")) ||
                WRITEMODE_A == "WRITETHROUGH" || WRITEMODE_B == "WRITETHROUGH") begin : guard
            this_model_has_no_such_DP16KD stop ();
        end
    endgenerate

    wire [17:0] data_a = {
        DIA17, DIA16, DIA15, DIA14, DIA13, DIA12, DIA11, DIA10, DIA9,
        DIA8, DIA7, DIA6, DIA5, DIA4, DIA3, DIA2, DIA1, DIA0
    };
    wire [17:0] data_b = {
        DIB17, DIB16, DIB15, DIB14, DIB13, DIB12, DIB11, DIB10, DIB9,
        DIB8, DIB7, DIB6, DIB5, DIB4, DIB3, DIB2, DIB1, DIB0
    };
    wire [13:0] at_a = {ADA13, ADA12, ADA11, ADA10, ADA9, ADA8, ADA7, ADA6, ADA5, ADA4, ADA3, ADA2, ADA1, ADA0};
    wire [13:0] at_b = {ADB13, ADB12, ADB11, ADB10, ADB9, ADB8, ADB7, ADB6, ADB5, ADB4, ADB3, ADB2, ADB1, ADB0};
    wire selected_a = CEA && {CSA2, CSA1, CSA0} == 3'd0;
    wire selected_b = CEB && {CSB2, CSB1, CSB0} == 3'd0;

    reg [8:0] bytes [0:2047];
    reg [17:0] out_a, out_b, late_b;
    always @(posedge CLKB) if (OCEB) late_b <= out_b;
    reg awake;
    integer k, asleep;
    initial begin
        for (k = 0; k < 1024; k = k + 1) {bytes[2*k+1], bytes[2*k]} = CONTENTS[20*k +: 18];
        awake = 1'b0;
        if ($value$plusargs("asleep=%d", asleep)) #(10 * asleep);
        awake = 1'b1;
    end

    // The low bits of an address are the enables of bytes, or choose among the 8 bits of one.
    generate
        if (WIDE) begin : wide
            wire [10:0] to = {at_a[13:5], 2'd0}, from = {at_b[13:5], 2'd0};
            always @(posedge CLKA) if (selected_a && WEA) begin
                if (at_a[0]) bytes[to] <= data_a[8:0];
                if (at_a[1]) bytes[to+11'd1] <= data_a[17:9];
                if (at_a[2]) bytes[to+11'd2] <= data_b[8:0];
                if (at_a[3]) bytes[to+11'd3] <= data_b[17:9];
            end
            always @(posedge CLKB) if (selected_b)
                {out_b, out_a} <= {bytes[from+11'd3], bytes[from+11'd2], bytes[from+11'd1], bytes[from]};
        end else begin : own
            if (DATA_WIDTH_A == 18) begin : word_a
                wire [10:0] a = {at_a[13:4], 1'b0};
                always @(posedge CLKA) if (selected_a) begin
                    out_a <= {bytes[a+11'd1], bytes[a]};
                    if (WEA && at_a[0]) bytes[a] <= data_a[8:0];
                    if (WEA && at_a[1]) bytes[a+11'd1] <= data_a[17:9];
                end
            end else begin : narrow_a
                localparam [3:0] LOW = DATA_WIDTH_A == 9 ? 4'd0 : 4'd8 - DATA_WIDTH_A[3:0];  // address bits that choose
                localparam [8:0] ONES = (9'd1 << DATA_WIDTH_A) - 9'd1;
                wire [10:0] a = at_a[13:3];
                wire [3:0] shift = {1'b0, at_a[2:0]} & LOW;
                always @(posedge CLKA) if (selected_a) begin
                    out_a <= {9'd0, bytes[a] >> shift & ONES};
                    if (WEA) bytes[a] <= (bytes[a] & ~(ONES << shift)) | (data_a[8:0] & ONES) << shift;
                end
            end
            if (DATA_WIDTH_B == 18) begin : word_b
                wire [10:0] b = {at_b[13:4], 1'b0};
                always @(posedge CLKB) if (selected_b) begin
                    out_b <= {bytes[b+11'd1], bytes[b]};
                    if (WEB && at_b[0]) bytes[b] <= data_b[8:0];
                    if (WEB && at_b[1]) bytes[b+11'd1] <= data_b[17:9];
                end
            end else begin : narrow_b
                localparam [3:0] LOW = DATA_WIDTH_B == 9 ? 4'd0 : 4'd8 - DATA_WIDTH_B[3:0];
                localparam [8:0] ONES = (9'd1 << DATA_WIDTH_B) - 9'd1;
                wire [10:0] b = at_b[13:3];
                wire [3:0] shift = {1'b0, at_b[2:0]} & LOW;
                always @(posedge CLKB) if (selected_b) begin
                    out_b <= {9'd0, bytes[b] >> shift & ONES};
                    if (WEB) bytes[b] <= (bytes[b] & ~(ONES << shift)) | (data_b[8:0] & ONES) << shift;
                end
            end
        end
    endgenerate
    assign {
        DOA17, DOA16, DOA15, DOA14, DOA13, DOA12, DOA11, DOA10, DOA9,
        DOA8, DOA7, DOA6, DOA5, DOA4, DOA3, DOA2, DOA1, DOA0
    } = out_a & {18{awake}};
    assign {
        DOB17, DOB16, DOB15, DOB14, DOB13, DOB12, DOB11, DOB10, DOB9,
        DOB8, DOB7, DOB6, DOB5, DOB4, DOB3, DOB2, DOB1, DOB0
    } = (REGMODE_B == "OUTREG" ? late_b : out_b) & {18{awake}};
endmodule

`default_nettype wire
