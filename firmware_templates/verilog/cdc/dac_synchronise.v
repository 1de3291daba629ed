// Brings a signal of another clock domain, or of a pin, to `clock`: a chain of flip-flops and a detector of edges.
//
// `in` may change at any time. If it changes at an edge of `clock`, the first flip-flop may stay between both levels
// for a while; the others give it STAGES - 1 clocks to settle, to the old or to the new level. `out` follows by STAGES
// clocks, or by one more. One bit only: bits of a bus would arrive on different clocks.
//
// `in` has to come from a pin or a flip-flop, not from gates, whose glitches would be taken for changes. It has to stay
// longer than a clock at each level, or the change may be missed: let the source of shorter pulses toggle a flip-flop
// for each of them, and take PULSE = 2.
//
// The first flip-flop is called dac_synchronise_first: constraints find it by this name in every hierarchy, and take
// the path to it out of the timing analysis (format `constraints` of a build). ASYNC_REG makes Vivado place the chain
// together and keep it; the other attributes keep it in Synplify and Quartus.

`default_nettype none

module dac_synchronise #(
    parameter STAGES = 2,            // flip-flops of the chain: 2, or more at high clock rates
    parameter PULSE = 0,             // 0: out is the level; 1: a pulse of a clock for each rise; 2: for each change
    parameter POWER_UP = PULSE == 1  // level of the chain at power-up; 1: a level that is high from then on is no rise
) (
    input  wire clock,
    input  wire in,
    output wire out
);
    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (STAGES < 2 || STAGES > 8) begin : guard_0
            dac_synchronise_STAGES_is_not_2_to_8 stop ();
        end
        if (PULSE < 0 || PULSE > 2) begin : guard_1
            dac_synchronise_PULSE_is_not_0_to_2 stop ();
        end
        if (POWER_UP != 0 && POWER_UP != 1) begin : guard_2
            dac_synchronise_POWER_UP_is_not_0_to_1 stop ();
        end
    endgenerate

    localparam LATER = STAGES < 2 ? 1 : STAGES - 1;  // flip-flops after the first
    localparam LEVEL = POWER_UP != 0;

    (* ASYNC_REG = "TRUE", syn_preserve = 1, preserve *)
    reg dac_synchronise_first;
    (* ASYNC_REG = "TRUE", syn_preserve = 1, preserve *)
    reg [LATER-1:0] dac_synchronise_later;
    wire [LATER:0] chain = {dac_synchronise_later, dac_synchronise_first};
    initial begin
        dac_synchronise_first = LEVEL;
        dac_synchronise_later = {LATER{LEVEL}};
    end
    always @(posedge clock) begin
        dac_synchronise_first <= in;
        dac_synchronise_later <= chain[LATER-1:0];
    end
    wire level = chain[LATER];

    generate
        if (PULSE == 0) begin : no_edges
            assign out = level;
        end else begin : edges
            reg level_before;
            initial level_before = LEVEL;
            always @(posedge clock) level_before <= level;
            assign out = level != level_before && (level || PULSE == 2);
        end
    endgenerate
endmodule

`default_nettype wire
