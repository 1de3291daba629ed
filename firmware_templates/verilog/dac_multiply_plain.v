// result = floor((a b + low) / 2^DROP), exact, one a clock: a `*` between registers, for parts with multiplier
// blocks.
//
// a and b enter together, low one clock later; the result is there three clocks after a. What a has above BLOCK_BITS,
// the width of a block's port, would take another block; its lowest bits, often two, are multiplied in look-up tables
// instead.

`default_nettype none

module dac_multiply_plain #(
    parameter A_BITS = 17,
    parameter B_BITS = 16,
    parameter DROP = 10,
    parameter LOW_BITS = DROP,
    parameter RESULT_BITS = 23,
    parameter BLOCK_BITS = 18
) (
    input  wire                          clock,
    input  wire signed [A_BITS-1:0]      a,
    input  wire signed [B_BITS-1:0]      b,
    input  wire [LOW_BITS-1:0]           low,
    output reg  signed [RESULT_BITS-1:0] result
);
    localparam SPLIT = A_BITS > BLOCK_BITS ? A_BITS - BLOCK_BITS : 0;  // bits of a that a block has no port for
    localparam PRODUCT_BITS = A_BITS + B_BITS + 1;

    reg signed [A_BITS-1:0] a_in;
    reg signed [B_BITS-1:0] b_in;
    reg signed [A_BITS-SPLIT+B_BITS-1:0] product;
    reg signed [PRODUCT_BITS-1:0] rest;

    wire signed [A_BITS-SPLIT-1:0] a_high = a_in[A_BITS-1:SPLIT];

    // The lowest bits of a, one row of b each.
    wire signed [PRODUCT_BITS-1:0] rows [0:SPLIT];
    assign rows[0] = {{PRODUCT_BITS-LOW_BITS{1'b0}}, low};
    genvar i;
    generate
        for (i = 0; i < SPLIT; i = i + 1) begin : row
            wire signed [PRODUCT_BITS-1:0] wide = {{PRODUCT_BITS-B_BITS{b_in[B_BITS-1]}}, b_in};
            assign rows[i+1] = rows[i] + (a_in[i] ? wide <<< i : {PRODUCT_BITS{1'b0}});
        end
    endgenerate

    wire signed [PRODUCT_BITS-1:0] product_wide = {{SPLIT+1{product[A_BITS-SPLIT+B_BITS-1]}}, product} <<< SPLIT;
    wire signed [PRODUCT_BITS-1:0] floored = (product_wide + rest) >>> DROP;
    wire unused = &floored;

    always @(posedge clock) begin
        a_in <= a;
        b_in <= b;
        product <= a_high * b_in;
        rest <= rows[SPLIT];
        result <= floored[RESULT_BITS-1:0];
    end
endmodule

`default_nettype wire
