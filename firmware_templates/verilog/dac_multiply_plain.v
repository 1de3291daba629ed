// result = floor((a b + low) / 2^DROP), exact, one a clock, for parts with multiplier blocks: dac_product is the block.
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

    wire signed [A_BITS-SPLIT+B_BITS-1:0] product;
    reg signed [PRODUCT_BITS-1:0] rest;

    dac_product #(.A_BITS(A_BITS - SPLIT), .B_BITS(B_BITS)) block (
        .clock(clock), .a(a[A_BITS-1:SPLIT]), .b(b), .product(product)
    );

    // The lowest bits of a: a row of b for each. Their sum has a register where the block has those of its factors.
    wire signed [PRODUCT_BITS-1:0] lowest;
    genvar i;
    generate
        if (SPLIT > 0) begin : split
            wire signed [PRODUCT_BITS-1:0] wide = {{PRODUCT_BITS-B_BITS{b[B_BITS-1]}}, b};
            wire signed [PRODUCT_BITS-1:0] rows [0:SPLIT];
            assign rows[0] = {PRODUCT_BITS{1'b0}};
            for (i = 0; i < SPLIT; i = i + 1) begin : row
                assign rows[i+1] = rows[i] + (a[i] ? wide <<< i : {PRODUCT_BITS{1'b0}});
            end
            reg signed [PRODUCT_BITS-1:0] sum;
            always @(posedge clock) sum <= rows[SPLIT];
            assign lowest = sum;
        end else begin : whole
            assign lowest = {PRODUCT_BITS{1'b0}};
        end
    endgenerate

    wire signed [PRODUCT_BITS-1:0] product_wide = {{SPLIT+1{product[A_BITS-SPLIT+B_BITS-1]}}, product} <<< SPLIT;
    wire signed [PRODUCT_BITS-1:0] floored = (product_wide + rest) >>> DROP;
    wire unused = &floored;

    always @(posedge clock) begin
        rest <= lowest + {{PRODUCT_BITS-LOW_BITS{1'b0}}, low};
        result <= floored[RESULT_BITS-1:0];
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (A_BITS < 1) begin : guard_0
            dac_multiply_plain_A_BITS_is_less_than_1 stop ();
        end
        if (B_BITS < 1) begin : guard_1
            dac_multiply_plain_B_BITS_is_less_than_1 stop ();
        end
        if (DROP < 0) begin : guard_2
            dac_multiply_plain_DROP_is_less_than_0 stop ();
        end
        if (LOW_BITS < 1 || LOW_BITS > A_BITS + B_BITS) begin : guard_3
            dac_multiply_plain_LOW_BITS_is_not_1_to_the_bits_of_a_product stop ();
        end
        if (RESULT_BITS < 1 || RESULT_BITS > A_BITS + B_BITS + 1) begin : guard_4
            dac_multiply_plain_RESULT_BITS_is_not_1_to_the_bits_of_a_sum stop ();
        end
        if (BLOCK_BITS < 2) begin : guard_5
            dac_multiply_plain_BLOCK_BITS_is_less_than_2 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
