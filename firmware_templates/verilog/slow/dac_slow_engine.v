// Works out a line of both axes, x and then y: the words of the axis, the offset and its ramp, the gain, and the table,
// mixed word by word. docs/sequencer.md, "Fast and slow part", has the arithmetic.
//
// There is one adder. A product takes a clock for each bit of q: m is added where the lowest bit is 1, and the sum
// moves down by a bit, into q. `done` is high from the end of a line's work until the next `start`, which may come
// at any time. With `enable` low all of it stands still.

`default_nettype none

module dac_slow_engine #(
    parameter X_INDEX_BITS = 6,
    parameter X_WORD_BITS = 16,
    parameter Y_INDEX_BITS = 6,
    parameter Y_WORD_BITS = 16,
    parameter SLOW_INDEX_BITS = 7,  // of the longest slow table
    parameter LINE_BITS = 16,
    parameter INDEX_BITS = X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS,  // derived: do not set them
    parameter WORD_BITS = X_WORD_BITS > Y_WORD_BITS ? X_WORD_BITS : Y_WORD_BITS
) (
    input  wire                       clock,
    input  wire                       enable,
    input  wire                       start,
    input  wire [LINE_BITS-1:0]       line,
    input  wire [LINE_BITS:0]         lines,        // of the frame
    output reg                        done,
    // the words of the line's program, a clock after their address
    output reg                        axis,         // 1: y
    output reg  [3:0]                 page_address,
    output wire [SLOW_INDEX_BITS-1:0] slow_index,
    output reg  [6:0]                 knot,
    input  wire [31:0]                page_word,
    input  wire [WORD_BITS-1:0]       fast,
    input  wire [7:0]                 second,
    input  wire [WORD_BITS-1:0]       slow,
    input  wire [17:0]                gain,
    input  wire [15:0]                ratio,
    // what the axis gets
    output wire                       write,
    output wire [3:0]                 write_address,
    output wire [31:0]                write_data,
    output reg  [INDEX_BITS-1:0]      index,        // of a word that is mixed; its address, too
    output wire                       write_table,
    output wire [WORD_BITS-1:0]       table_data,
    output wire                       write_offset,
    output wire [43:0]                offset,
    input  wire [43:0]                offset_here,  // what was written last
    output wire                       write_ramp,
    output wire [43:0]                ramp
);
    localparam W = 46;                        // twice the distance of two offsets
    localparam REST_BITS = LINE_BITS + 2;
    localparam PLACE_BITS = SLOW_INDEX_BITS + 18;
    localparam [3:0] PHASE_STEP = 4'd0, GAIN = 4'd3, OFFSET_LOW = 4'd4, OFFSET_HIGH = 4'd5, SPACING = 4'd13;

    // Of an axis: its words, two offsets with three products each, the ramp, two words between knots, the table.
    localparam [4:0] REST = 5'd0, COPY = 5'd1, PLACE = 5'd2, DIVIDE = 5'd3, TERMS = 5'd4, HORNER = 5'd5, PRODUCT = 5'd6;
    localparam [4:0] SLOW_GAIN = 5'd7, SLOW_LOW = 5'd8, SLOW_HIGH = 5'd9, SLOW_SUM = 5'd10, SLOW_TAKE = 5'd11;
    localparam [4:0] DISTANCE = 5'd12, RAMP = 5'd13, RAMP_CUT = 5'd14, RAMP_TAKE = 5'd15;
    localparam [4:0] KNOTS = 5'd16, SPACED = 5'd17, SEARCH = 5'd18, HERE = 5'd19, NEXT = 5'd20, THERE = 5'd21;
    localparam [4:0] DOUBLE = 5'd22, ADD = 5'd23, REDUCE = 5'd24, HALF = 5'd25, NEAREST = 5'd26, BETWEEN = 5'd27;
    localparam [4:0] WORD = 5'd28, MIX = 5'd29, MIXED = 5'd30;
    reg [4:0] state, after_product;
    reg [5:0] count;
    reg [1:0] degree;      // of a coefficient of the slow table's spline
    reg second_offset;     // that of the next line
    reg of_ratio;          // the knots are those of the ratio
    reg [17:0] here, there;
    initial begin
        state = REST;
        done = 1'b0;
    end

    // Of the line, and then of the next one: PLACE takes `lines` off where that is line 0.
    wire [LINE_BITS:0] line_or_next = {1'b0, line} + {{LINE_BITS{1'b0}}, state == SLOW_TAKE};
    wire reduces;
    wire [PLACE_BITS-1:0] quotient;
    dac_slow_divide #(.REST_BITS(REST_BITS), .QUOTIENT_BITS(PLACE_BITS)) division (
        .clock(clock), .enable(enable),
        .load_rest(state == COPY || state == SLOW_TAKE || state == KNOTS), .value({1'b0, line_or_next}),
        .load_whole(state == COPY || state == SLOW_TAKE || state == SPACED),
        .divisor(state == SPACED ? page_word[REST_BITS-1:0] : {1'b0, lines}),
        .load_part(state == HERE), .twice(state == DIVIDE || state == DOUBLE), .add(state == ADD),
        .reduce(state == PLACE || state == SEARCH || state == REDUCE || state == NEAREST), .half(state == HALF),
        .here(here[17]), .there(there[17]), .reduces(reduces), .quotient(quotient)
    );

    // A word of the spline: addressed on one clock, shifted into m on the next, and added on the one after that.
    wire once, twice, term_minus;
    wire [2:0] term = count[2:0] - 3'd1;
    dac_spline_terms terms (.degree(degree), .term(term), .once(once), .twice(twice), .minus(term_minus));
    wire [1:0] ahead = count[2:0] < 3'd2 ? 2'd0 : count[2:0] < 3'd5 ? 2'd1 : count[2:0] < 3'd7 ? 2'd2 : 2'd3;
    reg [4:0] slow_bits;  // of the index of this slow table
    assign slow_index = (quotient[18 +: SLOW_INDEX_BITS] + {{SLOW_INDEX_BITS-2{1'b0}}, ahead}) &
                        ~({SLOW_INDEX_BITS{1'b1}} << slow_bits);
    wire slow_sign = axis ? slow[Y_WORD_BITS-1] : slow[X_WORD_BITS-1];
    wire fast_sign = axis ? fast[Y_WORD_BITS-1] : fast[X_WORD_BITS-1];
    wire [WORD_BITS-1:0] above = axis ? ~({WORD_BITS{1'b1}} >> (WORD_BITS - Y_WORD_BITS)) :
                                        ~({WORD_BITS{1'b1}} >> (WORD_BITS - X_WORD_BITS));
    wire [WORD_BITS-1:0] slow_word = slow_sign ? slow | above : slow & ~above;
    wire [WORD_BITS-1:0] fast_word = fast_sign ? fast | above : fast & ~above;
    wire [W-1:0] slow_wide = {{W-WORD_BITS{slow_sign}}, slow_word};
    wire [W-1:0] term_word = (twice ? {slow_wide[W-2:0], 1'b0} : once ? slow_wide : {W{1'b0}}) << degree << 1;

    reg [W-1:0] acc, m;
    reg [31:0] q;
    reg [5:0] bits_left;  // of the product, less one
    reg is_signed;        // q is
    reg minus;            // of a term
    wire last_bit = bits_left == 6'd0;
    wire multiplies = state == PRODUCT;
    wire adds = multiplies ? q[0] : state != RAMP_CUT;
    wire subtracts = multiplies ? is_signed && last_bit : state == TERMS ? minus : state == DISTANCE;
    // A ramp that falls is one unit too steep where its product is not a whole one.
    wire carry = state == RAMP_CUT ? m[W-1] && q != 32'd0 : adds && subtracts;
    wire [W-1:0] sum = acc + ((m ^ {W{subtracts}}) & {W{adds}}) + {{W-1{1'b0}}, carry};

    wire [17:0] between = {!quotient[17], quotient[16:0]};
    wire word_ends = axis ? &index[Y_INDEX_BITS-1:0] : &index[X_INDEX_BITS-1:0];

    always @* begin
        case (state)
            COPY: page_address = count[3:0];
            SLOW_GAIN: page_address = OFFSET_LOW;
            PRODUCT, SLOW_LOW: page_address = OFFSET_HIGH;
            SLOW_TAKE, DISTANCE: page_address = PHASE_STEP;
            KNOTS: page_address = SPACING;
            default: page_address = GAIN;
        endcase
    end

    always @(posedge clock)
        if (start) begin
            state <= COPY;
            count <= 6'd0;
            axis <= 1'b0;
            done <= 1'b0;
        end else if (enable) begin
            count <= count + 1;
            case (state)
                COPY: begin
                    if (count == 6'd13) slow_bits <= page_word[12:8];
                    if (count == 6'd16) state <= PLACE;
                    second_offset <= 1'b0;
                end
                PLACE: begin
                    state <= DIVIDE;
                    count <= 6'd0;
                end
                DIVIDE: if (count == {1'b0, slow_bits} + 6'd17) begin
                    state <= TERMS;
                    count <= 6'd0;
                    degree <= 2'd3;
                end
                TERMS: if (count == 6'd9) state <= degree == 2'd0 ? SLOW_GAIN : HORNER;
                HORNER: begin
                    state <= PRODUCT;
                    after_product <= TERMS;
                    bits_left <= 6'd18;
                    is_signed <= 1'b0;
                end
                PRODUCT: begin
                    bits_left <= bits_left - 1;
                    count <= 6'd0;
                    if (last_bit) state <= after_product;
                    if (last_bit && after_product == TERMS) degree <= degree - 1;
                end
                SLOW_GAIN: state <= SLOW_LOW;
                SLOW_LOW: begin
                    state <= PRODUCT;
                    after_product <= SLOW_HIGH;
                    bits_left <= 6'd17;
                    is_signed <= 1'b1;
                end
                SLOW_HIGH: state <= SLOW_SUM;
                SLOW_SUM: state <= SLOW_TAKE;
                SLOW_TAKE: begin
                    second_offset <= 1'b1;
                    state <= second_offset ? DISTANCE : PLACE;
                end
                DISTANCE: state <= RAMP;
                RAMP: begin
                    state <= PRODUCT;
                    after_product <= RAMP_CUT;
                    bits_left <= 6'd31;
                    is_signed <= 1'b0;
                end
                RAMP_CUT: state <= RAMP_TAKE;
                RAMP_TAKE: begin
                    state <= KNOTS;
                    of_ratio <= 1'b0;
                end
                KNOTS: begin
                    state <= SPACED;
                    knot <= 7'd0;
                end
                SPACED: state <= SEARCH;
                // At most to the last but one of 65: a program whose knots do not reach the frame ends here, too.
                SEARCH: if (reduces && knot != 7'd63)
                    knot <= knot + 1;
                else
                    state <= NEXT;
                NEXT: begin
                    knot <= knot + 1;
                    state <= HERE;
                end
                HERE: begin
                    here <= of_ratio ? {!ratio[15], {2{ratio[15]}}, ratio[14:0]} : {!gain[17], gain[16:0]};
                    state <= THERE;
                end
                THERE: begin
                    there <= of_ratio ? {!ratio[15], {2{ratio[15]}}, ratio[14:0]} : {!gain[17], gain[16:0]};
                    state <= DOUBLE;
                    count <= 6'd0;
                end
                DOUBLE: begin
                    state <= ADD;
                    count <= count;
                end
                ADD: begin
                    state <= REDUCE;
                    count <= count;
                    here <= {here[16:0], 1'b0};
                    there <= {there[16:0], 1'b0};
                end
                REDUCE: state <= count == 6'd17 ? HALF : DOUBLE;
                HALF: state <= NEAREST;
                NEAREST: state <= BETWEEN;
                BETWEEN: begin
                    of_ratio <= 1'b1;
                    index <= {INDEX_BITS{1'b0}};
                    state <= of_ratio ? WORD : KNOTS;
                end
                WORD: state <= MIX;
                MIX: begin
                    state <= PRODUCT;
                    after_product <= MIXED;
                    bits_left <= 6'd7;
                    is_signed <= 1'b1;
                end
                MIXED: begin
                    index <= index + 1;
                    state <= WORD;
                    if (word_ends) begin
                        state <= axis ? REST : COPY;
                        count <= 6'd0;
                        axis <= 1'b1;
                        done <= axis;
                    end
                end
                default: state <= REST;
            endcase
        end

    always @(posedge clock)
        if (enable)
            case (state)
                PLACE: acc <= {W{1'b0}};
                TERMS: begin
                    if (count != 6'd0) m <= term_word;
                    minus <= term_minus;
                    if (count > 6'd1) acc <= sum;
                end
                HORNER: begin
                    m <= acc;
                    acc <= {{W-19{1'b0}}, 1'b1, 18'd0};
                    q <= {14'd0, quotient[17:0]};
                end
                PRODUCT: begin
                    acc <= {sum[W-1], sum[W-1:1]};
                    q <= {sum[0], q[31:1]};
                end
                SLOW_GAIN: begin
                    m <= acc;
                    q <= {14'd0, page_word[17:0]};
                end
                SLOW_LOW: acc <= {{W-18{1'b0}}, page_word[17:0]};
                SLOW_HIGH: m <= {{W-26{page_word[25]}}, page_word[25:0]};
                SLOW_SUM: acc <= sum;
                SLOW_TAKE: begin
                    acc <= {acc[W-19:0], q[31:14]};
                    m <= {{W-44{offset_here[43]}}, offset_here};
                end
                DISTANCE: acc <= sum;
                RAMP: begin
                    m <= acc;
                    acc <= {W{1'b0}};
                    q <= page_word;
                end
                RAMP_CUT: acc <= sum;
                MIX: begin
                    m <= {{W-18{between[17]}}, between};
                    acc <= {{W-WORD_BITS-12{fast_sign}}, fast_word, 12'h800};
                    q <= {24'd0, second};
                end
                default: ;
            endcase

    assign write = enable && ((state == COPY && count != 6'd0) || (state == BETWEEN && !of_ratio));
    assign write_address = state == COPY ? count[3:0] - 4'd1 : GAIN;
    assign write_data = state == COPY ? page_word : {{14{between[17]}}, between};
    assign write_offset = enable && state == SLOW_TAKE && !second_offset;
    assign offset = {acc[25:0], q[31:14]};
    assign write_ramp = enable && state == RAMP_TAKE;
    assign ramp = acc[43:0];

    // The sum of the mix, without its 12 bits of fraction, of which the product has dropped 8.
    wire [25:0] mixed = acc[29:4];
    wire sign = mixed[25];
    wire [WORD_BITS-1:0] limits = {WORD_BITS{sign}} ^ ~above;  // without the sign bit: the greatest or the least word
    wire beyond = axis ? mixed[25:Y_WORD_BITS-1] != {27-Y_WORD_BITS{sign}} :
                         mixed[25:X_WORD_BITS-1] != {27-X_WORD_BITS{sign}};
    wire [WORD_BITS-1:0] sign_bit = axis ? {{WORD_BITS-1{1'b0}}, 1'b1} << (Y_WORD_BITS - 1) :
                                           {{WORD_BITS-1{1'b0}}, 1'b1} << (X_WORD_BITS - 1);
    assign write_table = enable && state == MIXED;
    assign table_data = beyond ? limits ^ sign_bit : mixed[WORD_BITS-1:0];
    wire unused = &{page_word};

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (X_INDEX_BITS < 2 || X_INDEX_BITS > 14 || Y_INDEX_BITS < 2 || Y_INDEX_BITS > 14) begin : guard_0
            dac_slow_engine_X_or_Y_INDEX_BITS_are_not_2_to_14 stop ();
        end
        if (X_WORD_BITS < 8 || X_WORD_BITS > 21 || Y_WORD_BITS < 8 || Y_WORD_BITS > 21) begin : guard_1
            dac_slow_engine_X_or_Y_WORD_BITS_are_not_8_to_21 stop ();
        end
        if (SLOW_INDEX_BITS < 3 || SLOW_INDEX_BITS > 14) begin : guard_2
            dac_slow_engine_SLOW_INDEX_BITS_is_not_3_to_14 stop ();
        end
        if (LINE_BITS < 1 || LINE_BITS > 16) begin : guard_3
            dac_slow_engine_LINE_BITS_is_not_1_to_16 stop ();
        end
        if (INDEX_BITS != (X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS)) begin : guard_4
            dac_slow_engine_INDEX_BITS_follows_from_X_and_Y_INDEX_BITS stop ();
        end
        if (WORD_BITS != (X_WORD_BITS > Y_WORD_BITS ? X_WORD_BITS : Y_WORD_BITS)) begin : guard_5
            dac_slow_engine_WORD_BITS_follows_from_X_and_Y_WORD_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
