// Renders the Fourier words of one axis into the words of its table: what docs/sequencer.md calls "Table from Fourier
// words", bit for bit.
//
//     acc  = a0 2^30 + sum_n a_n cosine[n k mod length] + b_n sine[n k mod length]
//     t[k] = saturate(round(acc, 60 - (word bits - 1)))
//
// Use: write the 2 H + 1 words of an axis (a0 at 0, a_n at n, b_n at H + n), then `start` with the axis and H. `busy`
// is high from the next clock on, until and including the clock after the one that puts out the last table word. Each
// word of the table comes once, with `table_write` high, in an order of its own (below).
//
// Time: with 16 digits (MULTIPLIER = 0) or 2 (MULTIPLIER = 1), `busy` is high for
//
//     (length / 2 + 1) (digits (2 H + 3) + 2) + latency clocks, latency 6 or 8
//
// Limits. 1 <= H <= HARMONICS, which is not checked; nor is it that the magnitudes of the words sum to less than
// 2^32 (4.0), which the build checks and which bounds everything here. Words for addresses above 2 HARMONICS are
// never used. Tables are a power of two long: 2^X_INDEX_BITS and 2^Y_INDEX_BITS, 8 to 65536 words.
//
// How it works
//
// Two words from one pass. Those of k and length - k have the same cosines, and sines that differ in sign only. So one
// product serves two sums, and k runs from 0 to length/2; the two ends are partners of their own.
//
// A digit at a time. Neither a 32 x 32 multiplier nor a 64-bit accumulator is needed. The sine words are cut into
// digits of DIGIT_BITS bits. A sweep over all terms sums coefficient times lowest digit; the sum is divided by
// 2^DIGIT_BITS, the next sweep adds the second digits, and so on. What the divisions drop are bits of `acc` below the
// half that decides the rounding, so they may be forgotten: after the last sweep the sum is floor(acc / 2^DROPPED)
// exactly, and round(acc, s) = (floor(acc / 2^d) + 2^(s-d-1)) >> (s - d) wherever d < s. With M < 2^32 the sum of the
// words' magnitudes, no sum is ever above M 2^DIGIT_BITS (or 8/3 M, for digits of -2..2): DIGIT_BITS + 33 bits.
//
// A quarter of the sine. SINE_FILE (for $readmemh) holds round(2^30 sin(2 pi j / L)) for j = 0 .. L/4 - 1, where L is
// the longer table's length: 2^(index bits - 2) words, each below 2^30. The quarter's end, j = L/4, has address 0
// again, and its word is bit 30 above the 0 that is found there: so no block RAM is lost to a single word. The other
// quadrants are mirror images word for word, the cosine is the sine a quarter further on, and the sine table of a
// shorter length is word for word every 2^n-th word of a longer one: the index counts in steps of the longer table for
// both axes. A word that the file does not have is `missing` when it is used.
//
// A sweep is 2 H + 3 slots of one clock: SHIFT to the next digit, the 2 H + 1 TERMS in the order of the words (a0 is a
// cosine with n = 0), a GAP that lets the last one arrive. After the last digit come two slots of OUT. Slots march
// through the pipeline; `shift_s`, `term_s`, `out_s` are the slot that the sums see.

`default_nettype none

module dac_fourier #(
    parameter X_INDEX_BITS = 11,  // log2 of the table's length, 3..16
    parameter Y_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,   // bits of a table word, 8..24
    parameter Y_WORD_BITS = 16,
    parameter HARMONICS = 64,     // greatest H, 1..512; 2^n - 1 fills the block RAM, 2^n needs twice as much
    parameter SINE_FILE = "",     // 2^(greater index bits - 2) words of 32 bits
    parameter MULTIPLIER = 0      // 0: shifts and adds; 1: a plain `*`, for parts with DSP blocks
) (
    input  wire        clock,
    input  wire        reset,          // ends a rendering; the coefficients stay
    input  wire        write,          // ignored while busy
    input  wire        write_axis,     // 0 x, 1 y
    input  wire [10:0] write_address,
    input  wire [31:0] write_data,
    input  wire        start,          // one clock; ignored while busy
    input  wire        axis,
    input  wire [9:0]  harmonics,      // H
    output reg         busy,
    output reg         table_write,
    output wire        table_axis,
    output reg  [15:0] table_address,
    output reg  [23:0] table_data,     // sign-extended
    output wire        missing         // SINE_FILE does not have a word of this rendering: the table is wrong
);
    localparam INDEX_BITS = X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS;
    localparam QUARTER_BITS = INDEX_BITS - 2;
    localparam X_STEP_BITS = INDEX_BITS - X_INDEX_BITS;
    localparam Y_STEP_BITS = INDEX_BITS - Y_INDEX_BITS;
    localparam [INDEX_BITS-1:0] X_STEP = 1 << X_STEP_BITS;
    localparam [INDEX_BITS-1:0] Y_STEP = 1 << Y_STEP_BITS;
    localparam WORD_BITS = X_WORD_BITS > Y_WORD_BITS ? X_WORD_BITS : Y_WORD_BITS;
    localparam ADDRESS_BITS = $clog2(2 * HARMONICS + 1);

    localparam DIGIT_BITS = MULTIPLIER ? 16 : 2;
    localparam DIGITS = 32 / DIGIT_BITS;
    localparam [31:0] LAST_DIGIT = DIGITS - 1;
    localparam DROPPED = DIGIT_BITS * (DIGITS - 1);
    localparam PRODUCT_LATENCY = MULTIPLIER ? 4 : 2;
    localparam STAGES = PRODUCT_LATENCY + 1;
    localparam SUM_BITS = DIGIT_BITS + 33;
    localparam X_SHIFT = 60 - (X_WORD_BITS - 1) - DROPPED;
    localparam Y_SHIFT = 60 - (Y_WORD_BITS - 1) - DROPPED;

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (X_INDEX_BITS < 3 || X_INDEX_BITS > 16) begin : guard_0
            dac_fourier_X_INDEX_BITS_is_not_3_to_16 stop ();
        end
        if (X_WORD_BITS < 8 || X_WORD_BITS > 24) begin : guard_1
            dac_fourier_X_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (Y_INDEX_BITS < 3 || Y_INDEX_BITS > 16) begin : guard_2
            dac_fourier_Y_INDEX_BITS_is_not_3_to_16 stop ();
        end
        if (Y_WORD_BITS < 8 || Y_WORD_BITS > 24) begin : guard_3
            dac_fourier_Y_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (HARMONICS < 1 || HARMONICS > 512) begin : guard_4
            dac_fourier_HARMONICS_is_not_1_to_512 stop ();
        end
        if (MULTIPLIER < 0 || MULTIPLIER > 1) begin : guard_5
            dac_fourier_MULTIPLIER_is_not_0_to_1 stop ();
        end
    endgenerate

    // Coefficients and the quarter of the sine: block RAMs, one clocked read port each. One is written while not busy
    // and read while busy, and a synthesiser sees that: what a read of the word being written gives is of no account.
    reg [31:0] coefficients [0:(2 << ADDRESS_BITS)-1];
    // The bit above a word of the sine is 1 where no file has filled it. Where one has, it is 0 throughout, and a
    // synthesiser takes it away. In a synthesis only a sine without a file has it, as in dac_boot.
    reg [30:0] quarter_sine [0:(1 << QUARTER_BITS)-1];
    integer i;
`ifdef SYNTHESIS
    localparam SYNTHESISED = 1;
`else
    localparam SYNTHESISED = 0;
`endif

    initial begin
        if (SINE_FILE == "" || !SYNTHESISED)
            for (i = 0; i < 1 << QUARTER_BITS; i = i + 1) quarter_sine[i] = {1'b1, 30'd0};
        if (SINE_FILE != "") $readmemh(SINE_FILE, quarter_sine);
    end

    always @(posedge clock)
        if (write && !busy && write_address >> ADDRESS_BITS == 11'd0)
            coefficients[{write_axis, write_address[ADDRESS_BITS-1:0]}] <= write_data;

    // The axis that is rendered, and its number of harmonics.
    reg axis_now;
    reg [9:0] least_harmonics;  // H - 1
    reg last;  // one clock, after the last table word

    initial begin
        busy = 1'b0;
        axis_now = 1'b0;
        least_harmonics = 10'd0;
    end

    always @(posedge clock) begin
        if (reset || last)
            busy <= 1'b0;
        else if (start)
            busy <= 1'b1;
        if (start && !busy) begin
            axis_now <= axis;
            least_harmonics <= harmonics - 10'd1;
        end
    end

    wire [INDEX_BITS-1:0] step = axis_now ? Y_STEP : X_STEP;

    // The slots, one a clock.
    localparam [1:0] SHIFT = 2'd0, TERMS = 2'd1, GAP = 2'd2, OUT = 2'd3;

    reg [1:0] slot;
    reg second;                     // second of the two OUT slots
    reg [3:0] digit;
    reg [INDEX_BITS-1:0] k, index;  // index is n k, plus a quarter period for a cosine
    reg [10:0] address;
    reg is_sine;
    reg sines_follow, last_term;    // the sines, or the end, follow the term of this slot

    initial begin
        slot = SHIFT;
        second = 1'b0;
        digit = 4'd0;
        k = 0;
        index = 0;
        address = 11'd0;
        is_sine = 1'b0;
        sines_follow = 1'b0;
        last_term = 1'b0;
    end

    always @(posedge clock)
        if (reset || !busy) begin
            slot <= SHIFT;
            second <= 1'b0;
            digit <= 4'd0;
            k <= 0;
        end else
            case (slot)
                SHIFT: slot <= TERMS;
                TERMS: if (last_term) slot <= GAP;
                GAP: begin
                    slot <= digit == LAST_DIGIT[3:0] ? OUT : SHIFT;
                    // The last sine word has just been read and is cut now, on this clock: the digit may change.
                    digit <= digit == LAST_DIGIT[3:0] ? 4'd0 : digit + 4'd1;
                end
                OUT: begin
                    second <= !second;
                    if (second) begin
                        slot <= SHIFT;
                        k <= k + step;
                    end
                end
            endcase

    always @(posedge clock)
        if (slot != TERMS) begin
            address <= 11'd0;
            index <= {2'b01, {QUARTER_BITS{1'b0}}};  // cosine of 0
            is_sine <= 1'b0;
            sines_follow <= 1'b0;
            last_term <= 1'b0;
        end else begin
            address <= address + 11'd1;
            index <= (sines_follow ? {INDEX_BITS{1'b0}} : index) + k;
            is_sine <= is_sine || sines_follow;
            // A clock ahead: these and the sum of the index in one clock would be the slowest path.
            sines_follow <= address == {1'b0, least_harmonics};
            last_term <= address == {least_harmonics, 1'b1};
        end

    // Stage 1: the sine word; stage 2: the coefficient, and the digit in the product.
    wire backwards = index[INDEX_BITS-2];
    wire [QUARTER_BITS-1:0] along = index[QUARTER_BITS-1:0];
    reg [30:0] sine_word;    // what block RAMs put out has no value at power-up: it would be built around them
    reg [31:0] coefficient;
    reg sine_top;
    reg [ADDRESS_BITS-1:0] address_1;

    initial begin
        sine_top = 1'b0;
        address_1 = 0;
    end

    always @(posedge clock) begin
        sine_word <= quarter_sine[backwards ? -along : along];
        sine_top <= backwards && along == 0;
        address_1 <= address[ADDRESS_BITS-1:0];
        if (busy) coefficient <= coefficients[{axis_now, address_1}];
    end

    wire signed [DIGIT_BITS+31:0] product;
    wire digit_negative;

    dac_fourier_product #(.DIGIT_BITS(DIGIT_BITS)) multiplier (
        .clock(clock), .sine({sine_top, sine_word[29:0]}), .digit_number(digit), .coefficient(coefficient),
        .product(product), .negative(digit_negative)
    );

    // Flags that accompany a slot to the stage at which its product is valid.
    wire [4:0] leaving = {slot == SHIFT, slot == TERMS, slot == OUT, is_sine, index[INDEX_BITS-1]};
    reg [5*STAGES-1:0] passing;
    wire shift_s, term_s, out_s, sine_s, second_half_s;

    assign missing = passing[3] && sine_word[30];  // of a term, the clock after it was read

    initial passing = 0;

    assign {shift_s, term_s, out_s, sine_s, second_half_s} = passing[5*STAGES-1:5*STAGES-5];

    always @(posedge clock)
        if (reset || !busy)
            passing <= 0;
        else
            passing <= {passing[5*STAGES-6:0], leaving};

    // The sums of k and of length - k, and which of them is output.
    reg mirrored;
    wire clear = !busy || (out_s && mirrored);
    wire negative = second_half_s ^ digit_negative;
    wire [SUM_BITS-1:0] sum, mirrored_sum;

    dac_fourier_sum #(.DIGIT_BITS(DIGIT_BITS)) forward (
        .clock(clock), .add(term_s), .negative(negative), .product(product), .shift(shift_s), .clear(clear), .sum(sum)
    );

    dac_fourier_sum #(.DIGIT_BITS(DIGIT_BITS)) backward (
        .clock(clock), .add(term_s), .negative(negative ^ sine_s), .product(product), .shift(shift_s), .clear(clear),
        .sum(mirrored_sum)
    );

    // Rounding and saturation, a clock each: a bit below the word's last, then the half added, then the limits. The sum
    // is below 4.0, which is two bits above those of a word; the two more cost nothing.
    wire [SUM_BITS-1:0] chosen = mirrored ? mirrored_sum : sum;
    wire [WORD_BITS+4:0] x_cut =
        {{(WORD_BITS-X_WORD_BITS+1){chosen[SUM_BITS-1]}}, chosen[SUM_BITS-2:X_SHIFT-1]};
    wire [WORD_BITS+4:0] y_cut =
        {{(WORD_BITS-Y_WORD_BITS+1){chosen[SUM_BITS-1]}}, chosen[SUM_BITS-2:Y_SHIFT-1]};
    reg [WORD_BITS+4:0] cut;
    reg [WORD_BITS+3:0] rounded;
    wire [WORD_BITS+4:0] with_half = cut + 1'b1;
    wire unused = &{1'b0, chosen, with_half[0]};
    wire x_fits = &rounded[WORD_BITS+3:X_WORD_BITS-1] || !(|rounded[WORD_BITS+3:X_WORD_BITS-1]);
    wire y_fits = &rounded[WORD_BITS+3:Y_WORD_BITS-1] || !(|rounded[WORD_BITS+3:Y_WORD_BITS-1]);
    wire below = rounded[WORD_BITS+3];
    wire [23:0] x_limit = {{(25-X_WORD_BITS){below}}, {(X_WORD_BITS-1){!below}}};
    wire [23:0] y_limit = {{(25-Y_WORD_BITS){below}}, {(Y_WORD_BITS-1){!below}}};
    wire fits = axis_now ? y_fits : x_fits;
    wire [23:0] limit = axis_now ? y_limit : x_limit;

    // The table address of each word, in steps of the longer table.
    reg out_1, out_2, mirrored_1, mirrored_2;
    reg [INDEX_BITS-1:0] position;  // k, delayed as much as the words
    wire at_end = position[INDEX_BITS-1];
    wire [INDEX_BITS-1:0] from_start = mirrored_2 ? -position : position;
    wire [15:0] x_address = {{(16-INDEX_BITS){1'b0}}, from_start} >> X_STEP_BITS;
    wire [15:0] y_address = {{(16-INDEX_BITS){1'b0}}, from_start} >> Y_STEP_BITS;

    assign table_axis = axis_now;

    initial begin
        last = 1'b0;
        mirrored = 1'b0;
        mirrored_1 = 1'b0;
        mirrored_2 = 1'b0;
        out_1 = 1'b0;
        out_2 = 1'b0;
        position = 0;
        cut = 0;
        rounded = 0;
        table_write = 1'b0;
        table_address = 16'd0;
        table_data = 24'd0;
    end

    always @(posedge clock) begin
        cut <= axis_now ? y_cut : x_cut;
        mirrored_1 <= mirrored;
        rounded <= with_half[WORD_BITS+4:1];
        mirrored_2 <= mirrored_1;
        table_data <= fits ? {{(24-WORD_BITS){below}}, rounded[WORD_BITS-1:0]} : limit;
        table_address <= axis_now ? y_address : x_address;
        if (reset || !busy) begin
            mirrored <= 1'b0;
            position <= 0;
            out_1 <= 1'b0;
            out_2 <= 1'b0;
            table_write <= 1'b0;
            last <= 1'b0;
        end else begin
            mirrored <= mirrored ^ out_s;
            out_1 <= out_s;
            out_2 <= out_1;
            table_write <= out_2 && !(mirrored_2 && (at_end || position == 0));
            last <= out_2 && mirrored_2 && at_end;
            if (out_2 && mirrored_2)
                position <= position + step;
        end
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (SINE_FILE == "") begin : guard_6
            dac_fourier_SINE_FILE_is_not_set stop ();
        end
    endgenerate
endmodule

`default_nettype wire
