// The divisions of a line, a bit in a clock or in three: its place in the frame, and a word between two knots.
//
//   place    quotient = floor((line modulo whole) 2^BITS / whole), by a `reduce` and a `twice` for each bit
//   search   rest = line modulo whole, by `reduce` until `reduces` is low
//   between  quotient = floor((here (whole - part) + there part + whole / 2) / whole), for which part = rest: for each
//            of the 18 bits of the unsigned words here and there a `twice`, an `add` and a `reduce`; then a `half` and
//            a `reduce`. Where both words have a bit, the quotient grows by 1, and the rest stays.

`default_nettype none

module dac_slow_divide #(
    parameter REST_BITS = 18,     // twice the greatest divisor fits
    parameter QUOTIENT_BITS = 24  // of words of 18 bits 20 or more
) (
    input  wire                     clock,
    input  wire                     enable,
    input  wire                     load_rest,
    input  wire [REST_BITS-1:0]     value,      // of the rest
    input  wire                     load_whole,
    input  wire [REST_BITS-1:0]     divisor,
    input  wire                     load_part,  // the rest becomes the part, and 0
    input  wire                     twice,
    input  wire                     add,
    input  wire                     reduce,
    input  wire                     half,
    input  wire                     here,       // with `add`: a bit of either word
    input  wire                     there,
    output wire                     reduces,    // the rest is not below the divisor
    output reg  [QUOTIENT_BITS-1:0] quotient
);
    reg [REST_BITS-1:0] rest, whole, part;
    wire [REST_BITS-1:0] whole_less_part = whole - part;
    wire [REST_BITS-1:0] from = twice ? {rest[REST_BITS-2:0], 1'b0} : rest;
    wire [REST_BITS-1:0] less = from - whole;
    wire [REST_BITS-1:0] more =
        half ? {1'b0, whole[REST_BITS-1:1]} :
        here == there ? {REST_BITS{1'b0}} : here ? whole_less_part : part;
    assign reduces = !less[REST_BITS-1];

    always @(posedge clock)
        if (enable) begin
            if (load_whole) whole <= divisor;
            if (load_part) part <= rest;
            if (load_rest)
                rest <= value;
            else if (load_part)
                rest <= {REST_BITS{1'b0}};
            else if (twice || reduce)
                rest <= reduces ? less : from;
            else if (add || half)
                rest <= rest + more;
            if (twice)
                quotient <= {quotient[QUOTIENT_BITS-2:0], reduces};
            else if ((add && here && there) || (reduce && reduces))
                quotient <= quotient + 1;
        end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (REST_BITS < 2) begin : guard_0
            dac_slow_divide_REST_BITS_is_less_than_2 stop ();
        end
        if (QUOTIENT_BITS < 2) begin : guard_1
            dac_slow_divide_QUOTIENT_BITS_is_less_than_2 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
