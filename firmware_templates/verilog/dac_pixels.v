// Pixel starts: the ticks i of a window of `count` ticks at which floor(i pixels / count) has grown, and the first one.
//
// By an accumulator: no multiplier, no divider. The strobe is there one clock after its tick.

`default_nettype none

module dac_pixels #(
    parameter BITS = 24
) (
    input  wire                   clock,
    input  wire                   tick,
    input  wire                   opens,   // the first tick of a window
    input  wire                   imaging,
    input  wire signed [BITS+1:0] pixels_less_1,  // pixels per window, from the program
    input  wire signed [BITS+1:0] pixels_less_count_less_1,  // negative: the window has a tick for each pixel
    output reg                    pixel
);
    // i pixels - count (strobes), less another count, so that its sign decides; below `pixels`, and not below -count.
    reg signed [BITS+1:0] behind;
    initial behind = 0;
    wire starts = opens || !behind[BITS+1];

    initial pixel = 1'b0;

    always @(posedge clock)
        if (tick) begin
            pixel <= imaging && starts;
            // Minus the inverse is plus the value and the 1 that it lacks.
            behind <= (opens ? {BITS+2{1'b0}} : behind) - ~(starts ? pixels_less_count_less_1 : pixels_less_1);
        end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1) begin : guard_0
            dac_pixels_BITS_is_less_than_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
