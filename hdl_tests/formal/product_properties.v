// A product of the spline: whatever sum and fraction are, it is what the digits of twice the fraction make of the sum,
// digit by digit, without the 20 bits that the rounding drops, of which the highest is `half`; and no sum on the way
// overflows. A product lies between 0 and the half of its sum.
//
// Asked of the surroundings: a sum comes 11 clocks after the last one or later, and its digits follow it.

`default_nettype none

module product_properties #(
    parameter BITS = 28  // of words of 21 bits
) (
    input wire                   clock,
    input wire                   load,
    input wire signed [BITS-1:0] sum,
    input wire [17:0]            fraction
);
    localparam WIDE = BITS + 22;

    reg [10:0] since;   // bit k: k + 1 clocks ago came a sum
    reg [19:0] twice;   // its fraction
    initial since = 0;
    always @(posedge clock) begin
        since <= {since[9:0], load};
        if (load) twice <= {1'b0, fraction, 1'b0};
    end
    always @* if (load) assume (since[9:0] == 0);

    // Digits of base 4, less 1: -1 to 2. Their sum is twice the fraction, since 20'h55555 is a 1 of each.
    wire [19:0] digits = twice + 20'h55555;
    reg [1:0] digit;
    integer i;
    always @* begin
        digit = 2'd1;
        for (i = 0; i < 10; i = i + 1) if (since[i]) digit = digits[2*i +: 2];
    end

    wire signed [BITS-1:0] product, step__factor;
    wire half;
    dac_spline_step #(.BITS(BITS)) step (
        .clock(clock), .load(load), .sum(sum), .digit(digit), .product(product), .half(half)
    );

    // The definition: sum times digit times 4^k, of all digits so far.
    reg signed [BITS-1:0] by;
    reg signed [WIDE-1:0] exact, term;
    wire signed [WIDE-1:0] by_wide = by, given = product;
    always @* begin
        term = 0;
        for (i = 0; i < 10; i = i + 1)
            if (since[i])
                term = digit == 2'd0 ? -(by_wide <<< 2 * i) : digit == 2'd1 ? 0 :
                       digit == 2'd2 ? by_wide <<< 2 * i : by_wide <<< 2 * i + 1;
    end
    always @(posedge clock)
        if (load) begin
            by <= sum;
            exact <= 0;
        end else
            exact <= exact + term;

    integer k;
    always @* begin
        for (k = 0; k <= 10; k = k + 1)
            if (since[k]) begin
                assert (given == exact >>> 2 * k);
                if (k > 0) assert (half == exact[2*k-1]);
            end
        if (since[10]) assert (by < 0 ? by >>> 1 <= product && product <= 0 : 0 <= product && product <= by >>> 1);
    end

    // What makes it inductive: after some digits, with what they have borrowed, it is between 0 and its sum.
    wire signed [BITS:0] wider = product, whole = by;
    reg signed [BITS:0] with_borrow;
    always @* begin
        assert (!twice[19] && !twice[0]);
        for (k = 0; k <= 10; k = k + 1) begin
            for (i = k + 1; i <= 10; i = i + 1) assert (!(since[k] && since[i]));
            if (since[k]) assert (step__factor == by);
        end
        for (k = 0; k < 10; k = k + 1) begin
            with_borrow = digits[2*k] == twice[2*k] ? wider + whole : wider;
            if (since[k])
                assert (by < 0 ? whole <= with_borrow && with_borrow <= 0 : 0 <= with_borrow && with_borrow <= whole);
        end
    end
endmodule

`default_nettype wire
