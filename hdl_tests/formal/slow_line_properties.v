// How dac_slow_engine drives its divisions, from any start on and however often it stands still: the gain and the ratio
// of a line are what a division gives for the words of the knots n and n + 1, for the lines behind knot n and for the
// spacing, where the line lies behind knot n; and a place is that of the line, or of the next one, in the frame.
// slow_divide_properties has what the divisions give. The gain is written as the signed word that it is.
//
// `watch` picks the axis, the kind of the word and the knot n.
//
// `division` is `uut.division`

`default_nettype none

module slow_line_properties (
    input wire        clock,
    input wire        enable,
    input wire        start,
    input wire [1:0]  any_line,
    input wire [2:0]  any_lines,
    input wire [31:0] page,
    input wire [17:0] any_gain,
    input wire [15:0] any_ratio,
    input wire [8:0]  fast,
    input wire [7:0]  second,
    input wire [8:0]  slow,
    input wire [43:0] offset_here,
    input wire        watch_axis,
    input wire        watch_ratio,
    input wire [1:0]  watch_knot,
    input wire [17:0] watch_u,
    input wire [17:0] watch_v,
    input wire [2:0]  watch_spacing
);
    wire axis, write;
    wire [3:0] page_address, write_address;
    wire [31:0] write_data;
    wire [6:0] knot;
    reg [1:0] line;
    reg [2:0] lines;
    reg [31:0] page_word;
    reg [17:0] gain;
    reg [15:0] ratio;
    dac_slow_engine #(
        .X_INDEX_BITS(2), .X_WORD_BITS(8), .Y_INDEX_BITS(3), .Y_WORD_BITS(9), .SLOW_INDEX_BITS(3), .LINE_BITS(2)
    ) uut (
        .clock(clock), .enable(enable), .start(start), .line(line), .lines(lines), .done(), .axis(axis),
        .page_address(page_address), .slow_index(), .knot(knot), .page_word(page_word), .fast(fast), .second(second),
        .slow(slow), .gain(gain), .ratio(ratio), .write(write), .write_address(write_address), .write_data(write_data),
        .index(), .write_table(), .table_data(), .write_offset(), .offset(), .offset_here(offset_here),
        .write_ramp(), .ramp()
    );

    // What the store has, a clock after its address, and the line, which stays until the next start.
    reg watching, of_axis, of_ratio;
    reg [1:0] of_knot;
    reg [17:0] u, v;
    reg [2:0] spacing;
    initial watching = 0;
    always @* assume (!start || watching);
    always @* assume (watch_spacing != 0);
    wire [17:0] word_u = of_ratio ? {{2{u[15]}}, u[15:0]} : u, word_v = of_ratio ? {{2{v[15]}}, v[15:0]} : v;
    always @(posedge clock) begin
        watching <= 1;
        if (!watching) {of_axis, of_ratio, of_knot} <= {watch_axis, watch_ratio, watch_knot};
        if (!watching) {u, v, spacing} <= {watch_u, watch_v, watch_spacing};
        if (start) {line, lines} <= {any_line, any_lines};
        if (enable) begin
            page_word <= axis == of_axis && page_address == 13 ? spacing : page;
            gain <= axis != of_axis || of_ratio ? any_gain : knot == of_knot ? u : knot == of_knot + 1 ? v : any_gain;
            ratio <= axis != of_axis || !of_ratio ? any_ratio :
                     knot == of_knot ? u : knot == of_knot + 1 ? v : any_ratio;
        end
    end

    localparam [4:0] REST = 5'd0, COPY = 5'd1, PLACE = 5'd2, DIVIDE = 5'd3, TERMS = 5'd4, HORNER = 5'd5, PRODUCT = 5'd6;
    localparam [4:0] SLOW_TAKE = 5'd11, KNOTS = 5'd16, SPACED = 5'd17, SEARCH = 5'd18, HERE = 5'd19, NEXT = 5'd20;
    localparam [4:0] THERE = 5'd21, DOUBLE = 5'd22, ADD = 5'd23, REDUCE = 5'd24, HALF = 5'd25, NEAREST = 5'd26;
    localparam [4:0] BETWEEN = 5'd27;
    wire [4:0] uut__state, uut__slow_bits, uut__after_product;
    wire [5:0] uut__count, division__bits;
    wire [1:0] uut__degree;
    wire uut__of_ratio, uut__second_offset;
    wire [17:0] uut__between, uut__here, uut__there, division__u, division__v;
    wire [20:0] division__quotient;
    wire [3:0] division__phase, division__given, division__rest, division__whole, division__part;
    reg works;
    initial works = 0;
    always @(posedge clock) works <= works || start;

    // The properties.
    wire has_knot = axis == of_axis && uut__of_ratio == of_ratio && knot == of_knot + 1;
    wire [4:0] at_knot = of_knot * spacing;
    wire begins_spline = uut__state == TERMS && uut__degree == 3 && uut__count == 0;
    always @* if (works) begin
        if (uut__state == BETWEEN && has_knot) begin
            assert (at_knot <= line && line < at_knot + spacing);
            assert (division__phase == 4 && division__bits == 18);
            assert (division__u == (word_u ^ 18'h20000) && division__v == (word_v ^ 18'h20000));
            assert (division__part == line - at_knot && division__whole == spacing);
            assert (uut__between == (division__quotient[17:0] ^ 18'h20000));
        end
        if (uut__state == BETWEEN && !uut__of_ratio && enable)
            assert (write && write_address == 3 && $signed(write_data) == $signed(uut__between));
        if (begins_spline) begin
            assert (division__phase == 9 && division__bits == uut__slow_bits + 18);
            assert (division__given == line + uut__second_offset && division__whole == lines);
        end
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive.
    wire [9:0] knots = (knot - 1) * spacing;
    wire in_bits = uut__state == DOUBLE || uut__state == ADD || uut__state == REDUCE;
    wire in_word = in_bits || uut__state == HALF || uut__state == NEAREST || uut__state == BETWEEN;
    wire [5:0] shift = uut__state == REDUCE ? uut__count + 6'd1 : in_bits ? uut__count : 6'd18;
    wire [17:0] from_u = word_u ^ 18'h20000, from_v = word_v ^ 18'h20000;
    wire [17:0] has_here = of_ratio ? {{2{ratio[15]}}, ratio} : gain;
    always @* if (watching) assert (spacing != 0);
    always @* if (works) begin
        assert (watching);
        if (uut__state == COPY) assert (uut__count <= 16);
        if (uut__state == COPY && uut__count != 0)
            assert (division__phase == 8 && division__given == line && division__whole == lines && !uut__second_offset);
        if (uut__state == PLACE || (uut__state == COPY && uut__count != 0)) assert (division__bits == 0);
        if (uut__state == PLACE)
            assert (division__phase == 8 && division__given == line + uut__second_offset && division__whole == lines);
        if (uut__state == DIVIDE) begin
            assert (division__phase == 9 && division__bits == uut__count && uut__count <= uut__slow_bits + 17);
            assert (division__given == line + uut__second_offset && division__whole == lines);
        end
        if (uut__state == TERMS) assert (uut__count <= 9);
        if (uut__state == HORNER || (uut__state == PRODUCT && uut__after_product == TERMS)) assert (uut__degree != 0);
        if (uut__state == PRODUCT)
            assert (uut__after_product == TERMS || uut__after_product == 9 || uut__after_product == 14 ||
                    uut__after_product == 30);
        if (uut__state == SPACED) assert (division__phase == 10 && division__rest == line && knot == 0);
        if (uut__state == SPACED && axis == of_axis) assert (page_word == spacing);
        if (uut__state == SEARCH || uut__state == NEXT || uut__state == HERE) assert (division__phase == 11);
        if (uut__state == SEARCH && axis == of_axis)
            assert (division__whole == spacing && knot <= 3 && division__rest + knot * spacing == line);
        if (uut__state == NEXT && axis == of_axis) begin
            assert (division__whole == spacing && knot <= 3 && division__rest + knot * spacing == line);
            assert (division__rest < spacing);
            if (uut__of_ratio == of_ratio && knot == of_knot) assert (has_here == word_u);
        end
        if (uut__state == HERE && axis == of_axis) begin
            assert (division__whole == spacing && knot >= 1 && knot <= 4 && division__rest + knots == line);
            assert (division__rest < spacing);
            if (has_knot) assert (has_here == word_u);
        end
        if (uut__state == THERE || in_word) begin
            if (axis == of_axis)
                assert (division__whole == spacing && knot >= 1 && knot <= 4 && division__part + knots == line &&
                        division__part < spacing);
        end
        if (uut__state == THERE) assert (division__phase == 0 && division__bits == 0);
        if (uut__state == THERE && has_knot) assert (has_here == word_v && uut__here == from_u);
        if (in_bits) assert (uut__count <= 17);
        if (in_word) begin
            assert (division__bits == shift);
            assert (division__phase == (uut__state == ADD ? 1 : uut__state == REDUCE ? 2 : uut__state == NEAREST ? 3 :
                                        uut__state == BETWEEN ? 4 : 0));
            if (has_knot) begin
                assert (uut__here == from_u << shift && uut__there == from_v << shift);
                assert ((division__u & ~(18'h3FFFF << shift)) == from_u >> (18 - shift));
                assert ((division__v & ~(18'h3FFFF << shift)) == from_v >> (18 - shift));
            end
        end
    end
`endif
endmodule

`default_nettype wire
