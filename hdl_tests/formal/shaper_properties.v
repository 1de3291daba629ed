// The shaper of first and second order against its definition: whatever fractions, words, beginnings and ticks come,
// each tick's codes are those of docs/sequencer.md, and no code is further from its unrounded value than it says there.

`default_nettype none

module shaper_properties
`include "shaper_under_test.vh"

    // Not vacuous: what is fed back adds as much as it can.
    always @* cover (judged && order == SHAPING && given == SHAPING);

`ifndef PROPERTIES_ALONE
    // What makes it inductive.
    wire [1:0] shaper__order;
    wire [BITS-1:0] shaper__kept;
    wire signed [BITS+2:0] shaper__feedback;
    wire signed [WIDE-1:0] held = shaper__feedback;
    always @* begin
        assert (shaper__order == order);
        if (plays) begin
            assert ({{WIDE-BITS{1'b0}}, shaper__kept} == m1);
            assert (held == (order == 2 ? difference : 0));
        end
    end
`endif
endmodule

`default_nettype wire
