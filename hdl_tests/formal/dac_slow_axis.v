// In the place of dac_slow_axis for the proofs: of the words of both halves only their label, which any write sets.

`default_nettype none

module dac_slow_axis #(
    parameter INTERPOLATED = 3,
    parameter INDEX_BITS = 6,
    parameter WORD_BITS = 16,
    parameter DAC_BITS = 16,
    parameter PERIOD_BITS = 25,
    parameter SHAPING = 0,
    parameter [63:0] POWER_UP_CODE = 0
) (
    input  wire                  clock,
    input  wire                  write,
    input  wire [3:0]            write_address,
    input  wire [31:0]           write_data,
    input  wire                  table_write,
    input  wire [INDEX_BITS-1:0] table_address,
    input  wire [WORD_BITS-1:0]  table_data,
    input  wire                  write_offset,
    input  wire [43:0]           offset,
    input  wire                  write_ramp,
    input  wire [43:0]           ramp,
    output wire [43:0]           next_offset,
    input  wire                  half,
    input  wire                  loaded,
    input  wire                  tick,
    input  wire                  next,
    input  wire                  line,
    input  wire                  begins,
    input  wire                  runs,
    output wire                  done,
    output wire [DAC_BITS-1:0]   code,
    output wire                  reached,
    output wire                  clamped
);
    reg [2:0] label_0, label_1;
    reg [8:0] works;  // bit i: i + 1 clocks after the tick
    initial {label_0, label_1, works} = 0;
    always @(posedge clock) begin
        if (write && half) label_0 <= write_data[2:0];
        if (write && !half) label_1 <= write_data[2:0];
        works <= {works[7:0], tick};
    end
    assign done = works[8];
    assign next_offset = 0;
    assign {code, reached, clamped} = 0;
endmodule

`default_nettype wire
