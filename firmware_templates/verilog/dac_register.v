// A program register: what the host writes waits in the idle word until `load` makes it the playing one.
//
// The two are separate flip-flops, so that all registers of a program change on the clock of their own `load`: in a
// pipeline the load travels with the first sample of the new program, and every stage changes exactly with it.

`default_nettype none

module dac_register #(
    parameter BITS = 32,
    parameter [63:0] POWER_UP = 0  // the playing value before the first program
) (
    input  wire            clock,
    input  wire            write,
    input  wire [BITS-1:0] data,
    input  wire            load,
    output reg  [BITS-1:0] value
);
    reg [BITS-1:0] idle;
    initial idle = 0;

    initial value = POWER_UP[BITS-1:0];

    always @(posedge clock) begin
        if (write) idle <= data;
        if (load) value <= idle;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1 || BITS > 64) begin : guard_0
            dac_register_BITS_is_not_1_to_64 stop ();
        end
        if (POWER_UP >> BITS != 64'd0) begin : guard_1
            dac_register_POWER_UP_has_more_than_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
