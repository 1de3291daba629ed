// The offset of the output stage: a program register of two words. It holds offset - code_min + a half, to round;
// without the half where dac_shaper has it.
//
// The low part is used with the product and the high part after it; each part has its own load.

`default_nettype none

module dac_offset #(
    parameter BITS = 38,       // bits of the sum, signed; 20 .. 44
    parameter LOW_BITS = 20,
    parameter GAIN_Q = 20,     // fraction bits of the gain
    parameter CODE_BITS = 16,
    parameter HALF = 1
) (
    input  wire                     clock,
    input  wire                     write_low,   // bits 17..0
    input  wire                     write_high,  // bits 18 and up
    input  wire [25:0]              data,
    input  wire [CODE_BITS:0]       minus_min,   // -code_min of the idle program, signed
    input  wire                     load_low,
    input  wire                     load_high,
    output reg  [LOW_BITS-1:0]      low,
    output reg  [BITS-LOW_BITS-1:0] high
);
    wire unused = &data;
    reg [BITS-1:0] idle;
    wire [BITS-1:0] playing =
        idle + {{BITS-GAIN_Q-CODE_BITS-1{minus_min[CODE_BITS]}}, minus_min, HALF != 0, {GAIN_Q-1{1'b0}}};

    initial begin
        low = 0;
        high = 0;
    end

    always @(posedge clock) begin
        if (write_low) idle[17:0] <= data[17:0];
        if (write_high) idle[BITS-1:18] <= data[BITS-19:0];
        if (load_low) low <= playing[LOW_BITS-1:0];
        if (load_high) high <= playing[BITS-1:LOW_BITS];
    end
endmodule

`default_nettype wire
