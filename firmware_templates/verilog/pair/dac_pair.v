// Both axes in one pipeline, a tick in two clocks: x and y by turns go through one phase, one table memory, one
// interpolation, one gain and offset, one slew guard.
//
// A pipeline of both axes is as fast as one that has a sample a clock, and each of its loops takes two clocks, so that
// one register and one adder hold the state of both axes: see dac_pair_phase and dac_pair_slew. Program words are in
// rings (dac_pair_ring), which turn with every clock. So x is at each stage in every other clock, the one in which
// `beat` is right for it; a tick that comes in the wrong clock waits for one clock, and its codes do not.
//
// Stages are counted from the sample of x on; y is a clock behind. Codes are there LATENCY clocks after `tick`.

`default_nettype none

module dac_pair #(
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter WORD_BITS = 16,
    parameter PERIOD_BITS = 31,
    parameter [63:0] X_POWER_UP_CODE = 0,
    parameter [63:0] Y_POWER_UP_CODE = 0,
    parameter LONGER_BITS = X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS  // derived: do not set it
) (
    input  wire                   clock,
    input  wire [5:0]             at,             // counts clocks, from 0 at power-up
    input  wire                   x_write,
    input  wire                   y_write,
    input  wire [3:0]             write_address,
    input  wire [31:0]            write_data,
    input  wire                   x_table_write,
    input  wire                   y_table_write,
    input  wire [LONGER_BITS-1:0] table_address,
    input  wire [WORD_BITS-1:0]   table_data,
    input  wire                   bank,           // the bank that plays
    // flags of the tick
    input  wire                   tick,
    input  wire                   load,           // a new program begins
    input  wire                   runs,
    input  wire                   line,
    input  wire                   frame,
    input  wire                   y_advance,
    // LATENCY clocks after a tick
    output wire [DAC_BITS-1:0]    x,
    output wire [DAC_BITS-1:0]    y,
    output wire                   reached,        // both are at their targets
    output wire                   clamped         // a limit has changed one of them
);
    localparam GUARD_BITS = WORD_BITS > 21 ? 25 - WORD_BITS : 4;
    localparam SAMPLE_BITS = WORD_BITS + GUARD_BITS;
    localparam RUNNING_AT = 37;

    wire beat = at[0];

    // The flags of a tick wait for its turn.
    reg tick_runs, tick_line, tick_frame, tick_advance, tick_bank, tick_load, waits;
    reg x_here, y_here, y_restart, y_advances, y_runs, y_bank;
    wire begins = (tick || waits) && !beat;
    initial begin
        tick_bank = 1'b0;
        y_bank = 1'b0;
        waits = 1'b0;
        x_here = 1'b0;
        y_here = 1'b0;
    end
    always @(posedge clock) begin
        if (tick) begin
            tick_runs <= runs;
            tick_line <= line;
            tick_frame <= frame;
            tick_advance <= y_advance;
            tick_bank <= bank;
            tick_load <= load;
        end
        waits <= tick && beat;
        x_here <= begins;
        y_here <= x_here;
        if (x_here) begin
            y_restart <= tick_frame;
            y_advances <= tick_advance;
            y_runs <= tick_runs;
            y_bank <= tick_bank;
        end
    end
    wire here = x_here || y_here;
    wire restart_0 = x_here ? tick_line : y_here && y_restart;
    wire advance_0 = x_here ? tick_runs : y_here && y_advances;
    wire runs_0 = x_here ? tick_runs : y_runs;
    wire bank_0 = x_here ? tick_bank : y_bank;

    // The words of a new program.
    wire [31:0] word;
    wire is_remainder, is_gain, is_high, load_step, load_low, load_min, load_max, load_park, load_max_step;
    dac_pair_words idle (
        .clock(clock), .write(x_write || y_write), .write_y(y_write), .write_address(write_address),
        .write_data(write_data), .start(begins && (tick ? load : tick_load)), .word(word),
        .is_step(load_step), .is_remainder(is_remainder), .is_gain(is_gain), .is_low(load_low), .is_high(is_high),
        .is_min(load_min), .is_max(load_max), .is_park(load_park), .is_max_step(load_max_step)
    );
    reg [31:0] word_1, word_2, word_3;
    wire unused = &{word_1, word_2, word_3};  // the upper bits of short words
    reg [PERIOD_BITS:0] less;
    reg load_phase, load_hold, load_high, ends;  // in the clocks after the word was there
    initial {load_phase, load_hold, load_high, ends} = 4'd0;
    // The period of a table without interpolation is not divided: its phase is the number of the word.
    wire direct = beat ? X_INTERPOLATED == 0 : Y_INTERPOLATED == 0;
    wire [31:0] direct_step = beat ? 32'd1 << (32 - X_INDEX_BITS) : 32'd1 << (32 - Y_INDEX_BITS);
    always @(posedge clock) begin
        word_1 <= word;
        word_2 <= direct ? 32'd0 : word_1;
        word_3 <= word_2;
        less <= direct ? {PERIOD_BITS+1{1'b1}} :
                         {1'b0, word_1[PERIOD_BITS-1:0]} + {1'b1, ~word_3[PERIOD_BITS-1:0]} + 1;
        ends <= is_remainder;
        load_phase <= ends;
        load_hold <= is_gain;
        load_high <= is_high;
    end

    // From stage 6 on: the phase. It is there at stage 9, the sample at stage 22, the target at stage 38.
    wire restart, advance, read_bank;
    wire [31:0] phase;
    dac_delay #(.BITS(2), .CLOCKS(6)) with_load (
        .clock(clock), .in({restart_0, advance_0}), .out({restart, advance})
    );
    dac_delay #(.BITS(1), .CLOCKS(9)) with_phase (.clock(clock), .in(bank_0), .out(read_bank));
    dac_pair_phase #(.PERIOD_BITS(PERIOD_BITS)) position (
        .clock(clock), .load(load_phase), .remainder(word_2[PERIOD_BITS-1:0]), .less(less), .load_step(load_step),
        .step(direct ? direct_step : word), .restart(restart), .advance(advance), .phase(phase)
    );

    wire signed [WORD_BITS-1:0] word_here, word_there;
    wire read_y = beat;
    dac_pair_table #(
        .WORD_BITS(WORD_BITS), .X_INDEX_BITS(X_INDEX_BITS), .Y_INDEX_BITS(Y_INDEX_BITS)
    ) tables (
        .clock(clock), .write(x_table_write || y_table_write), .write_y(y_table_write), .write_bank(!bank),
        .write_index(table_address), .write_data(table_data), .read_y(read_y), .read_bank(read_bank), .phase(phase),
        .here(word_here), .there(word_there)
    );
    wire [14:0] fraction = read_y ? phase[17-Y_INDEX_BITS +: 15] : phase[17-X_INDEX_BITS +: 15];
    wire signed [SAMPLE_BITS-1:0] sample;
    dac_pair_interpolator #(.WORD_BITS(WORD_BITS), .GUARD_BITS(GUARD_BITS)) between (
        .clock(clock), .at(at), .here(word_here), .there(word_there), .fraction(fraction), .sample(sample)
    );

    wire running, ticks;
    reg valid;
    initial valid = 1'b0;
    always @(posedge clock) valid <= ticks;
    dac_pair_delay #(.BITS(2), .CLOCKS(RUNNING_AT)) with_samples (
        .clock(clock), .at(at), .in({here, runs_0}), .out({ticks, running})
    );
    wire [DAC_BITS-1:0] target, code_inverse;
    wire target_clamped, code_reached;
    dac_pair_output #(
        .SAMPLE_BITS(SAMPLE_BITS), .DAC_BITS(DAC_BITS), .X_POWER_UP_CODE(X_POWER_UP_CODE),
        .Y_POWER_UP_CODE(Y_POWER_UP_CODE)
    ) out (
        .clock(clock), .load_hold(load_hold), .gain_word(word[17:0]), .load_low(load_low),
        .low_word(word[17:0]), .load_high(load_high), .high_word(word_1[SAMPLE_BITS-1:0]), .load_min(load_min),
        .load_max(load_max), .load_park(load_park), .code_word(word[DAC_BITS-1:0]), .sample(sample),
        .running(running), .target(target), .clamped(target_clamped)
    );
    dac_pair_slew #(.BITS(DAC_BITS), .X_POWER_UP(X_POWER_UP_CODE), .Y_POWER_UP(Y_POWER_UP_CODE)) guard (
        .clock(clock), .valid(valid), .target(target), .load(load_max_step), .max_step(word[DAC_BITS-1:0]),
        .code_inverse(code_inverse), .reached(code_reached)
    );

    // A tick that has waited is a clock later here, and the codes of one that has not are kept for a clock.
    wire code_clamped;
    reg [DAC_BITS-1:0] code_1, code_2;
    reg reached_1, reached_2, clamped_1, clamped_2;
    dac_delay #(.BITS(1), .CLOCKS(5)) with_code (.clock(clock), .in(target_clamped), .out(code_clamped));
    always @(posedge clock) begin
        code_1 <= code_inverse;
        code_2 <= code_1;
        {reached_2, reached_1} <= {reached_1, code_reached};
        {clamped_2, clamped_1} <= {clamped_1, code_clamped};
    end
    assign x = beat ? ~code_1 : ~code_2;
    assign y = beat ? ~code_inverse : ~code_1;
    assign reached = reached_1 && (beat ? code_reached : reached_2);
    assign clamped = clamped_1 || (beat ? code_clamped : clamped_2);

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (X_INTERPOLATED < 0 || X_INTERPOLATED > 1) begin : guard_0
            dac_pair_X_INTERPOLATED_is_not_0_to_1 stop ();
        end
        if (Y_INTERPOLATED < 0 || Y_INTERPOLATED > 1) begin : guard_1
            dac_pair_Y_INTERPOLATED_is_not_0_to_1 stop ();
        end
        if (X_INDEX_BITS < 2 || X_INDEX_BITS > 16 || Y_INDEX_BITS < 2 || Y_INDEX_BITS > 16) begin : guard_2
            dac_pair_X_or_Y_INDEX_BITS_are_not_2_to_16 stop ();
        end
        if (WORD_BITS < 8 || WORD_BITS > 24) begin : guard_3
            dac_pair_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (LONGER_BITS != (X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS)) begin : guard_4
            dac_pair_LONGER_BITS_follows_from_X_and_Y_INDEX_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
