// The slew guard of dac_axis_serial: whatever the host writes, a code moves towards its target by at most the max_step
// of the bank that plays, and only at the end of a tick.
//
// Two things are asked of the surroundings: the bank stays what it is from the tick until the code is there (which
// writes_properties proves of the sequencer), and the target, made by limits that the host writes, is a code.

`default_nettype none

module serial_properties #(
    parameter DAC_BITS = 6,
    parameter WORD_BITS = 8,
    parameter SHAPING = 0,
    parameter POWER_UP_CODE = 5
) (
    input wire                 clock,
    input wire                 write,
    input wire [3:0]           write_address,
    input wire [31:0]          write_data,
    input wire                 table_write,
    input wire [1:0]           table_address,
    input wire [WORD_BITS-1:0] table_data,
    input wire                 bank,
    input wire                 loaded,
    input wire                 tick,
    input wire                 restart,
    input wire                 begins,
    input wire                 advance,
    input wire                 running
);
    wire done, reached, clamped;
    wire [DAC_BITS-1:0] code;
    dac_axis_serial #(
        .INDEX_BITS(2), .WORD_BITS(WORD_BITS), .DAC_BITS(DAC_BITS), .PERIOD_BITS(8), .SHAPING(SHAPING),
        .POWER_UP_CODE(POWER_UP_CODE)
    ) axis (
        .clock(clock), .write(write), .write_address(write_address), .write_data(write_data),
        .table_write(table_write), .table_address(table_address), .table_data(table_data), .bank(bank),
        .loaded(loaded), .tick(tick), .restart(restart), .begins(begins), .advance(advance), .running(running), .done(done),
        .code(code), .reached(reached), .clamped(clamped)
    );

    localparam [5:0] WAIT = 6'd0, UPPER = 6'd35, HOLD_UPPER = 6'd36, HOLD_LOWER = 6'd37, DONE = 6'd38;
    localparam BITS = 25;  // of the sums in the axis, at these widths
    wire [5:0] axis__step;
    wire [31:0] axis__word;
    wire signed [BITS-1:0] axis__a, axis__m;
    wire axis__limited, axis__compares_above, axis__compares_below, axis__subtracts, axis__shifts;

    reg bank_before, working_before;
    initial working_before = 0;
    always @(posedge clock) begin
        bank_before <= bank;
        working_before <= axis__step != WAIT || tick;
    end
    always @* if (working_before) assume (bank == bank_before);
    always @* if (axis__step == UPPER) assume (axis__a >= 0 && axis__a < (1 << DAC_BITS));

    // The definition.
    reg [DAC_BITS-1:0] target, limit, code_before, limit_taken, target_taken;
    reg moved;
    initial begin
        code_before = POWER_UP_CODE;
        moved = 0;
    end
    always @(posedge clock) begin
        if (axis__step == UPPER) begin
            target <= axis__a[DAC_BITS-1:0];
            limit <= axis__word[DAC_BITS-1:0];
        end
        code_before <= code;
        moved <= axis__step == DONE && loaded;
        limit_taken <= limit;
        target_taken <= target;
    end
    wire [DAC_BITS-1:0] distance = code > code_before ? code - code_before : code_before - code;
    always @* begin
        assert (moved || code == code_before);
        if (moved) begin
            assert (done);
            assert (distance <= limit_taken);
            assert (code_before <= target_taken ? code_before <= code && code <= target_taken
                                                : code_before >= code && code >= target_taken);
            assert (code == target_taken || distance == limit_taken);
            assert (reached == (code == target_taken));
        end
    end

    // What makes it inductive: what the registers hold in the steps of the guard.
    wire signed [BITS-1:0] from = $signed({1'b0, code});
    wire signed [BITS-1:0] to = $signed({1'b0, target});
    wire signed [BITS-1:0] by = $signed({1'b0, limit});
    always @* begin
        assert (axis__compares_above == (axis__step == 6'd33 || axis__step == HOLD_UPPER));
        assert (axis__compares_below == (axis__step == 6'd32 || axis__step == HOLD_LOWER));
        assert (axis__subtracts == (axis__step == 6'd7 || axis__step == 6'd32 || axis__step == HOLD_LOWER));
        if (axis__step >= 6'd29) assert (!axis__shifts);
        if (axis__step == HOLD_UPPER) begin
            assert (axis__a == to && axis__m == from + by);
            assert (axis__word[DAC_BITS-1:0] == limit);
        end
        if (axis__step == HOLD_LOWER) begin
            assert (axis__m == from - by);
            assert (axis__a == (to > from + by ? from + by : to));
            assert (axis__limited == (to > from + by));
        end
        if (axis__step == DONE) begin
            assert (axis__a == (to > from + by ? from + by : to < from - by ? from - by : to));
            assert (axis__limited == (to > from + by || to < from - by));
        end
    end
endmodule

`default_nettype wire
