`default_nettype none

// The converter's own coding: a code, straight binary with 0 at the lowest output, becomes the word that is sent.
//
// Two's complement inverts the top bit of the code; a left-aligned word has its unused bits below the code, a
// right-aligned one above it, and they are 0 in both (a right-aligned two's complement word is not sign-extended:
// its upper bits belong to whatever else the frame carries). Neither is arithmetic, so clamp and slew guard never
// see them. The same as Output.word of the integer model.
//
// code  straight binary
// word  what the converter is sent
// Latency: none, wires and at most one inverter.
// Limits: WORD_BITS >= BITS.
module dac_coding #(
    parameter BITS = 16,
    parameter WORD_BITS = 16,
    parameter TWOS_COMPLEMENT = 0,
    parameter LEFT_ALIGNED = 0
) (
    input  wire [BITS-1:0]      code,
    output wire [WORD_BITS-1:0] word
);
    localparam INVERTED = TWOS_COMPLEMENT != 0;

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (BITS < 2 || BITS > 32) begin : guard_0
            dac_coding_BITS_is_not_2_to_32 stop ();
        end
        if (WORD_BITS < BITS || WORD_BITS > 64) begin : guard_1
            dac_coding_WORD_BITS_is_not_BITS_to_64 stop ();
        end
        if (TWOS_COMPLEMENT < 0 || TWOS_COMPLEMENT > 1) begin : guard_2
            dac_coding_TWOS_COMPLEMENT_is_not_0_to_1 stop ();
        end
        if (LEFT_ALIGNED < 0 || LEFT_ALIGNED > 1) begin : guard_3
            dac_coding_LEFT_ALIGNED_is_not_0_to_1 stop ();
        end
    endgenerate

    wire [BITS-1:0] coded = {code[BITS-1] ^ INVERTED, code[BITS-2:0]};

    // There is no vector of no bits, hence the three cases.
    generate
        if (WORD_BITS == BITS) begin : whole
            assign word = coded;
        end else if (LEFT_ALIGNED != 0) begin : left
            assign word = {coded, {(WORD_BITS - BITS){1'b0}}};
        end else begin : right
            assign word = {{(WORD_BITS - BITS){1'b0}}, coded};
        end
    endgenerate
endmodule

`default_nettype wire
