// In the place of dac_whole for the proofs: any program is whole, or is not. What is whole is tested in test_whole.py.

`default_nettype none

module dac_whole #(
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter HARMONICS = 0
) (
    input  wire        clock,
    input  wire        write,
    input  wire [2:0]  region,
    input  wire [15:0] address,
    input  wire [31:0] data,
    input  wire        take,
    output wire        whole
);
    (* anyseq *) wire any;
    assign whole = any;
endmodule

`default_nettype wire
