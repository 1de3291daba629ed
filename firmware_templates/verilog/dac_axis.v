// One axis, one sample per clock: phase, table, interpolation, gain and offset, limits, slew guard.
//
// A tick comes in with its flags on one clock; the code is there LATENCY clocks later. The next tick may come on the
// next clock, with a cubic table 11 clocks later. A new program comes in with the tick that has `load`, and travels
// down the pipeline with that tick: its phase, its bank of the table, its gain and its limits each change just before
// it, so that no sample mixes two programs.

`default_nettype none

module dac_axis #(
    parameter INTERPOLATED = 1,     // degree between words; 0: none, one table word per advance; 1: lines; 3: cubic
    parameter INDEX_BITS = 11,      // a bank of the table holds 2^INDEX_BITS words
    parameter WORD_BITS = 16,
    parameter DAC_BITS = 16,
    parameter PERIOD_BITS = 31,
    parameter PLAIN_MULTIPLIER = 0,  // 1: multiplier blocks; 0: look-up tables
    parameter SHAPING = 0,           // highest order of shaping; with 3, ticks are at least 6 clocks apart
    parameter SPLINE = INTERPOLATED == 3 ? 1 : 0,  // 1: of both axes one at least has a cubic table
    parameter [63:0] POWER_UP_CODE = 0,
    parameter LATENCY =  // derived: do not set it
        (SPLINE ? 43 : PLAIN_MULTIPLIER ? 10 : 15) + (PLAIN_MULTIPLIER ? 12 : 19) + (SHAPING != 0 ? 1 : 0)
) (
    input  wire                  clock,
    // writes to a register or a table word of the idle program
    input  wire                  write,
    input  wire [3:0]            write_address,
    input  wire [31:0]           write_data,
    input  wire                  table_write,
    input  wire [INDEX_BITS-1:0] table_address,
    input  wire [WORD_BITS-1:0]  table_data,
    input  wire                  take,      // the tick of the next clock is the first one of a new program
    // flags of a tick; bit i of a vector is the flag of the tick i clocks ago
    input  wire [LATENCY-4:0]    ticks,
    input  wire [LATENCY-4:0]    loads,     // a new program begins
    input  wire [LATENCY-4:0]    runnings,  // 1: a scan plays; 0: the axis goes to the park code
    input  wire                  begins,    // with the tick of LATENCY - 11 clocks ago a scan or a program begins
    input  wire                  bank,      // the bank that plays
    input  wire                  restart,   // advance 0 of a period
    input  wire                  advance,   // the tick advances the phase
    output wire [DAC_BITS-1:0]   code,
    output wire                  reached,   // the code is at its target
    output wire                  clamped    // a limit has changed the target
);
    localparam GUARD_BITS = WORD_BITS > 21 ? 25 - WORD_BITS : 4;
    localparam SAMPLE_BITS = WORD_BITS + GUARD_BITS;
    localparam SAMPLE_AT = SPLINE ? 43 : PLAIN_MULTIPLIER ? 10 : 15;  // clocks from the tick to its sample
    localparam TARGET_AT = LATENCY - 4;                 // clocks from the tick to its target

    wire signed [SAMPLE_BITS-1:0] sample;
    wire unused_flags = &{loads, ticks, runnings, take};

    // The flags wait for a slower axis beside, since a flag is narrower than a sample.
    localparam WAIT = INTERPOLATED == 3 ? 0 : SAMPLE_AT - (INTERPOLATED == 0 ? 3 : PLAIN_MULTIPLIER ? 10 : 15);

    generate
        if (INTERPOLATED == 1) begin : interpolated
            localparam FRACTION_AT = 17 - INDEX_BITS;

            wire [31:0] phase;
            wire restarts, advances, read_bank;
            wire signed [WORD_BITS-1:0] here, there;
            wire [14:0] fraction;
            wire [WAIT+1:0] takes = {loads[WAIT:0], take};  // bit i: i - 1 clocks ago
            wire unused = &{phase, takes};  // the bits of phase below the fraction are unused

            dac_delay #(.BITS(2), .CLOCKS(WAIT)) flags (
                .clock(clock), .in({restart, advance}), .out({restarts, advances})
            );
            dac_phase #(.PERIOD_BITS(PERIOD_BITS)) position (
                .clock(clock), .write(write), .write_address(write_address), .write_data(write_data),
                .take(takes[WAIT]), .load(loads[WAIT]), .tick(ticks[WAIT]), .restart(restarts), .advance(advances),
                .phase(phase)
            );
            dac_delay #(.BITS(1), .CLOCKS(WAIT + 2)) with_phase (.clock(clock), .in(bank), .out(read_bank));
            dac_table #(.WORD_BITS(WORD_BITS), .INDEX_BITS(INDEX_BITS)) words (
                .clock(clock), .write(table_write), .write_bank(!bank), .write_index(table_address),
                .write_data(table_data), .read_bank(read_bank), .index(phase[31 -: INDEX_BITS]),
                .here(here), .there(there)
            );
            dac_delay #(.BITS(15), .CLOCKS(3)) with_words (
                .clock(clock), .in(phase[FRACTION_AT +: 15]), .out(fraction)
            );
            dac_interpolator #(
                .WORD_BITS(WORD_BITS), .GUARD_BITS(GUARD_BITS), .PLAIN_MULTIPLIER(PLAIN_MULTIPLIER)
            ) between (.clock(clock), .here(here), .there(there), .fraction(fraction), .sample(sample));
        end else if (INTERPOLATED == 3) begin : cubic
            wire [31:0] phase;
            wire unused = &phase;

            dac_phase #(.PERIOD_BITS(PERIOD_BITS)) position (
                .clock(clock), .write(write), .write_address(write_address), .write_data(write_data),
                .take(take), .load(loads[0]), .tick(ticks[0]), .restart(restart), .advance(advance), .phase(phase)
            );
            dac_spline #(.WORD_BITS(WORD_BITS), .INDEX_BITS(INDEX_BITS)) spline (
                .clock(clock), .write(table_write), .write_bank(!bank), .write_index(table_address),
                .write_data(table_data), .read_bank(bank), .phase(phase[31 -: INDEX_BITS+18]), .ticks(ticks[31:2]),
                .sample(sample)
            );
        end else begin : direct
            wire restarts, advances, read_bank;
            reg [INDEX_BITS-1:0] index;
            initial index = 0;
            dac_delay #(.BITS(2), .CLOCKS(WAIT)) flags (
                .clock(clock), .in({restart, advance}), .out({restarts, advances})
            );
            dac_delay #(.BITS(1), .CLOCKS(WAIT + 1)) with_index (.clock(clock), .in(bank), .out(read_bank));
            always @(posedge clock)
                if (ticks[WAIT]) index <= restarts ? {INDEX_BITS{1'b0}} : index + {{INDEX_BITS-1{1'b0}}, advances};
            wire signed [WORD_BITS-1:0] word;
            dac_direct_table #(.WORD_BITS(WORD_BITS), .INDEX_BITS(INDEX_BITS)) words (
                .clock(clock), .write(table_write), .write_bank(!bank), .write_index(table_address),
                .write_data(table_data), .read_bank(read_bank), .index(index), .word(word)
            );
            assign sample = {word, {GUARD_BITS{1'b0}}};
        end
    endgenerate

    wire [DAC_BITS-1:0] target, max_step, step_inverse;
    wire target_clamped;

    dac_output #(
        .SAMPLE_BITS(SAMPLE_BITS), .DAC_BITS(DAC_BITS), .PLAIN_MULTIPLIER(PLAIN_MULTIPLIER), .SHAPING(SHAPING),
        .POWER_UP_CODE(POWER_UP_CODE)
    ) out (
        .clock(clock), .write(write), .write_address(write_address), .write_data(write_data),
        .loads(loads[TARGET_AT:SAMPLE_AT-1]), .begins(begins), .tick(ticks[TARGET_AT-6]),
        .sample(sample), .running(runnings[TARGET_AT-2]), .target(target), .max_step(max_step),
        .step_inverse(step_inverse), .clamped(target_clamped)
    );
    dac_slew #(.BITS(DAC_BITS), .POWER_UP(POWER_UP_CODE)) guard (
        .clock(clock), .valid(ticks[TARGET_AT]), .target(target), .max_step(max_step),
        .step_inverse(step_inverse), .code(code), .reached(reached)
    );
    dac_delay #(.BITS(1), .CLOCKS(4)) with_code (.clock(clock), .in(target_clamped), .out(clamped));

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (INTERPOLATED != 0 && INTERPOLATED != 1 && INTERPOLATED != 3) begin : guard_0
            dac_axis_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (INDEX_BITS < 2 || INDEX_BITS > 16) begin : guard_1
            dac_axis_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (WORD_BITS < 8 || WORD_BITS > 24) begin : guard_2
            dac_axis_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (PLAIN_MULTIPLIER < 0 || PLAIN_MULTIPLIER > 1) begin : guard_3
            dac_axis_PLAIN_MULTIPLIER_is_not_0_to_1 stop ();
        end
        if (SHAPING < 0 || SHAPING > 3) begin : guard_4
            dac_axis_SHAPING_is_not_0_to_3 stop ();
        end
        if (SPLINE < 0 || SPLINE > 1) begin : guard_5
            dac_axis_SPLINE_is_not_0_to_1 stop ();
        end
        if (INTERPOLATED == 3 && SPLINE == 0) begin : guard_6
            dac_axis_SPLINE_is_0_with_a_cubic_table stop ();
        end
        if (LATENCY != (SPLINE != 0 ? 43 : PLAIN_MULTIPLIER != 0 ? 10 : 15) + (PLAIN_MULTIPLIER != 0 ? 12 : 19) +
            (SHAPING != 0 ? 1 : 0)) begin : guard_7
            dac_axis_LATENCY_follows_from_PLAIN_MULTIPLIER_SHAPING_and_SPLINE stop ();
        end
    endgenerate
endmodule

`default_nettype wire
