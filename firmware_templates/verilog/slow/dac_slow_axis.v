// One axis with a slow part: the offset, which grows by the ramp with every tick, and an axis in little area behind it.
//
// Its banks are the line that plays and the next one, whose words are written meanwhile. On two of the 3 clocks before
// it begins a tick, the offset of the tick is written over that of the last one, and nothing else.

`default_nettype none

module dac_slow_axis #(
    parameter INTERPOLATED = 3,
    parameter INDEX_BITS = 6,
    parameter WORD_BITS = 16,
    parameter DAC_BITS = 16,
    parameter PERIOD_BITS = 25,
    parameter SHAPING = 0,         // highest order of shaping
    parameter [63:0] POWER_UP_CODE = 0
) (
    input  wire                  clock,
    // words of the next line
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
    output reg  [43:0]           next_offset,
    input  wire                  half,       // that plays, from the clock after the tick on
    input  wire                  loaded,
    input  wire                  tick,
    input  wire                  next,       // with the tick: the halves change
    input  wire                  line,       // with the tick: the first one of a line
    input  wire                  begins,     // with the tick: a scan or a program begins
    input  wire                  runs,       // with the tick: a scan plays
    output wire                  done,
    output wire [DAC_BITS-1:0]   code,
    output wire                  reached,
    output wire                  clamped
);
    localparam [3:0] OFFSET_LOW = 4'd4, OFFSET_HIGH = 4'd5;

    reg [43:0] next_ramp, at, by;
    reg [2:0] ticks;  // bit i: i + 1 clocks ago
    reg restarts, begin_waits, running;
    initial begin
        ticks = 3'd0;
        running = 1'b0;
    end
    always @(posedge clock) begin
        if (write_offset) next_offset <= offset;
        if (write_ramp) next_ramp <= ramp;
        ticks <= {ticks[1:0], tick};
        if (tick) begin
            at <= next ? next_offset : at + by;
            if (next) by <= next_ramp;
            restarts <= line;
            begin_waits <= begins;
            running <= runs;
        end
    end

    wire of_offset = ticks[0] || ticks[1];
    dac_axis_serial #(
        .INTERPOLATED(INTERPOLATED), .INDEX_BITS(INDEX_BITS), .WORD_BITS(WORD_BITS), .DAC_BITS(DAC_BITS),
        .PERIOD_BITS(PERIOD_BITS), .SHAPING(SHAPING), .POWER_UP_CODE(POWER_UP_CODE)
    ) axis (
        .clock(clock), .write(of_offset || write),
        .write_address(ticks[0] ? OFFSET_LOW : ticks[1] ? OFFSET_HIGH : write_address),
        .write_data(ticks[0] ? {14'd0, at[17:0]} : ticks[1] ? {{6{at[43]}}, at[43:18]} : write_data),
        .table_write(table_write), .table_address(table_address), .table_data(table_data), .bank(half ^ of_offset),
        .loaded(loaded), .tick(ticks[2]), .restart(restarts), .begins(begin_waits), .advance(running),
        .running(running), .done(done), .code(code), .reached(reached), .clamped(clamped)
    );
endmodule

`default_nettype wire
