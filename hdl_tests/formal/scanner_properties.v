// The shaper of all orders against its definition, as in shaper_properties. Its feedback is made on the clocks between
// two ticks: the induction looks back for as long.

`default_nettype none

module scanner_properties
`include "shaper_under_test.vh"

`ifndef PROPERTIES_ALONE
    // What makes it inductive.
    wire [1:0] shaper__order;
    wire [BITS-1:0] shaper__kept;
    wire signed [BITS+2:0] shaper__feedback;
    wire [7:0] shaper__further__scanner__digits;
    wire [2:0] shaper__further__scanner__step;
    wire signed [BITS:0] shaper__further__scanner__last;
    wire [7:0] digits = (order == 2 ? 8'd64 : zero) + 8'h55;
    wire signed [WIDE-1:0] held = shaper__feedback;
    wire signed [WIDE-1:0] last = shaper__further__scanner__last;
    always @* begin
        assert (shaper__order == order && shaper__further__scanner__digits == digits);
        assert (shaper__further__scanner__step == since);
        if (plays) begin
            assert ({{WIDE-BITS{1'b0}}, shaper__kept} == m1);
            if (since == 0 || fresh) begin
                assert (held == (order == 3 ? scaled - m2 + m3 : order == 2 ? difference : 0));
                assert (last == (order == 3 ? difference : 0));
            end
        end
    end
`endif
endmodule

`default_nettype wire
