// What shaper_properties and scanner_properties look at: the parameters and ports of a harness, a
// dac_shaper, its definition by the last three remainders, and the properties.
//
// Asked of the surroundings: words of shaping up to the highest order; with SHAPING = 3, ticks 6 clocks apart, and
// beginnings and words not sooner than 5 clocks after one. After a word that is another than that which plays, nothing
// is said until a scan or a program begins.

#(
    parameter BITS = 4,
    parameter SHAPING = 3
) (
    input wire            clock,
    input wire            load,
    input wire [15:0]     word,
    input wire            begins,
    input wire            tick,
    input wire [BITS-1:0] fraction
);
    wire signed [2:0] more;
    wire carry;
    dac_shaper #(.BITS(BITS), .SHAPING(SHAPING)) shaper (
        .clock(clock), .load(load), .word(word), .begins(begins), .tick(tick), .fraction(fraction), .more(more),
        .carry(carry)
    );

    reg [2:0] since;  // clocks since the last tick, 0: many
    initial since = 0;
    always @(posedge clock) since <= tick ? 3'd1 : since == 3'd5 || since == 3'd0 ? 3'd0 : since + 3'd1;
    always @* begin
        assume (word[1:0] <= SHAPING && word[7:2] == 0);
        assume (word[1:0] == 3 ? word[15:8] <= 128 : word[15:8] == 0);
        if (SHAPING == 3) begin
            assume (!tick || since == 0);
            assume (!(begins || load) || (!tick && (since == 0 || since == 5)));
        end
    end

    // What plays, and whether a tick of it was: until then a word may follow its beginning.
    reg [1:0] order;
    reg [7:0] zero;
    reg plays, fresh;
    wire other = load && (word[1:0] != order || word[15:8] != zero);
    initial begin
        order = 0;
        zero = 0;
        plays = 0;
        fresh = 0;
    end
    always @(posedge clock) begin
        if (load) begin
            order <= word[1:0];
            zero <= word[15:8];
        end
        if (begins)
            plays <= 1;
        else if (other && (!fresh || tick))
            plays <= 0;
        fresh <= begins || (fresh && !tick);
    end

    // The definition, in remainders and a half.
    localparam WIDE = BITS + 12;
    localparam signed [WIDE-1:0] HALF = 1 << (BITS - 1);
    reg signed [WIDE-1:0] m1, m2, m3;
    wire signed [WIDE-1:0] difference = m1 - m2;
    wire signed [WIDE-1:0] factor = $signed({{WIDE-8{1'b0}}, zero});
    wire signed [WIDE-1:0] multiple = factor * difference;
    wire signed [WIDE-1:0] scaled = multiple >>> 6;
    wire signed [WIDE-1:0] feedback = order == 0 ? HALF : order == 1 ? m1 : order == 2 ? m1 + difference :
                                      difference + m3 + scaled;
    wire signed [WIDE-1:0] unrounded = $signed({{WIDE-BITS{1'b0}}, fraction});
    wire signed [WIDE-1:0] fed = unrounded + feedback;
    wire signed [WIDE-1:0] code = fed >>> BITS;
    wire signed [WIDE-1:0] off = (code <<< BITS) - unrounded;
    wire signed [WIDE-1:0] distance = off < 0 ? -off : off;
    wire signed [WIDE-1:0] bound = order == 0 ? HALF : order == 1 ? HALF <<< 1 : order == 2 ? HALF <<< 2 :
                                   (HALF <<< 2) + ((HALF <<< 1) * factor >>> 6);
    reg signed [WIDE-1:0] expected;
    reg judged;
    initial begin
        m1 = HALF;
        m2 = HALF;
        m3 = HALF;
        judged = 0;
    end
    always @(posedge clock) begin
        judged <= tick && plays;
        if (tick) expected <= code;
        if (begins) begin
            m1 <= HALF;
            m2 <= HALF;
            m3 <= HALF;
        end else if (tick && order != 0) begin
            m1 <= fed & ((HALF <<< 1) - 1);
            m2 <= m1;
            m3 <= m2;
        end
    end

    wire signed [WIDE-1:0] given = {{WIDE-3{more[2]}}, more} + {{WIDE-1{1'b0}}, carry};
    always @* begin
        if (judged) assert (given == expected);
        if (tick && plays) assert (distance <= bound);
    end

    // What makes it inductive, of the definition.
    always @* begin
        assert (since <= 5);
        assert (0 <= m1 && m1 < HALF <<< 1 && 0 <= m2 && m2 < HALF <<< 1 && 0 <= m3 && m3 < HALF <<< 1);
        assert (order <= SHAPING && (order == 3 ? zero <= 128 : zero == 0));
        if (fresh) assert (plays && m1 == HALF && m2 == HALF && m3 == HALF);
        if (plays && order == 0) assert (m1 == HALF && m2 == HALF && m3 == HALF);
    end
