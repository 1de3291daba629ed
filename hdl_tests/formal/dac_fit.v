// In the place of dac_fit for the proofs: any program fits, or does not. What fits is tested against the registers'
// widths in test_fit.py.

`default_nettype none

module dac_fit #(
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter Y_WORD_BITS = 16,
    parameter TICK_BITS = 24,
    parameter LINE_BITS = 16,
    parameter X_PERIOD_BITS = 25,
    parameter Y_PERIOD_BITS = 31,
    parameter HARMONICS = 0,
    parameter SHAPING = 0
) (
    input  wire        clock,
    input  wire [31:0] data,
    input  wire [3:0]  address,
    input  wire        scan_write,
    input  wire        x_write,
    input  wire        y_write,
    input  wire        discard,
    output wire        fits
);
    (* anyseq *) wire any;
    assign fits = any;
endmodule

`default_nettype wire
