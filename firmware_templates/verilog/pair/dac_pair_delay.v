// Delays a bundle of signals by 2 to 64 clocks, in a memory instead of flip-flops.

`default_nettype none

module dac_pair_delay #(
    parameter BITS = 8,
    parameter CLOCKS = 16
) (
    input  wire            clock,
    input  wire [5:0]      at,   // counts clocks, from 0 at power-up
    input  wire [BITS-1:0] in,
    output reg  [BITS-1:0] out
);
    // The word of CLOCKS - 1 clocks ago. As a sum, a synthesis sees that it is never the one that is written, and adds
    // no logic for that case.
    localparam [31:0] BEHIND = 65 - CLOCKS;
    wire [5:0] from = at + BEHIND[5:0];

    reg [BITS-1:0] words [0:63];
    integer i;
    initial begin
        for (i = 0; i < 64; i = i + 1) words[i] = {BITS{1'b0}};
        out = {BITS{1'b0}};
    end

    always @(posedge clock) begin
        words[at] <= in;
        out <= words[from];
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1) begin : guard_0
            dac_pair_delay_BITS_is_less_than_1 stop ();
        end
        if (CLOCKS < 2 || CLOCKS > 65) begin : guard_1
            dac_pair_delay_CLOCKS_is_not_2_to_65 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
