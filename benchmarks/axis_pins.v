// An axis with a cubic table by itself: of its flags, which are more than a part has pins, those that it uses. The
// others, in the middle of each vector, are 0.

`default_nettype none

module axis_pins #(
    parameter INTERPOLATED = 3,
    parameter INDEX_BITS = 7,
    parameter WORD_BITS = 14,
    parameter DAC_BITS = 16,
    parameter PERIOD_BITS = 25
) (
    input  wire                  clock,
    input  wire                  write,
    input  wire [3:0]            write_address,
    input  wire [31:0]           write_data,
    input  wire                  table_write,
    input  wire [INDEX_BITS-1:0] table_address,
    input  wire [WORD_BITS-1:0]  table_data,
    input  wire                  take,
    input  wire [31:0]           first_ticks,
    input  wire [6:0]            last_ticks,
    input  wire                  first_load,
    input  wire [17:0]           last_loads,
    input  wire [2:0]            last_runnings,
    input  wire                  begins,
    input  wire                  bank,
    input  wire                  restart,
    input  wire                  advance,
    output wire [DAC_BITS-1:0]   code,
    output wire                  reached,
    output wire                  clamped
);
    localparam FLAGS = 59;  // of each kind: dac_axis has LATENCY - 3

    dac_axis #(
        .INTERPOLATED(INTERPOLATED), .INDEX_BITS(INDEX_BITS), .WORD_BITS(WORD_BITS), .DAC_BITS(DAC_BITS),
        .PERIOD_BITS(PERIOD_BITS)
    ) axis (
        .clock(clock), .write(write), .write_address(write_address), .write_data(write_data),
        .table_write(table_write), .table_address(table_address), .table_data(table_data), .take(take),
        .ticks({last_ticks, {FLAGS-39{1'b0}}, first_ticks}), .loads({last_loads, {FLAGS-19{1'b0}}, first_load}),
        .runnings({last_runnings, {FLAGS-3{1'b0}}}), .begins(begins), .bank(bank), .restart(restart),
        .advance(advance), .code(code), .reached(reached), .clamped(clamped)
    );
endmodule

`default_nettype wire
