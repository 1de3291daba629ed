// dac_memory and dac_product with random inputs. A line a clock: what each is given, and what it gives.

`timescale 1ns / 1ps
`default_nettype none

module cells_bench #(
    parameter BITS = 16,
    parameter ADDRESS_BITS = 6,
    parameter A_BITS = 17,
    parameter B_BITS = 16,
    parameter CLOCKS = 4000
);
    reg clock = 0, write = 0;
    reg [ADDRESS_BITS-1:0] write_address = 0, address = 0;
    reg [BITS-1:0] write_data = 0;
    reg signed [A_BITS-1:0] a = 0;
    reg signed [B_BITS-1:0] b = 0;
    wire [BITS-1:0] word;
    wire signed [A_BITS+B_BITS-1:0] product;
    integer seed = 1, left = CLOCKS;
    // Most addresses are among a few, at both ends, so that words are read that were written.
    wire [31:0] few = {{26{few_bits[6]}}, few_bits[5:0]};
    reg [6:0] few_bits = 0;

    dac_memory #(.BITS(BITS), .ADDRESS_BITS(ADDRESS_BITS)) memory (
        .clock(clock), .write(write), .write_address(write_address), .write_data(write_data), .address(address),
        .word(word)
    );
    dac_product #(.A_BITS(A_BITS), .B_BITS(B_BITS)) multiplier (.clock(clock), .a(a), .b(b), .product(product));

    initial begin
        while (left > 0) begin
            write = $random(seed);
            write_data = $random(seed);
            few_bits = $random(seed);
            #1 write_address = few ^ (left[3:0] == 0 ? $random(seed) : 0);
            few_bits = $random(seed);
            #1 address = few;
            a = $random(seed);
            b = $random(seed);
            if (left[4:0] == 0) {a, b} = {1'b1, {A_BITS-1{1'b0}}, 1'b1, {B_BITS-1{1'b0}}};
            #4 clock = 1;
            #1 $display("%0d %0d %0d %0d %0d %0d %0d %0d", write, write_address, write_data, address, word, a, b, product);
            #4 clock = 0;
            left = left - 1;
        end
        $finish;
    end
endmodule

`default_nettype wire
