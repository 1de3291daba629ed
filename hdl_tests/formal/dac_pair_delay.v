// In the place of dac_pair_delay for the proofs: the same delay in flip-flops. pair_delay_properties proves that the
// output of the module is that of this one.

`default_nettype none

module dac_pair_delay #(
    parameter BITS = 8,
    parameter CLOCKS = 16
) (
    input  wire            clock,
    input  wire [5:0]      at,
    input  wire [BITS-1:0] in,
    output wire [BITS-1:0] out
);
    reg [BITS*CLOCKS-1:0] line;
    initial line = 0;
    always @(posedge clock) line <= {line[BITS*(CLOCKS-1)-1:0], in};
    assign out = line[BITS*CLOCKS-1 -: BITS];
endmodule

`default_nettype wire
