// In the place of dac_slow_divide for the proofs: it notes what is asked of it, in which order, and divides nothing.
//
// `phase` is that of a place (LOADED, WRAPPED), of a search (SOUGHT, SPACED), of a word (BIT, TWICE, ADDED, HALVED,
// NEAREST), or WRONG where an operation comes out of its turn; `bits` are those of the place, or of both words.

`default_nettype none

module dac_slow_divide #(
    parameter REST_BITS = 18,
    parameter QUOTIENT_BITS = 24
) (
    input  wire                     clock,
    input  wire                     enable,
    input  wire                     load_rest,
    input  wire [REST_BITS-1:0]     value,
    input  wire                     load_whole,
    input  wire [REST_BITS-1:0]     divisor,
    input  wire                     load_part,
    input  wire                     twice,
    input  wire                     add,
    input  wire                     reduce,
    input  wire                     half,
    input  wire                     here,
    input  wire                     there,
    output wire                     reduces,
    output reg  [QUOTIENT_BITS-1:0] quotient
);
    localparam [3:0] BIT = 4'd0, TWICE = 4'd1, ADDED = 4'd2, HALVED = 4'd3, NEAREST = 4'd4, WRONG = 4'd7;
    localparam [3:0] LOADED = 4'd8, WRAPPED = 4'd9, SOUGHT = 4'd10, SPACED = 4'd11;
    (* anyseq *) wire [QUOTIENT_BITS-1:0] any;
    reg [3:0] phase;
    reg [5:0] bits;
    reg [REST_BITS-1:0] given, rest, whole, part;
    reg [17:0] u, v;
    assign reduces = rest >= whole;
    always @(posedge clock)
        if (enable) begin
            if (twice || add || reduce) quotient <= any;
            if (load_rest) {given, rest} <= {value, value};
            if (load_whole) whole <= divisor;
            if (load_part) {part, rest} <= {rest, {REST_BITS{1'b0}}};
            if (reduce && reduces) rest <= rest - whole;
            if (add) {u, v} <= {u[16:0], here, v[16:0], there};
            case ({load_rest, load_whole, load_part, twice, add, reduce, half})
                7'b0000000: ;
                7'b1100000: phase <= LOADED;
                7'b1000000: phase <= SOUGHT;
                7'b0100000: phase <= phase == SOUGHT ? SPACED : WRONG;
                7'b0010000: phase <= phase == SPACED ? BIT : WRONG;
                7'b0001000: phase <= phase == WRAPPED ? WRAPPED : phase == BIT ? TWICE : WRONG;
                7'b0000100: phase <= phase == TWICE ? ADDED : WRONG;
                7'b0000010: phase <= phase == LOADED ? WRAPPED : phase == SPACED ? SPACED : phase == ADDED ? BIT :
                                     phase == HALVED ? NEAREST : WRONG;
                7'b0000001: phase <= phase == BIT ? HALVED : WRONG;
                default: phase <= WRONG;
            endcase
            if (load_part || load_rest)
                bits <= 0;
            else if (add || (twice && phase == WRAPPED))
                bits <= bits + 1;
        end
endmodule

`default_nettype wire
