// How often dac_axis_serial adds which word of a cubic table: eight terms for each of b3 to b0.
//
// A term is a word shifted left by the degree and one, not at all, once or twice, or taken off: so b3 is 16 times
// -c0 + 3 c1 - 3 c2 + c3, b2 8 times 3 c0 - 6 c1 + 3 c2, b1 4 times -3 c0 + 3 c2, and b0 twice c0 + 4 c1 + c2.

`default_nettype none

module dac_spline_terms (
    input  wire [1:0] degree,  // of b3 to b0
    input  wire [2:0] term,    // 0, 1: of c0; 2, 3, 4: of c1; 5, 6: of c2; 7: of c3
    output reg        once,
    output reg        twice,
    output wire       minus
);
    localparam [1:0] NO = 2'b00, ONCE = 2'b01, TWICE = 2'b10;

    always @*
        case ({degree, term})
            {2'd3, 3'd0}, {2'd3, 3'd2}, {2'd3, 3'd5}, {2'd3, 3'd7}: {twice, once} = ONCE;
            {2'd3, 3'd3}, {2'd3, 3'd6}: {twice, once} = TWICE;
            {2'd2, 3'd0}, {2'd2, 3'd5}: {twice, once} = ONCE;
            {2'd2, 3'd1}, {2'd2, 3'd2}, {2'd2, 3'd3}, {2'd2, 3'd4}, {2'd2, 3'd6}: {twice, once} = TWICE;
            {2'd1, 3'd0}, {2'd1, 3'd5}: {twice, once} = ONCE;
            {2'd1, 3'd1}, {2'd1, 3'd6}: {twice, once} = TWICE;
            {2'd0, 3'd0}, {2'd0, 3'd5}: {twice, once} = ONCE;
            {2'd0, 3'd2}, {2'd0, 3'd3}: {twice, once} = TWICE;
            default: {twice, once} = NO;
        endcase

    wire of_c0 = term[2:1] == 2'd0;
    wire of_c1 = term == 3'd2 || term == 3'd3 || term == 3'd4;
    wire of_c2 = term == 3'd5 || term == 3'd6;
    assign minus = degree == 2'd3 ? of_c0 || of_c2 : degree == 2'd2 ? of_c1 : degree == 2'd1 && of_c0;
endmodule

`default_nettype wire
