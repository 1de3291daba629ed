// The program words of both axes by turns: every word that a sample meets, at every stage of the pipeline, is that of
// its own axis in its own program. So no stage mixes x and y, or two programs.
//
// `watch` picks any word of a program, of x or of y. Asked of the surroundings, and proven of the sequencer by
// pair_play_properties: nothing is written while a new program reads its words, and none begins meanwhile. The rules
// that use the words are in pair_phase_properties and pair_slew_properties; that of the product has no proof.

`default_nettype none

module pair_program_properties (
    input wire        clock,
    input wire        x_write,
    input wire        y_write,
    input wire [3:0]  write_address,
    input wire [31:0] write_data,
    input wire        tick,
    input wire        load_0,
    input wire [4:0]  watch
);
    localparam [3:0] PHASE_STEP = 4'd0, PHASE_REMAINDER = 4'd1, PHASE_PERIOD = 4'd2, GAIN = 4'd3;
    localparam [3:0] OFFSET_LOW = 4'd4, OFFSET_HIGH = 4'd5, CODE_MIN = 4'd6, CODE_MAX = 4'd7, MAX_STEP = 4'd8;
    localparam [3:0] PARK_CODE = 4'd9;
    localparam SAMPLE_BITS = 12, PERIOD_BITS = 8;

    reg [5:0] at;
    initial at = 0;
    always @(posedge clock) at <= at + 1;
    dac_pair #(
        .DAC_BITS(8), .X_INDEX_BITS(3), .Y_INDEX_BITS(3), .WORD_BITS(8), .PERIOD_BITS(PERIOD_BITS)
    ) pair (
        .clock(clock), .at(at), .x_write(x_write), .y_write(y_write), .write_address(write_address),
        .write_data(write_data), .x_table_write(1'b0), .y_table_write(1'b0), .table_address(3'd0), .table_data(8'd0),
        .bank(1'b0), .tick(tick), .load(load_0), .runs(1'b0), .line(1'b0), .frame(1'b0), .y_advance(1'b0), .x(), .y(),
        .reached(), .clamped()
    );
    wire pair__begins, pair__tick_load;
    wire [5:0] pair__idle__stage;
    wire beat = at[0];
    wire [5:0] stage = pair__idle__stage;  // of x in the pipeline, after a new program has begun
    wire load = pair__begins && (tick ? load_0 : pair__tick_load);
    reg was_tick;
    initial was_tick = 0;
    always @(posedge clock) was_tick <= tick;
    always @* begin
        if (x_write || y_write) assume (stage > 38 && !load);
        if (load) assume (stage > 38);
        assume (!(x_write && y_write) && !(tick && was_tick));
    end

    // The word that is watched: as the host has written it, and of the program that plays and the one before it.
    reg watching, idle_known, plays_known, played_known;
    reg of_y;
    reg [3:0] number;
    reg [31:0] idle_word, plays, played;
    initial begin
        watching = 0;
        idle_known = 0;
        plays_known = 0;
        played_known = 0;
    end
    wire writes = (x_write || y_write) && y_write == of_y && write_address == number;
    always @(posedge clock) begin
        watching <= 1;
        if (!watching) {of_y, number} <= watch;
        if (watching && writes) begin
            idle_known <= 1;
            idle_word <= write_data;
        end
        if (load && watching) begin
            {plays_known, plays} <= {idle_known, idle_word};
            {played_known, played} <= {plays_known, plays};
        end
    end

    // The schedule of pair_words_properties.
    wire [31:0] pair__idle__word;
    reg [5:0] read_at;
    always @* case (number)
        PHASE_STEP: read_at = 6;
        PHASE_REMAINDER: read_at = 3;
        PHASE_PERIOD: read_at = 1;
        GAIN: read_at = 17;
        OFFSET_LOW: read_at = 21;
        OFFSET_HIGH: read_at = 30;
        CODE_MIN: read_at = 32;
        CODE_MAX: read_at = 34;
        MAX_STEP: read_at = 38;
        PARK_CODE: read_at = 36;
        default: read_at = 62;
    endcase
    always @* if (watching && plays_known && stage == read_at + of_y) assume (pair__idle__word == plays);

    // The property: each word, where the samples of its axis meet it. x is at a ring when `stage` is its number.
    wire [SAMPLE_BITS-1:0] pair__out__high, pair__out__high_other;
    wire [17:0] pair__out__low, pair__out__low_other;
    wire [7:0] pair__out__min_inverse, pair__out__min_inverse_last, pair__out__max_inverse, pair__out__max_inverse_last;
    wire [7:0] pair__out__park, pair__out__park_other, pair__guard__step_inverse, pair__guard__last_step;
    wire [31:0] pair__position__at_step, pair__position__other_step;
    wire [1:0]
        pair__out__digit__0__word__now, pair__out__digit__1__word__now, pair__out__digit__2__word__now,
        pair__out__digit__3__word__now, pair__out__digit__4__word__now, pair__out__digit__5__word__now,
        pair__out__digit__6__word__now, pair__out__digit__7__word__now, pair__out__digit__8__word__now,
        pair__out__digit__9__word__now;
    wire [1:0]
        pair__out__digit__0__word__other, pair__out__digit__1__word__other, pair__out__digit__2__word__other,
        pair__out__digit__3__word__other, pair__out__digit__4__word__other, pair__out__digit__5__word__other,
        pair__out__digit__6__word__other, pair__out__digit__7__word__other, pair__out__digit__8__word__other,
        pair__out__digit__9__word__other;
    wire [19:0] digits = {
        pair__out__digit__9__word__now, pair__out__digit__8__word__now, pair__out__digit__7__word__now,
        pair__out__digit__6__word__now, pair__out__digit__5__word__now, pair__out__digit__4__word__now,
        pair__out__digit__3__word__now, pair__out__digit__2__word__now, pair__out__digit__1__word__now,
        pair__out__digit__0__word__now
    };
    wire [19:0] digits_other = {
        pair__out__digit__9__word__other, pair__out__digit__8__word__other, pair__out__digit__7__word__other,
        pair__out__digit__6__word__other, pair__out__digit__5__word__other, pair__out__digit__4__word__other,
        pair__out__digit__3__word__other, pair__out__digit__2__word__other, pair__out__digit__1__word__other,
        pair__out__digit__0__word__other
    };
    wire [19:0] recoded = {{2{plays[17]}}, plays[17:0]} + 20'h55555;
    wire [19:0] recoded_before = {{2{played[17]}}, played[17:0]} + 20'h55555;
    wire [PERIOD_BITS-1:0] pair__position__at_remainder, pair__position__other_remainder;
    wire [PERIOD_BITS:0] pair__position__at_less, pair__position__other_less;

    wire [PERIOD_BITS:0] at_over = pair__position__at_less - {1'b0, pair__position__at_remainder};
    wire [PERIOD_BITS:0] other_over = pair__position__other_less - {1'b0, pair__position__other_remainder};
    wire [PERIOD_BITS:0] minus_period = -{1'b0, plays[PERIOD_BITS-1:0]};
    wire [PERIOD_BITS:0] minus_period_before = -{1'b0, played[PERIOD_BITS-1:0]};

    `define AT(RING) ((beat != (((RING) % 2) == 1)) != of_y)  // the axis is at the ring on this clock
    `define IS_NEW(RING) (stage >= (RING) + of_y)
    `define KNOWN(RING) (`IS_NEW(RING) ? plays_known : played_known)
    `define MEETS(RING, NOW, OTHER, NEW, OLD) \
        if (`KNOWN(RING)) assert ((`AT(RING) ? NOW : OTHER) == (`IS_NEW(RING) ? NEW : OLD));
    integer i;
    always @* if (watching) begin
        if (number == PHASE_STEP) begin
            `MEETS(7, pair__position__at_step, pair__position__other_step, plays, played)
        end
        if (number == PHASE_REMAINDER) begin
            `MEETS(6, pair__position__at_remainder, pair__position__other_remainder, plays[7:0], played[7:0])
        end
        if (number == PHASE_PERIOD) begin  // kept as what the remainder has over it
            `MEETS(6, at_over, other_over, minus_period, minus_period_before)
        end
        if (number == OFFSET_LOW) begin
            `MEETS(22, pair__out__low, pair__out__low_other, plays[17:0], played[17:0])
        end
        if (number == OFFSET_HIGH) begin
            `MEETS(32, pair__out__high, pair__out__high_other, plays[SAMPLE_BITS-1:0], played[SAMPLE_BITS-1:0])
        end
        if (number == CODE_MIN) begin
            `MEETS(33, pair__out__min_inverse, pair__out__min_inverse_last, ~plays[7:0], ~played[7:0])
        end
        if (number == CODE_MAX) begin
            `MEETS(35, pair__out__max_inverse, pair__out__max_inverse_last, ~plays[7:0], ~played[7:0])
        end
        if (number == PARK_CODE) begin
            `MEETS(37, pair__out__park, pair__out__park_other, plays[7:0], played[7:0])
        end
        if (number == MAX_STEP) begin
            `MEETS(39, pair__guard__step_inverse, pair__guard__last_step, ~plays[7:0], ~played[7:0])
        end
        for (i = 0; i < 10; i = i + 1)
            if (number == GAIN) begin
                `MEETS(22 + i, digits[2*i +: 2], digits_other[2*i +: 2], recoded[2*i +: 2], recoded_before[2*i +: 2])
            end
    end

    // Not vacuous: a program reaches the first digit of a gain.
    always @* cover (plays_known && number == GAIN && of_y && stage == 24 && digits[1:0] == 2'd3);

`ifndef PROPERTIES_ALONE
    // What makes it inductive: the words in their memory, and where the loads are.
    wire [8:0] pair__out__loading;
    wire [19:0] pair__out__held, pair__out__held_other;
    integer k;
    always @* begin
        if (stage != 63) assert (beat != stage[0]);
        if (watching && stage < 40) assert (plays_known == idle_known && (!plays_known || plays == idle_word));
        for (k = 0; k < 9; k = k + 1) assert (pair__out__loading[k] == (stage == 22 + k || stage == 23 + k));
        if (watching && number == GAIN) begin
            `MEETS(19, pair__out__held, pair__out__held_other, recoded, recoded_before)
        end
    end
`endif
endmodule

`default_nettype wire
