// Delays a bundle of signals by so many clocks, 0 or more.

`default_nettype none

module dac_delay #(
    parameter BITS = 1,
    parameter CLOCKS = 1
) (
    input  wire            clock,
    input  wire [BITS-1:0] in,
    output wire [BITS-1:0] out
);
    generate
        if (CLOCKS == 0) begin : none
            wire unused = clock;
            assign out = in;
        end else begin : some
            reg [BITS*CLOCKS-1:0] line;
            initial line = 0;
            if (CLOCKS == 1) begin : one
                always @(posedge clock) line <= in;
            end else begin : more
                always @(posedge clock) line <= {line[BITS*(CLOCKS-1)-1:0], in};
            end
            assign out = line[BITS*CLOCKS-1 -: BITS];
        end
    endgenerate

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1) begin : guard_0
            dac_delay_BITS_is_less_than_1 stop ();
        end
        if (CLOCKS < 0) begin : guard_1
            dac_delay_CLOCKS_is_less_than_0 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
