// In the place of dac_axis_serial for the proofs: its ports, the time it takes cut short, and what it relies on from
// the tick until its code is there: the bank that plays, which nobody writes, and whether a scan plays.

`default_nettype none

module dac_axis_serial #(
    parameter INTERPOLATED = 1,
    parameter INDEX_BITS = 11,
    parameter WORD_BITS = 16,
    parameter DAC_BITS = 16,
    parameter PERIOD_BITS = 31,
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
    input  wire                  bank,
    input  wire                  loaded,
    input  wire                  tick,
    input  wire                  restart,
    input  wire                  begins,
    input  wire                  advance,
    input  wire                  running,
    output wire                  done,
    output wire [DAC_BITS-1:0]   code,
    output wire                  reached,
    output wire                  clamped
);
    reg [5:0] works;  // bit i: i + 1 clocks after the tick
    reg bank_of_tick, running_of_tick;
    initial works = 0;
    always @(posedge clock) begin
        works <= {works[4:0], tick};
        if (tick) bank_of_tick <= bank;
        if (tick) running_of_tick <= advance;
    end
    assign done = works[5];
    assign code = {DAC_BITS{bank}};
    assign reached = restart;
    assign clamped = loaded;

`ifndef PROPERTIES_ALONE
    always @* begin
        if (tick) assert (works == 0);
        if (works != 0) assert (bank == bank_of_tick);
    end
`endif
endmodule

`default_nettype wire
