// One axis in little area: the arithmetic of dac_axis, one step per clock, with a single adder for the sample. Every
// sample takes the same number of clocks.
//
// A tick starts the calculation; `done` marks its end, and the next tick may come only then. The programs of both
// banks are in one block RAM, which is read word by word. Multiplication is Booth's, two bits per clock: a holds the
// sum, m one factor, and q the other factor, which the low half of the product replaces. A cubic table takes three
// products instead of one, and terms of the words before and between them.

`default_nettype none

module dac_axis_serial #(
    parameter INTERPOLATED = 1,     // degree between words; 0: none, one table word per advance; 1: lines; 3: cubic
    parameter INDEX_BITS = 11,      // a bank of the table holds 2^INDEX_BITS words
    parameter WORD_BITS = 16,
    parameter DAC_BITS = 16,
    parameter PERIOD_BITS = 31,
    parameter SHAPING = 0,          // highest order of shaping, which takes two clocks more
    parameter [63:0] POWER_UP_CODE = 0
) (
    input  wire                  clock,
    // writes to a register or a table word of the idle program
    input  wire                  write,
    input  wire [3:0]            write_address,
    input  wire [31:0]           write_data,
    input  wire                  table_write,
    input  wire [INDEX_BITS-1:0] table_address,
    input  wire [WORD_BITS-1:0]  table_data,
    input  wire                  bank,      // the bank that plays; stable from the tick until done
    input  wire                  loaded,    // the bank holds a program
    input  wire                  tick,
    input  wire                  restart,   // with the tick: advance 0 of a period
    input  wire                  begins,    // with the tick: a scan or a program begins
    input  wire                  advance,   // with the tick: the tick advances the phase
    input  wire                  running,   // a scan plays; stable from the tick until done
    output reg                   done,      // one clock: the code is valid
    output reg  [DAC_BITS-1:0]   code,
    output reg                   reached,   // the code is at its target
    output reg                   clamped    // a limit has changed the target
);
    localparam [3:0] PHASE_STEP = 4'd0, PHASE_REMAINDER = 4'd1, PHASE_PERIOD = 4'd2, GAIN = 4'd3;
    localparam [3:0] OFFSET_LOW = 4'd4, OFFSET_HIGH = 4'd5, CODE_MIN = 4'd6, CODE_MAX = 4'd7, MAX_STEP = 4'd8;
    localparam [3:0] PARK_CODE = 4'd9, SHAPING_WORD = 4'd11;

    localparam CUBIC = INTERPOLATED == 3 ? 1 : 0;
    localparam GUARD_BITS = WORD_BITS > 21 ? 25 - WORD_BITS : 4;
    localparam SAMPLE_BITS = WORD_BITS + GUARD_BITS;
    localparam GAIN_Q = 16 + SAMPLE_BITS - DAC_BITS;
    localparam WIDEST_1 = SAMPLE_BITS > DAC_BITS ? SAMPLE_BITS : DAC_BITS;
    localparam WIDEST_2 = GAIN_Q > 20 ? GAIN_Q : 20;
    localparam WIDEST_3 = WIDEST_1 > WIDEST_2 ? WIDEST_1 : WIDEST_2;
    localparam WIDEST_SPLINE = CUBIC ? WORD_BITS + 6 : 0;
    // Fits twice the largest value, and the sign.
    localparam BITS = (WIDEST_3 > WIDEST_SPLINE ? WIDEST_3 : WIDEST_SPLINE) + 3;
    localparam Q_BITS = CUBIC ? 21 : 19;
    localparam FRACTION_BITS = CUBIC ? 18 : 15;

    // The words of both programs. To round, half a unit is added: LOW_HALF to the low word of the offset, or HIGH_HALF
    // where that bit lies above the 18 bits of the low word; or dac_shaper has it. The period is stored inverted,
    // because it is subtracted.
    localparam LOW_HALF = GAIN_Q < 19 && SHAPING == 0 ? 1 << (GAIN_Q - 1) : 0;
    localparam [BITS-1:0] HIGH_HALF = GAIN_Q < 19 || SHAPING != 0 ? 0 : {{BITS-1{1'b0}}, 1'b1} << (GAIN_Q - 1);
    reg [31:0] words [0:31];
    reg [31:0] word;
    reg [3:0] address;
    always @(posedge clock) begin
        if (write)
            words[{!bank, write_address}] <= write_address == OFFSET_LOW ? write_data + LOW_HALF :
                                             write_address == PHASE_PERIOD ? ~write_data : write_data;
        word <= words[{bank, address}];
    end

    reg [WORD_BITS-1:0] table_words [0:(2<<INDEX_BITS)-1];
    reg signed [WORD_BITS-1:0] table_word;
    wire [INDEX_BITS-1:0] index;
    always @(posedge clock) begin
        if (table_write) table_words[{!bank, table_address}] <= table_data;
        table_word <= table_words[{bank, index}];
    end

    // The steps, one per clock. A word that a step uses was addressed in the step before.
    localparam [5:0] WAIT = 6'd0, REST = 6'd1, WRAP = 6'd2, PHASE = 6'd3, HERE = 6'd5, THERE = 6'd6, DIFFERENCE = 6'd7;
    localparam [5:0] INTERPOLATE = 6'd8, BACK = 6'd16, FROM_HERE = 6'd17, SAMPLE = 6'd18, FACTOR = 6'd19;
    localparam [5:0] MULTIPLY = 6'd20;
    localparam [5:0] HIGH = 6'd29, SUM = 6'd30, ROUND = 6'd31, LOW_LIMIT = 6'd32, HIGH_LIMIT = 6'd33, TARGET = 6'd34;
    localparam [5:0] UPPER = 6'd35, HOLD_UPPER = 6'd36, HOLD_LOWER = 6'd37, DONE = 6'd38;
    localparam [5:0] MORE = 6'd39, SHAPED = 6'd40;  // between ROUND and LOW_LIMIT, with SHAPING
    localparam [5:0] WITH_SHAPING = 6'd4;           // the word is there
    // Of a cubic table before FROM_HERE: eight terms, ten digits of a product, and so on; six terms at last.
    localparam [5:0] PRODUCT = 6'd41, PRODUCT_END = 6'd50;
    localparam [5:0] SPLINE = 6'd55, TERMS = 6'd56, LAST_TERM = 6'd61, TERMS_END = 6'd63;
    reg [5:0] step;
    reg advances;
    initial begin
        step = WAIT;
        advances = 1'b0;
    end
    wire shapes = SHAPING != 0;
    wire [1:0] degree;  // of the coefficient of a cubic table to which terms are added
    wire [5:0] next = step == WAIT ? (tick ? REST : WAIT) : step == DONE ? WAIT : shapes && step == ROUND ? MORE :
                      shapes && step == SHAPED ? LOW_LIMIT : CUBIC != 0 && step == WITH_SHAPING ? SPLINE :
                      CUBIC != 0 && step == TERMS_END ? PRODUCT : CUBIC != 0 && step == PRODUCT_END ? TERMS :
                      CUBIC != 0 && step == LAST_TERM && degree == 2'd0 ? FROM_HERE : step + 1;
    // These flags are registered one clock ahead, to keep them off the path of the sum.
    reg wrapping, shifts, interpolates, subtracts, compares_above, compares_below;
    initial begin
        wrapping = 1'b0;
        shifts = 1'b0;
        interpolates = 1'b0;
        subtracts = 1'b0;
        compares_above = 1'b0;
        compares_below = 1'b0;
    end
    always @(posedge clock) begin
        step <= next;
        wrapping <= next == WRAP;
        interpolates <= INTERPOLATED == 1 && next >= INTERPOLATE && next < BACK;
        shifts <= (INTERPOLATED == 1 && next >= INTERPOLATE && next < BACK) || (next >= MULTIPLY && next < HIGH) ||
                  (CUBIC != 0 && next >= PRODUCT && next <= PRODUCT_END);
        subtracts <= next == DIFFERENCE || next == LOW_LIMIT || next == HOLD_LOWER ||
                     (next >= TERMS && next_minus);
        compares_above <= next == HIGH_LIMIT || next == HOLD_UPPER;  // a - m - 1 is not negative
        compares_below <= next == LOW_LIMIT || next == HOLD_LOWER;   // a - m is negative
        if (step == WAIT) advances <= advance && !restart;
    end

    always @* begin
        case (step)
            WAIT: address = PHASE_REMAINDER;
            REST: address = PHASE_PERIOD;
            WRAP: address = PHASE_STEP;
            FROM_HERE: address = OFFSET_LOW;
            SAMPLE: address = GAIN;
            SUM: address = CODE_MIN;
            ROUND: address = CODE_MAX;
            HIGH_LIMIT: address = PARK_CODE;
            TARGET, UPPER: address = MAX_STEP;
            default: address = shapes && step == PHASE ? SHAPING_WORD : shapes && step == MORE ? CODE_MIN :
                               shapes && step == SHAPED ? CODE_MAX : OFFSET_HIGH;
        endcase
    end

    generate
        if (INTERPOLATED != 0) begin : interpolated
            // phase = floor(k 2^32 / N), as in dac_phase, over three clocks.
            reg [31:0] phase;
            reg [PERIOD_BITS:0] rest;
            reg wraps;
            wire [PERIOD_BITS:0] sum = rest + {wrapping, word[PERIOD_BITS-1:0]} + {{PERIOD_BITS{1'b0}}, wrapping};
            always @(posedge clock)
                if (step == WAIT) begin
                    if (tick && restart) begin
                        phase <= 32'd0;
                        rest <= 0;
                    end
                end else if (advances) begin
                    if (step == REST || (wrapping && !sum[PERIOD_BITS])) rest <= sum;
                    if (wrapping) wraps <= !sum[PERIOD_BITS];
                    if (step == PHASE) phase <= phase + word + {31'd0, wraps};
                end
            wire [INDEX_BITS-1:0] ahead;
            assign index = phase[31 -: INDEX_BITS] + ahead;
            if (INTERPOLATED == 3) begin : spline
                // A word is there two steps before its last term.
                assign ahead = {{INDEX_BITS-2{1'b0}}, step == TERMS + 3 || step == TERMS + 4 || step == LAST_TERM,
                                step == TERMS || step == TERMS + 1 || step == TERMS + 2 || step == LAST_TERM};
            end else begin : line
                assign ahead = {{INDEX_BITS-1{1'b0}}, step == HERE};
            end
        end else begin : direct
            reg [INDEX_BITS-1:0] count;
            always @(posedge clock)
                if (step == WAIT) begin
                    if (tick && restart) count <= 0;
                end else if (advances && step == PHASE)
                    count <= count + 1;
            assign index = count;
        end
    endgenerate

    // The terms of a cubic table, a clock ahead as the other flags.
    wire not_once, term_twice, next_minus;
    wire [BITS-1:0] term_word;
    generate
        if (INTERPOLATED == 3) begin : terms
            wire next_once, next_twice;
            reg is_twice, is_not_once;
            reg [1:0] left;
            dac_spline_terms of_word (
                .degree(degree), .term(next[2:0]), .once(next_once), .twice(next_twice), .minus(next_minus)
            );
            always @(posedge clock) begin
                is_not_once <= next == FROM_HERE || (next >= TERMS && !next_once);
                is_twice <= next >= TERMS && next_twice;
                if (step == WAIT)
                    left <= 2'd3;
                else if (step == TERMS_END)
                    left <= left - 1;
            end
            assign degree = left;
            assign not_once = is_not_once;
            assign term_twice = is_twice;
            assign term_word = {{BITS-WORD_BITS{table_word[WORD_BITS-1]}}, table_word} << degree << 1;
        end else begin : no_terms
            assign degree = 2'd0;
            assign not_once = 1'b0;
            assign term_twice = 1'b0;
            assign next_minus = 1'b0;
            assign term_word = {BITS{1'b0}};
        end
    endgenerate

    // sum = a + term, where the term is 0, m, 2 m, -m or -2 m.
    reg signed [BITS-1:0] a, m;
    reg [Q_BITS-1:0] q;  // q[0] is the bit shifted out last
    reg limited, is_low, is_high;
    // Interpolation uses here - there as the factor, and therefore subtracts it.
    wire once = (!shifts || q[1] != q[0]) && !not_once;
    wire twice = (shifts && q[2] != q[1] && q[1] == q[0]) || term_twice;
    wire less = shifts ? q[2] ^ interpolates : subtracts || compares_above;
    wire carry = shifts ? q[2] ^ interpolates : subtracts;
    wire [BITS-1:0] size = (once ? m : {BITS{1'b0}}) | (twice ? {m[BITS-2:0], 1'b0} : {BITS{1'b0}});
    wire signed [BITS-1:0] sum = a + (size ^ {BITS{less}}) + {{BITS-1{1'b0}}, carry};
    wire beyond = compares_above ? !sum[BITS-1] : compares_below && sum[BITS-1];

    wire [BITS+17:0] whole = {a, q[Q_BITS-1 -: 18]};
    wire [BITS-1:0] table_wide = {{BITS-WORD_BITS{table_word[WORD_BITS-1]}}, table_word};
    wire [31:0] word_sign = {32{word[25]}};
    wire [BITS+31:0] word_wider = {{BITS{word[25]}}, word_sign[31:26], word[25:0]};
    wire [BITS-1:0] word_wide = word_wider[BITS-1:0];
    wire [BITS-1:0] step_word = {{BITS-DAC_BITS{1'b0}}, word[DAC_BITS-1:0]};
    wire [SAMPLE_BITS-1:0] sample;
    wire [FRACTION_BITS-1:0] fraction;
    wire [BITS+17:0] rounded = $signed(whole) >>> GAIN_Q;
    wire unused = &{wrapping, word, word_wider, word_sign, rounded};

    wire [2:0] more;
    wire carried;
    generate
        if (SHAPING != 0) begin : shaped
            localparam REMAINDER_BITS = 28 - DAC_BITS;
            dac_shaper #(.BITS(REMAINDER_BITS), .SHAPING(SHAPING)) shaper (
                .clock(clock), .load(step == WITH_SHAPING), .word(word[15:0]), .begins(step == WAIT && tick && begins),
                .tick(step == ROUND), .fraction(whole[GAIN_Q-1 -: REMAINDER_BITS]), .more(more),
                .carry(carried)
            );
        end else begin : unshaped
            wire unused_input = begins;
            assign more = 3'd0;
            assign carried = 1'b0;
        end
    endgenerate

    always @(posedge clock) begin
        case (step)
            WAIT: begin
                is_low <= 1'b0;
                is_high <= 1'b0;
                limited <= 1'b0;
            end
            HERE: a <= table_wide;
            THERE: m <= table_wide;
            DIFFERENCE: begin
                m <= {sum[BITS-2:0], 1'b0};
                a <= {{BITS-1{1'b0}}, 1'b1} << (15 - GUARD_BITS);
                q <= {{Q_BITS-FRACTION_BITS-1{1'b0}}, fraction, 1'b0};
            end
            BACK: m <= table_wide;
            FROM_HERE: a <= sum;
            SAMPLE: begin
                m <= {{BITS-SAMPLE_BITS{sample[SAMPLE_BITS-1]}}, sample};
                a <= HIGH_HALF | {{BITS-19{1'b0}}, word[18:0]};
            end
            FACTOR: q <= {{Q_BITS-19{1'b0}}, word[17:0], 1'b0};
            HIGH: m <= word_wide;
            SUM: a <= sum;
            ROUND: begin
                a <= rounded[BITS-1:0];
                m <= word_wide;
            end
            LOW_LIMIT: begin
                if (beyond) a <= m;
                is_low <= beyond;
                m <= word_wide;
            end
            HIGH_LIMIT: begin
                if (beyond) a <= m;
                is_high <= beyond;
            end
            TARGET: if (!running) a <= word_wide;
            UPPER: m <= {{BITS-DAC_BITS{1'b0}}, code} + step_word;
            HOLD_UPPER: begin
                if (beyond) a <= m;
                limited <= beyond;
                m <= {{BITS-DAC_BITS{1'b0}}, code} - step_word;
            end
            HOLD_LOWER: begin
                if (beyond) a <= m;
                limited <= limited || beyond;
            end
            default: if (shifts) begin
                a <= sum >>> 2;
                q <= {sum[1:0], q[Q_BITS-1:2]};
            end else if (shapes && step == MORE)
                m <= {{BITS-3{more[2]}}, more} + {{BITS-1{1'b0}}, carried};
            else if (shapes && step == SHAPED) begin
                a <= sum;
                m <= word_wide;
            end else if (CUBIC != 0 && step == TERMS_END) begin
                // Twice the fraction has ten digits, and the product loses the 20 bits that the rounding drops.
                m <= sum;
                a <= {{BITS-1{1'b0}}, 1'b1} << 19;
                q <= {{Q_BITS-FRACTION_BITS-2{1'b0}}, fraction, 2'b00};
            end else if (CUBIC != 0 && step >= SPLINE) begin
                a <= step == SPLINE ? {BITS{1'b0}} : sum;
                m <= term_word;
            end
        endcase
        if (CUBIC != 0 && step == PRODUCT_END) m <= term_word;
    end

    initial begin
        done = 1'b0;
        code = POWER_UP_CODE[DAC_BITS-1:0];
        reached = 1'b0;
        clamped = 1'b0;
    end

    always @(posedge clock) begin
        done <= step == DONE;
        if (step == DONE) begin
            if (loaded) code <= a[DAC_BITS-1:0];
            reached <= !loaded || !limited;
            clamped <= running && (is_low || is_high);
        end
    end

    generate
        if (INTERPOLATED == 3) begin : on_spline
            assign fraction = interpolated.phase[14-INDEX_BITS +: 18];
            assign sample = a[SAMPLE_BITS-1:0];
        end else if (INTERPOLATED != 0) begin : between
            assign fraction = interpolated.phase[17-INDEX_BITS +: 15];
            // a is in units of a table word; the highest bits of q are the fraction below it.
            assign sample = {a[WORD_BITS-1:0], q[18 -: GUARD_BITS]};
        end else begin : exact
            assign fraction = 15'd0;
            assign sample = {table_word, {GUARD_BITS{1'b0}}};
        end
    endgenerate

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (INTERPOLATED != 0 && INTERPOLATED != 1 && INTERPOLATED != 3) begin : guard_0
            dac_axis_serial_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (INDEX_BITS < 2 || INDEX_BITS > 16) begin : guard_1
            dac_axis_serial_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (WORD_BITS < 8 || WORD_BITS > 24) begin : guard_2
            dac_axis_serial_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (INTERPOLATED == 3 && (INDEX_BITS < 3 || INDEX_BITS > 14)) begin : guard_3
            dac_axis_serial_INDEX_BITS_of_a_cubic_table_is_not_3_to_14 stop ();
        end
        if (INTERPOLATED == 3 && WORD_BITS > 21) begin : guard_4
            dac_axis_serial_WORD_BITS_of_a_cubic_table_is_not_8_to_21 stop ();
        end
        if (DAC_BITS < 2 || DAC_BITS > 24) begin : guard_5
            dac_axis_serial_DAC_BITS_is_not_2_to_24 stop ();
        end
        if (PERIOD_BITS < 1 || PERIOD_BITS > 31) begin : guard_6
            dac_axis_serial_PERIOD_BITS_is_not_1_to_31 stop ();
        end
        if (SHAPING < 0 || SHAPING > 3) begin : guard_7
            dac_axis_serial_SHAPING_is_not_0_to_3 stop ();
        end
        if (POWER_UP_CODE >> DAC_BITS != 64'd0) begin : guard_8
            dac_axis_serial_POWER_UP_CODE_has_more_than_DAC_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
