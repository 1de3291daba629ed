// The words of an axis for dac_fit: whether each was written and fits its register. The phase step takes any word.

`default_nettype none

module dac_fit_axis #(
    parameter DAC_BITS = 16,
    parameter INTERPOLATED = 1,
    parameter INDEX_BITS = 11,
    parameter WORD_BITS = 16,
    parameter PERIOD_BITS = 31,
    parameter HARMONICS = 0
) (
    input  wire        clock,
    input  wire        write,
    input  wire [3:0]  address,
    input  wire [31:0] data,
    output wire        fits
);
    localparam FIRST = INTERPOLATED ? 1 : 2;  // without interpolation the phase is not used, and no remainder
    localparam WORDS = HARMONICS != 0 ? 11 : 10;
    localparam HIGH_BITS = WORD_BITS > 21 ? 25 : WORD_BITS + 4;  // of the offset above its low word, signed
    localparam [31:0] MOST_HARMONICS = HARMONICS;

    // A table without interpolation has a word for every advance.
    wire is_held = data >> (INDEX_BITS + 1) == 0 && !(data[INDEX_BITS] && data[INDEX_BITS-1:0] != 0);
    wire is_phase = data >> (PERIOD_BITS - 1) <= 32'd1;
    wire is_period = INTERPOLATED != 0 ? is_phase : is_held;
    wire is_gain = data[31:17] == 15'd0 || data[31:17] == {15{1'b1}};
    wire is_low = data[31:18] == 14'd0;
    wire is_high = data[31:HIGH_BITS-1] == 0 || &data[31:HIGH_BITS-1];
    wire is_code = data[31:DAC_BITS] == 0;
    wire is_harmonics = data <= MOST_HARMONICS;
    wire [10:0] right = {is_harmonics, {4{is_code}}, is_high, is_low, is_gain, is_period, is_phase, 1'b1};
    wire unused = &right;

    reg [WORDS-1:FIRST] wrong;
    wire [WORDS-1:FIRST] wrong_now;
    initial wrong = {WORDS-FIRST{1'b1}};
    always @(posedge clock) wrong <= wrong_now;
    genvar i;
    generate
        for (i = FIRST; i < WORDS; i = i + 1) begin : word
            assign wrong_now[i] = write && address == i ? !right[i] : wrong[i];
        end
    endgenerate

    assign fits = wrong_now == 0;
endmodule

`default_nettype wire
