// dac_slow_divide by the operations of dac_slow_engine: the place of a line is floor(line 2^BITS / lines), where the
// line after the last one is line 0, and a word between two knots is floor((here (spacing - part) + there part +
// spacing / 2) / spacing), which never lies outside the two words. It may stand still on any clock.
//
// A step of the induction is a bit of a word, so the length of the words is no part of the argument; the products of
// the definition ask for few bits here.

`default_nettype none

module slow_divide_properties #(
    parameter BITS = 3,       // of a word, and of a place
    parameter REST_BITS = 4,  // of twice a divisor
    parameter QUOTIENT_BITS = 5
) (
    input wire                 clock,
    input wire                 enable,
    input wire                 start,
    input wire                 places,   // a place, and not a word
    input wire [REST_BITS-1:0] value,
    input wire [REST_BITS-1:0] divisor,
    input wire [BITS-1:0]      here,
    input wire [BITS-1:0]      there
);
    localparam [3:0] REST = 4'd0, PART = 4'd1, TWICE = 4'd2, ADD = 4'd3, REDUCE = 4'd4, HALF = 4'd5, NEAREST = 4'd6;
    localparam [3:0] DONE = 4'd7, WRAP = 4'd8;

    reg [3:0] state;
    reg [3:0] bits;  // that are done
    reg place;
    reg [REST_BITS-1:0] of, part;
    reg [BITS-1:0] u, v;
    initial begin
        state = REST;
        bits = 0;
    end
    wire begins = state == REST && start;
    wire after_last = places && value == divisor;
    always @* if (begins) assume (divisor != 0 && !divisor[REST_BITS-1] && (value < divisor || after_last));
    always @(posedge clock) if (enable) case (state)
        REST: if (start) begin
            state <= places ? WRAP : PART;
            {place, of, part, u, v} <= {places, divisor, after_last ? {REST_BITS{1'b0}} : value, here, there};
            bits <= 0;
        end
        PART, WRAP: state <= TWICE;
        TWICE: begin
            state <= !place ? ADD : bits == BITS - 1 ? DONE : TWICE;
            if (place) bits <= bits + 1;
        end
        ADD: begin
            state <= REDUCE;
            bits <= bits + 1;
        end
        REDUCE: state <= bits == BITS ? HALF : TWICE;
        HALF: state <= NEAREST;
        NEAREST: state <= DONE;
        DONE: state <= REST;
    endcase

    wire [BITS-1:0] u_left = u << bits, v_left = v << bits;
    wire reduces;
    wire [QUOTIENT_BITS-1:0] quotient;
    dac_slow_divide #(.REST_BITS(REST_BITS), .QUOTIENT_BITS(QUOTIENT_BITS)) division (
        .clock(clock), .enable(enable), .load_rest(begins), .value(value), .load_whole(begins), .divisor(divisor),
        .load_part(state == PART), .twice(state == TWICE), .add(state == ADD),
        .reduce(state == WRAP || state == REDUCE || state == NEAREST), .half(state == HALF), .here(u_left[BITS-1]),
        .there(v_left[BITS-1]), .reduces(reduces), .quotient(quotient)
    );

    // The definition: what the quotient and the rest are of, after so many bits.
    wire [3:0] whole_bits = bits + (state == ADD);
    wire [BITS-1:0] mask = ~({BITS{1'b1}} << whole_bits), so_far = quotient[BITS-1:0] & mask;
    wire [BITS-1:0] u_top = u >> (BITS - bits), v_top = v >> (BITS - bits);
    wire [11:0] product = u_top * (of - part) + v_top * part;
    wire [11:0] of_words = state == ADD ? product << 1 : state == NEAREST || state == DONE ? product + of[REST_BITS-1:1]
                                                                                           : product;
    wire [11:0] of_place = part << bits;
    wire [REST_BITS-1:0] division__rest, division__whole, division__part;
    wire [11:0] made = so_far * of + division__rest;
    wire [BITS-1:0] greater = u > v ? u : v, less = u > v ? v : u;

    // The properties.
    always @* if (state == DONE) begin
        assert (made == (place ? of_place : of_words) && division__rest < of);
        if (!place) assert (less <= so_far && so_far <= greater);
        if (!place && part == 0) assert (so_far == u);
    end
    always @* cover (state == DONE && !place && so_far != u && so_far != v);

`ifndef PROPERTIES_ALONE
    // What makes them inductive: after each operation.
    always @* begin
        assert (bits <= BITS);
        if (state != REST) begin
            assert (of != 0 && !of[REST_BITS-1] && part < of && division__whole == of);
            if (!place && state != PART) assert (division__part == part);
            if (place) assert (state == WRAP || state == TWICE || state == DONE);
            if (state == TWICE) assert (bits < BITS);
            if (state == ADD) assert (bits < BITS);
            if (state == REDUCE) assert (bits != 0);
            if (state == HALF || state == NEAREST || state == DONE) assert (bits == BITS);
            if (state == PART) assert (bits == 0 && division__rest == part);
            else if (state == WRAP)
                assert (bits == 0 && (division__rest == part || (part == 0 && division__rest == of)));
            else begin
                assert (made == (place ? of_place : of_words));
                assert (division__rest < (state == REDUCE || state == NEAREST ? {of, 1'b0} : {1'b0, of}));
                if (!place && state != ADD && state != REDUCE && state != NEAREST && state != DONE)
                    assert (so_far <= (u_top > v_top ? u_top : v_top));
                if (!place && state != ADD && state != REDUCE && state != NEAREST && state != DONE)
                    assert (so_far >= (u_top > v_top ? v_top : u_top));
            end
        end
    end
`endif
endmodule

`default_nettype wire
