// dac_slow_fit, whatever is written, discarded and taken: which addresses exist, and that a slow part fits exactly
// where its words do. These are of either axis words 12 and 13, as they were written last since the last swap; no word
// since the last withdrawal or reset was wrong; and as many words were written since the last swap as the program has.
//
// Asked of the surroundings: of regions 5 and 6, only addresses that exist are written (the sequencer sees to it).
// Counted are writes, not which words were written: this module does not know of a word that was written twice.

`default_nettype none

module slow_fit_properties #(
    parameter X_INDEX_BITS = 2,
    parameter Y_INDEX_BITS = 3,
    parameter SLOW_INDEX_BITS = 4,
    parameter LINE_BITS = 3
) (
    input wire        clock,
    input wire        write,
    input wire [2:0]  region,
    input wire [15:0] address,
    input wire [31:0] data,
    input wire        discard,
    input wire        take
);
    wire exists, fits;
    dac_slow_fit #(
        .X_INDEX_BITS(X_INDEX_BITS), .Y_INDEX_BITS(Y_INDEX_BITS), .SLOW_INDEX_BITS(SLOW_INDEX_BITS),
        .LINE_BITS(LINE_BITS)
    ) uut (
        .clock(clock), .write(write), .region(region), .address(address), .data(data), .discard(discard), .take(take),
        .exists(exists), .fits(fits)
    );

    // The places of docs/verilog.md: second table, slow table, gains and ratios.
    wire [13:0] place = address[13:0];
    wire is_x = region == 5, is_y = region == 6;
    reg is_place;
    always @* case (address[15:14])
        2'd0: is_place = place < (is_x ? 1 << X_INDEX_BITS : 1 << Y_INDEX_BITS);
        2'd1: is_place = place < 1 << SLOW_INDEX_BITS;
        default: is_place = place < 65;
    endcase
    wire is_slow = is_x || is_y;
    always @* assert (exists == (is_slow && is_place));
    always @* if (write && is_slow) assume (is_place);

    // Words 12 to 15 of both axes.
    wire [15:0] x_word = address - 16'h0010, y_word = address - 16'h0020;
    wire x_12 = write && region == 0 && x_word == 12, x_13 = write && region == 0 && x_word == 13;
    wire y_12 = write && region == 0 && y_word == 12, y_13 = write && region == 0 && y_word == 13;
    wire is_word = region == 0 && ((x_word >= 12 && x_word <= 15) || (y_word >= 12 && y_word <= 15));
    wire knots_fit = data[6:0] >= 2 && data[6:0] <= 65;
    wire bits_fit = data[12:8] >= 3 && data[12:8] <= SLOW_INDEX_BITS;
    wire word_12_fits = knots_fit && bits_fit && (data & 32'hFFFFE080) == 0;
    wire word_13_fits = data >= 1 && data <= (1 << (LINE_BITS + 1)) - 1;
    wire wrong = ((x_12 || y_12) && !word_12_fits) || ((x_13 || y_13) && !word_13_fits);

    // What was written: of these words the last one and whether it fits, wrong words, and how many in all.
    reg x_12_fits, x_13_fits, y_12_fits, y_13_fits, is_wrong;
    reg [6:0] x_knots, y_knots;
    reg [4:0] x_bits, y_bits;
    reg [19:0] words;
    initial {x_12_fits, x_13_fits, y_12_fits, y_13_fits, is_wrong, words} = 0;
    always @(posedge clock) begin
        if (x_12) {x_12_fits, x_bits, x_knots} <= {word_12_fits, data[12:8], data[6:0]};
        if (y_12) {y_12_fits, y_bits, y_knots} <= {word_12_fits, data[12:8], data[6:0]};
        if (x_13) x_13_fits <= word_13_fits;
        if (y_13) y_13_fits <= word_13_fits;
        if (write && (is_word || is_slow) && words != 20'hFFFFF) words <= words + 1;
        if (take) {x_12_fits, x_13_fits, y_12_fits, y_13_fits, words} <= 0;
        is_wrong <= wrong || (is_wrong && !discard);
    end
    localparam [19:0] X_WORDS = 4 + (1 << X_INDEX_BITS), Y_WORDS = 4 + (1 << Y_INDEX_BITS);
    wire [19:0] x_words = X_WORDS + (20'd1 << x_bits) + 20'd2 * x_knots;
    wire [19:0] y_words = Y_WORDS + (20'd1 << y_bits) + 20'd2 * y_knots;

    // The properties: what is accepted fits, and what fits is accepted.
    wire all_fit = x_12_fits && x_13_fits && y_12_fits && y_13_fits && !is_wrong;
    always @* begin
        if (fits) assert (all_fit);
        if (fits) assert (words >= x_words + y_words);
        if (all_fit && words >= x_words + y_words) assert (fits);
    end
    always @* cover (wrong && is_wrong && discard);

`ifndef PROPERTIES_ALONE
    // What makes them inductive.
    wire uut__spoilt, uut__x_known, uut__y_known, uut__x_spaced, uut__y_spaced;
    wire [6:0] uut__x_knots, uut__y_knots;
    wire [3:0] uut__x_bits, uut__y_bits;
    // The count ends at a power of 2 that no program needs more words than.
    localparam COUNT_BITS = $clog2(X_WORDS + Y_WORDS + 4 * 65 + (2 << SLOW_INDEX_BITS)) + 1;
    localparam [19:0] END = 1 << (COUNT_BITS - 1);
    wire [COUNT_BITS-1:0] uut__count;
    always @* begin
        assert (uut__spoilt == is_wrong);
        assert (uut__x_known == x_12_fits && uut__y_known == y_12_fits);
        assert (uut__x_spaced == x_13_fits && uut__y_spaced == y_13_fits);
        assert (uut__count == (words < END ? words : END));
        if (x_12_fits) assert (uut__x_knots == x_knots && uut__x_bits == x_bits && x_knots <= 65);
        if (y_12_fits) assert (uut__y_knots == y_knots && uut__y_bits == y_bits && y_knots <= 65);
        if (x_12_fits) assert (x_bits <= SLOW_INDEX_BITS);
        if (y_12_fits) assert (y_bits <= SLOW_INDEX_BITS);
    end
`else
    // For mutants: a counterexample begins with a program of 44 words, and then comes what may.
    reg [5:0] step;
    initial step = 0;
    always @(posedge clock) if (step != 44) step <= step + 1;
    always @* if (step < 44) begin
        assume (write && !discard && !take);
        if (step < 4) assume (region == 0 && address == {10'd0, step[1] ? 2'd2 : 2'd1, 3'b110, step[0]});
        if (step < 4) assume (data == (step[0] ? 1 : 32'h302));
        if (step >= 4) assume (region == 5 && address == 0 && data == 0);
    end
`endif
endmodule

`default_nettype wire
