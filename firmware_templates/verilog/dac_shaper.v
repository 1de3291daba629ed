// Feeds the remainder of a rounding back, so that the error moves to where the piezo does not follow: the code is
// floor + more + carry, where floor is the unrounded value without its fraction. docs/sequencer.md, "Shaped output",
// has the arithmetic.
//
// `kept` is the last remainder e1 and a half, so that it is not negative; the half that the rounding needs is in it.
// To it comes `feedback`, made of the last two differences:
//     first order     0
//     second order    e1 - e2
//     scanner         floor(zero (e1 - e2) / 64) - (e2 - e3)
// The next difference costs nothing: its low bits are those of fraction + feedback, its sign is the carry out of kept.
//
// A fraction a tick; `more` and `carry` come a clock after it. Ticks may come with every clock where SHAPING is 1 or 2.
// Where it is 3 they must be 6 clocks apart, whatever the order of the program: the product takes a digit of `zero` a
// clock, with digits as in dac_multiply_digits, and floors as it goes.

`default_nettype none

module dac_shaper #(
    parameter BITS = 12,    // of a remainder
    parameter SHAPING = 3   // the highest order: 1, 2, or 3 (scanner)
) (
    input  wire              clock,
    input  wire              load,     // `word` is that of the program of the next clock
    input  wire [15:0]       word,     // the order in bits 0 and 1, `zero` in bits 8 to 15
    input  wire              begins,   // the next tick is the first one of a scan or a program
    input  wire              tick,
    input  wire [BITS-1:0]   fraction,
    output reg  signed [2:0] more,     // codes
    output reg               carry
);
    localparam [BITS-1:0] HALF = {1'b1, {BITS-1{1'b0}}};

    reg [1:0] order;
    reg [BITS-1:0] kept;
    initial begin
        order = 2'd0;
        kept = HALF;
        more = 3'sd0;
        carry = 1'b0;
    end

    wire signed [BITS+2:0] feedback;
    wire signed [BITS+2:0] moved = $signed({3'b000, fraction}) + feedback;
    wire [BITS:0] sum = {1'b0, kept} + {1'b0, moved[BITS-1:0]};
    wire unused = &word;

    always @(posedge clock) begin
        if (load) order <= word[1:0];
        if (begins || order == 2'd0)
            kept <= HALF;
        else if (tick)
            kept <= sum[BITS-1:0];
        if (tick) begin
            more <= moved[BITS+2:BITS];
            carry <= sum[BITS];
        end
    end

    generate
        if (SHAPING == 1) begin : first
            assign feedback = {BITS+3{1'b0}};
        end else begin : further
            reg signed [BITS:0] difference;
            if (SHAPING == 2) begin : second
                initial difference = 0;
                always @(posedge clock)
                    if (begins || !order[1])
                        difference <= 0;
                    else if (tick)
                        difference <= {sum[BITS], moved[BITS-1:0]};
                assign feedback = {{2{difference[BITS]}}, difference};
            end else begin : scanner
                // Second order is a zero of 64 without what is subtracted.
                reg [7:0] digits;
                reg [2:0] step;  // the digit of this clock, counted from 1; 5: the last difference is subtracted
                reg signed [BITS:0] last;
                reg signed [BITS+2:0] product, fed_back;

                wire [1:0] digit = step == 3'd1 ? digits[1:0] : step == 3'd2 ? digits[3:2] :
                                   step == 3'd3 ? digits[5:4] : digits[7:6];
                wire minus = digit == 2'd0;
                wire [BITS+2:0] term = minus ? ~{{2{difference[BITS]}}, difference} :
                                       digit == 2'd1 ? {BITS+3{1'b0}} :
                                       digit == 2'd2 ? {{2{difference[BITS]}}, difference} :
                                                       {difference[BITS], difference, 1'b0};
                // The lowest position only makes the carry that a negative digit needs.
                wire [BITS+3:0] total = {{2{product[BITS+2]}}, product[BITS+2:2], 1'b1} + {term, minus};
                wire unused_total = total[0];

                initial begin
                    digits = 8'h55;
                    step = 3'd0;
                    difference = 0;
                    last = 0;
                    product = 0;
                    fed_back = 0;
                end
                always @(posedge clock) begin
                    if (load) digits <= {word[15], word[14] || word[1:0] == 2'd2, word[13:8]} + 8'h55;
                    if (tick) difference <= {sum[BITS], moved[BITS-1:0]};
                    if (tick)
                        step <= 3'd1;
                    else if (step != 3'd0)
                        step <= step == 3'd5 ? 3'd0 : step + 1;

                    if (tick)
                        product <= 0;
                    else if (step != 3'd0 && step != 3'd5)
                        product <= total[BITS+3:1];

                    if (begins)
                        fed_back <= 0;
                    else if (step == 3'd5)
                        fed_back <= product - {{2{last[BITS]}}, last};
                    if (begins || order != 2'd3)
                        last <= 0;
                    else if (step == 3'd5)
                        last <= difference;
                end
                assign feedback = fed_back;
            end
        end
    endgenerate

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 2) begin : guard_0
            dac_shaper_BITS_is_less_than_2 stop ();
        end
        if (SHAPING < 1 || SHAPING > 3) begin : guard_1
            dac_shaper_SHAPING_is_not_1_to_3 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
