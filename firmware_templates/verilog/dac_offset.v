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

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 20 || BITS > 44) begin : guard_0
            dac_offset_BITS_is_not_20_to_44 stop ();
        end
        if (LOW_BITS < 1 || LOW_BITS >= BITS) begin : guard_1
            dac_offset_LOW_BITS_is_not_1_to_less_than_BITS stop ();
        end
        if (GAIN_Q < 1 || CODE_BITS < 1 || GAIN_Q + CODE_BITS >= BITS) begin : guard_2
            dac_offset_GAIN_Q_and_CODE_BITS_are_not_less_than_BITS stop ();
        end
        if (HALF < 0 || HALF > 1) begin : guard_3
            dac_offset_HALF_is_not_0_to_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
