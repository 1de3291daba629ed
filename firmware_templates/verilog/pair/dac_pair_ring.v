// A value of both axes: two flip-flops that change places on every clock. `now` is that of the axis whose sample is at
// the stage of the ring, `other` that of the other one, which is also the value of the sample that has just left.
//
// A new value of an axis is loaded in the clock before its sample comes.

`default_nettype none

module dac_pair_ring #(
    parameter BITS = 16,
    parameter [31:0] POWER_UP_NOW = 0,  // before the first program
    parameter [31:0] POWER_UP_OTHER = 0
) (
    input  wire            clock,
    input  wire            load,
    input  wire [BITS-1:0] value,
    output reg  [BITS-1:0] now,
    output reg  [BITS-1:0] other
);
    initial begin
        now = POWER_UP_NOW[BITS-1:0];
        other = POWER_UP_OTHER[BITS-1:0];
    end

    always @(posedge clock) begin
        now <= load ? value : other;
        other <= now;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1 || BITS > 32) begin : guard_0
            dac_pair_ring_BITS_is_not_1_to_32 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
