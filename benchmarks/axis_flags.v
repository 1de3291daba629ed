// An axis with a cubic table and the delay of its flags: as inputs these would be more than a part has pins.

`default_nettype none

module axis_flags #(
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
    input  wire                  tick,
    input  wire                  load,
    input  wire                  running,
    input  wire                  begins,
    input  wire                  bank,
    input  wire                  restart,
    input  wire                  advance,
    output wire [DAC_BITS-1:0]   code,
    output wire                  reached,
    output wire                  clamped
);
    localparam FLAGS = 59;  // LATENCY - 3 of dac_axis

    reg [FLAGS-2:0] ticks, loads, runnings;
    always @(posedge clock) begin
        ticks <= {ticks[FLAGS-3:0], tick};
        loads <= {loads[FLAGS-3:0], load};
        runnings <= {runnings[FLAGS-3:0], running};
    end

    dac_axis #(
        .INTERPOLATED(INTERPOLATED), .INDEX_BITS(INDEX_BITS), .WORD_BITS(WORD_BITS), .DAC_BITS(DAC_BITS),
        .PERIOD_BITS(PERIOD_BITS)
    ) axis (
        .clock(clock), .write(write), .write_address(write_address), .write_data(write_data),
        .table_write(table_write), .table_address(table_address), .table_data(table_data), .take(take),
        .ticks({ticks, tick}), .loads({loads, load}), .runnings({runnings, running}), .begins(begins), .bank(bank),
        .restart(restart), .advance(advance), .code(code), .reached(reached), .clamped(clamped)
    );
endmodule

`default_nettype wire
