// dac_slow_engine, from any start on, whatever words it reads and however often it stands still: its work ends after a
// bounded number of clocks; each word of both tables is written once, in order; with `enable` low, and when it is
// done, it writes nothing. With RATIO_BITS, the word is that of docs/sequencer.md, "Fast and slow part", of its fast
// word, its second word and the ratio of the line, which is what the divisions have left.
//
// `watch` picks any word. Tables of 4 and 8 words of 8 and 9 bits: a step of the induction is a bit of a product, so
// their number is no part of the argument. slow_line_properties has gain and ratio; of the offset and the ramp that it
// writes nothing is said.

`default_nettype none

module slow_engine_properties #(
    parameter RATIO_BITS = 0,  // of a ratio, signed; 0: the clocks and the writes alone
    parameter RATIO_ZEROS = 0  // below them
) (
    input wire        clock,
    input wire        enable,
    input wire        start,
    input wire [1:0]  line,
    input wire [2:0]  lines,
    input wire [31:0] page,
    input wire [8:0]  any_fast,
    input wire [7:0]  any_second,
    input wire [8:0]  slow,
    input wire [17:0] gain,
    input wire [15:0] ratio,
    input wire [43:0] offset_here,
    input wire        watch_axis,
    input wire [2:0]  watch_index
);
    wire done, axis, write, write_table, write_offset, write_ramp;
    wire [2:0] index;
    wire [8:0] table_data;
    reg [31:0] page_word;
    reg [8:0] fast;
    reg [7:0] second;
    dac_slow_engine #(
        .X_INDEX_BITS(2), .X_WORD_BITS(8), .Y_INDEX_BITS(3), .Y_WORD_BITS(9), .SLOW_INDEX_BITS(3), .LINE_BITS(2)
    ) uut (
        .clock(clock), .enable(enable), .start(start), .line(line), .lines(lines), .done(done), .axis(axis),
        .page_address(), .slow_index(), .knot(), .page_word(page_word), .fast(fast), .second(second), .slow(slow),
        .gain(gain), .ratio(ratio), .write(write), .write_address(), .write_data(), .index(index),
        .write_table(write_table), .table_data(table_data), .write_offset(write_offset), .offset(),
        .offset_here(offset_here), .write_ramp(write_ramp), .ramp()
    );

    // The word that is watched, as the store has it: a clock after its address, and with `enable` low it stays.
    reg watching, of_axis;
    reg [2:0] of_index;
    reg [8:0] of_fast;
    reg [7:0] of_second;
    initial watching = 0;
    wire is_watched = axis == of_axis && index == of_index;
    always @* assume (!start || watching);
    always @(posedge clock) begin
        watching <= 1;
        if (!watching) {of_axis, of_index, of_fast, of_second} <= {watch_axis, watch_index, any_fast, any_second};
        if (enable) page_word <= page;
        if (enable) fast <= is_watched ? of_fast : any_fast;
        if (enable) second <= is_watched ? of_second : any_second;
    end

    // The ratio of the line: what there is between two knots when the words begin.
    wire [4:0] uut__state, uut__after_product;
    wire [17:0] uut__between;
    wire uut__of_ratio;
    reg signed [17:0] by;
    localparam signed [31:0] MOST_RATIO = (1 << RATIO_BITS + RATIO_ZEROS) / 2;
    wire takes_ratio = uut__state == 5'd27 && uut__of_ratio;
    always @(posedge clock) if (enable && takes_ratio) by <= uut__between;
    always @* if (takes_ratio && RATIO_BITS != 0)
        assume (uut__between >> RATIO_ZEROS << RATIO_ZEROS == uut__between && $signed(uut__between) >= -MOST_RATIO &&
                $signed(uut__between) < MOST_RATIO);

    // The clocks since the start, and the words that were written.
    localparam MOST = 2 * (463 + 2 * 31 + 2 * 63) + 11 * 4 + 11 * 8;
    reg works;
    reg [11:0] clocks;
    reg [3:0] words;
    initial works = 0;
    always @(posedge clock)
        if (start) begin
            works <= 1;
            clocks <= 0;
            words <= 0;
        end else if (enable) begin
            if (clocks != 12'hFFF) clocks <= clocks + 1;
            if (write_table) words <= words + 1;
        end

    // The definition.
    wire signed [8:0] fast_word = axis ? of_fast : {of_fast[7], of_fast[7:0]};
    wire signed [7:0] second_word = of_second;
    wire signed [25:0] product = by * second_word;
    wire signed [26:0] mixed = fast_word + ((product + 2048) >>> 12);
    wire signed [8:0] most = axis ? 255 : 127, least = -most - 1;
    wire signed [8:0] expected = mixed > most ? most : mixed < least ? least : mixed;

    // The properties.
    always @* begin
        if (works && clocks >= MOST && RATIO_BITS == 0) assert (done);
        if (!enable || (works && done)) assert (!write && !write_table && !write_offset && !write_ramp);
        if (works && write_table) assert (words == (axis ? 4 : 0) + index && words < (axis ? 12 : 4));
        if (works && done) assert (words == 12);
        if (works && write_table && is_watched && RATIO_BITS != 0)
            assert (axis ? table_data == expected : table_data[7:0] == expected[7:0]);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive: the most clocks that are left of the axis, and what a product is after so many bits.
    localparam [4:0] REST = 5'd0, COPY = 5'd1, PLACE = 5'd2, DIVIDE = 5'd3, TERMS = 5'd4, HORNER = 5'd5, PRODUCT = 5'd6;
    localparam [4:0] SLOW_GAIN = 5'd7, SLOW_LOW = 5'd8, SLOW_HIGH = 5'd9, SLOW_SUM = 5'd10, SLOW_TAKE = 5'd11;
    localparam [4:0] DISTANCE = 5'd12, RAMP = 5'd13, RAMP_CUT = 5'd14, RAMP_TAKE = 5'd15;
    localparam [4:0] KNOTS = 5'd16, SPACED = 5'd17, SEARCH = 5'd18, HERE = 5'd19, NEXT = 5'd20, THERE = 5'd21;
    localparam [4:0] DOUBLE = 5'd22, ADD = 5'd23, REDUCE = 5'd24, HALF = 5'd25, NEAREST = 5'd26, BETWEEN = 5'd27;
    localparam [4:0] WORD = 5'd28, MIX = 5'd29, MIXED = 5'd30;
    wire [5:0] uut__count, uut__bits_left;
    wire [1:0] uut__degree;
    wire [4:0] uut__slow_bits;
    wire [6:0] uut__knot;
    wire uut__second_offset, uut__is_signed;
    wire [45:0] uut__acc, uut__m;
    wire [31:0] uut__q;
    wire [3:0] length = axis ? 8 : 4;
    wire [11:0] table_left = 11 * (length - index), tables = 11 * length;
    wire [11:0] between_left = uut__of_ratio ? tables : 126 + tables;
    wire [11:0] cut_left = 2 + 252 + tables, bits = uut__bits_left, count = uut__count, degree = uut__degree;
    wire [11:0] take_left = uut__second_offset ? 35 + cut_left : 35 + cut_left + 1 + 31 + 18 + 122 + 1;
    wire [11:0] terms_left = 22 + take_left;
    reg [11:0] left;
    always @* begin
        case (uut__state)
            COPY: left = 17 - count + 2 * (1 + 31 + 18 + 122 + 1) + 34 + cut_left;
            PLACE: left = 1 + 31 + 18 + 122 + take_left;
            DIVIDE: left = 31 + 18 - count + 122 - 22 + terms_left;
            TERMS: left = 10 - count + 30 * degree + terms_left;
            HORNER: left = 30 * degree + terms_left;
            PRODUCT: left = uut__after_product == TERMS ? bits + 1 + 10 + 30 * (degree - 1) + terms_left :
                            uut__after_product == SLOW_HIGH ? bits + 3 + take_left :
                            uut__after_product == RAMP_CUT ? bits + 1 + cut_left : table_left - 11 + bits + 2;
            SLOW_GAIN: left = 22 + take_left;
            SLOW_LOW: left = 21 + take_left;
            SLOW_HIGH: left = 2 + take_left;
            SLOW_SUM: left = 1 + take_left;
            SLOW_TAKE: left = take_left;
            DISTANCE: left = 34 + cut_left;
            RAMP: left = 33 + cut_left;
            RAMP_CUT: left = cut_left;
            RAMP_TAKE: left = cut_left - 1;
            KNOTS: left = 126 + between_left;
            SPACED: left = 125 + between_left;
            SEARCH: left = 64 - uut__knot + 60 + between_left;
            NEXT: left = 60 + between_left;
            HERE: left = 59 + between_left;
            THERE: left = 58 + between_left;
            DOUBLE: left = 3 * (18 - count) + 3 + between_left;
            ADD: left = 3 * (18 - count) + 2 + between_left;
            REDUCE: left = 3 * (18 - count) + 1 + between_left;
            HALF: left = 3 + between_left;
            NEAREST: left = 2 + between_left;
            BETWEEN: left = 1 + between_left;
            WORD: left = table_left;
            MIX: left = table_left - 1;
            MIXED: left = table_left - 10;
            default: left = 0;
        endcase
        if (!axis) left = left + 463 + 2 * 31 + 2 * 63 + 11 * 8;
    end

    wire mixes = uut__state == MIX || (uut__state == PRODUCT && uut__after_product == MIXED) || uut__state == MIXED;
    wire in_table = mixes || uut__state == WORD;
    wire [3:0] multiplied = uut__state == MIXED ? 8 : 7 - bits;
    wire signed [8:0] made_of = multiplied == 8 ? {of_second[7], of_second} :
                                                          {1'b0, of_second & ~(8'hFF << multiplied)};
    wire signed [27:0] part = by * made_of;
    wire signed [27:0] sum = $signed({fast_word, 12'h800}) + part, shifted = sum >>> multiplied;
    always @* if (works) begin
        assert (watching && words <= 12);
        if (!done) assert (uut__state != REST && uut__state != 31);
        if (!done && RATIO_BITS == 0) assert (clocks + left <= MOST);
        if (done) assert (uut__state == REST && words == 12);
        if (!done) assert (words == (in_table ? index : 0) + (axis ? 4 : 0));
        if (in_table) assert (index < length && uut__between == by);
        if (in_table && RATIO_BITS != 0)
            assert (by >= -MOST_RATIO && by < MOST_RATIO && by >>> RATIO_ZEROS << RATIO_ZEROS == by);
        if (uut__state == COPY) assert (count <= 16);
        if (uut__state == DIVIDE) assert (count <= uut__slow_bits + 17);
        if (uut__state == TERMS) assert (count <= 9);
        if (uut__state == HORNER) assert (degree != 0);
        if (uut__state == PRODUCT) begin
            assert (uut__after_product == TERMS || uut__after_product == SLOW_HIGH || uut__after_product == RAMP_CUT ||
                    uut__after_product == MIXED);
            assert (bits <= (uut__after_product == TERMS ? 18 : uut__after_product == SLOW_HIGH ? 17 :
                             uut__after_product == RAMP_CUT ? 31 : 7));
            if (uut__after_product == TERMS) assert (degree != 0);
        end
        if (uut__state == SEARCH) assert (uut__knot <= 63);
        if (uut__state == DOUBLE || uut__state == ADD || uut__state == REDUCE) assert (count <= 17);
        if (RATIO_BITS != 0 && is_watched && uut__state == MIX) assert (fast == of_fast && second == of_second);
        if (RATIO_BITS != 0 && mixes && is_watched && uut__state != MIX)
            assert (uut__m == {{28{by[17]}}, by} && uut__acc == {{18{shifted[27]}}, shifted});
        if (RATIO_BITS != 0 && is_watched && uut__state == PRODUCT && uut__after_product == MIXED)
            assert ((uut__q & ~(32'hFFFFFFFF << (bits + 1))) == of_second >> multiplied && uut__is_signed);
    end
`endif
endmodule

`default_nettype wire
