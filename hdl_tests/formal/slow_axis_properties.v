// dac_slow_axis, whatever the engine writes: tick k of a line plays with the offset of the line and k times its ramp,
// which land in the half that plays; every other word lands in the half that does not. An offset is cut into its words,
// low and high, and the axis begins behind them, with the flags of its tick.
//
// Asked of the surroundings: nothing is written on the two clocks after a tick (slow_engine_properties proves it of the
// engine), and a tick comes 4 clocks after the last one or later. Lines have up to 4 ticks here: a step of the
// induction is a tick, so their number is no part of the argument.

`default_nettype none

module slow_axis_properties (
    input wire        clock,
    input wire        write,
    input wire [3:0]  write_address,
    input wire [31:0] write_data,
    input wire        table_write,
    input wire [2:0]  table_address,
    input wire [7:0]  table_data,
    input wire        write_offset,
    input wire [43:0] offset,
    input wire        write_ramp,
    input wire [43:0] ramp,
    input wire        tick,
    input wire        next,
    input wire        line,
    input wire        begins,
    input wire        runs
);
    reg half;  // as dac_slow_part has it
    initial half = 0;
    always @(posedge clock) if (tick && next) half <= !half;
    wire [43:0] next_offset;
    dac_slow_axis #(.INDEX_BITS(3), .WORD_BITS(8), .DAC_BITS(8), .PERIOD_BITS(4)) uut (
        .clock(clock), .write(write), .write_address(write_address), .write_data(write_data),
        .table_write(table_write), .table_address(table_address), .table_data(table_data), .write_offset(write_offset),
        .offset(offset), .write_ramp(write_ramp), .ramp(ramp), .next_offset(next_offset), .half(half), .loaded(1'b1),
        .tick(tick), .next(next), .line(line), .begins(begins), .runs(runs), .done(), .code(), .reached(), .clamped()
    );

    reg [2:0] ago;  // bit i: a tick was i + 1 clocks ago
    reg [1:0] k;    // its number in the line
    reg known, of_line, of_begin, of_run, written, ramp_written;
    reg [43:0] written_offset, written_ramp, line_offset, line_ramp;
    initial {ago, known, written, ramp_written} = 0;
    always @(posedge clock) begin
        ago <= {ago[1:0], tick};
        if (write_offset) written_offset <= offset;
        if (write_ramp) written_ramp <= ramp;
        written <= written || write_offset;
        ramp_written <= ramp_written || write_ramp;
        if (tick) {of_line, of_begin, of_run} <= {line, begins, runs};
        if (tick) k <= next ? 2'd0 : k + 2'd1;
        if (tick && next) {known, line_offset, line_ramp} <= {written && ramp_written, written_offset, written_ramp};
    end
    always @* if (tick) assume (ago == 0 && (next || k != 3));
    always @* if (ago[0] || ago[1]) assume (!write && !table_write);

    // What the axis gets; it writes into the half that is not `bank`.
    wire uut__axis__write, uut__axis__table_write, uut__axis__bank, uut__axis__tick, uut__axis__restart;
    wire uut__axis__begins, uut__axis__advance, uut__axis__running;
    wire [3:0] uut__axis__write_address;
    wire [31:0] uut__axis__write_data;
    wire [43:0] expected = line_offset + k * line_ramp;
    wire is_offset = ago[0] || ago[1];
    always @* begin
        if (ago[0]) assert (uut__axis__write && uut__axis__write_address == 4);
        if (ago[1]) assert (uut__axis__write && uut__axis__write_address == 5);
        if (ago[0] && known) assert (uut__axis__write_data == expected[17:0]);
        if (ago[1] && known) assert ($signed(uut__axis__write_data) == $signed(expected) >>> 18);
        if (uut__axis__write || uut__axis__table_write) assert (!uut__axis__bank == (is_offset ? half : !half));
        if (!is_offset) assert (uut__axis__write == write && uut__axis__bank == half);
        if (write) assert (uut__axis__write_address == write_address && uut__axis__write_data == write_data);
        assert (uut__axis__table_write == table_write && uut__axis__tick == ago[2]);
        if (ago[2]) assert (uut__axis__restart == of_line && uut__axis__begins == of_begin);
        if (ago[2]) assert (uut__axis__advance == of_run && uut__axis__running == of_run);
        if (written) assert (next_offset == written_offset);
    end
    always @* cover (ago[1] && known && k == 2 && line_ramp != 0);

`ifndef PROPERTIES_ALONE
    // What makes them inductive.
    wire [2:0] uut__ticks;
    wire [43:0] uut__at, uut__by, uut__next_ramp;
    wire uut__restarts, uut__begin_waits;
    always @* begin
        assert (uut__ticks == ago && (ago == 0 || ago == 1 || ago == 2 || ago == 4));
        if (known) assert (uut__at == expected && uut__by == line_ramp);
        if (ramp_written) assert (uut__next_ramp == written_ramp);
        if (ago != 0) assert (uut__restarts == of_line && uut__begin_waits == of_begin);
        if (ago != 0) assert (uut__axis__running == of_run);
    end
`endif
endmodule

`default_nettype wire
