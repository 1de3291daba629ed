// The sample of a cubic table: 12 times the uniform cubic B-spline whose coefficients are the words of the table.
// docs/sequencer.md, "Interpolation", has the arithmetic of b0 to b3, and how wide the sums are.
//
// The four words of a segment are read one after the other, the last one first, from a memory with one read port. Their
// differences make b3 to b0 with few adders. Each of the three products takes SPACING clocks in a step of its own, so
// that ticks may come so far apart; b2 to b0 wait for theirs. The sample is there 41 clocks after its phase.

`default_nettype none

module dac_spline #(
    parameter INDEX_BITS = 7,  // a bank holds 2^INDEX_BITS words; 3 .. 14
    parameter WORD_BITS = 14,  // 8 .. 21
    parameter SPACING = 11     // derived: do not set it
) (
    input  wire                        clock,
    input  wire                        write,
    input  wire                        write_bank,
    input  wire [INDEX_BITS-1:0]       write_index,
    input  wire [WORD_BITS-1:0]        write_data,
    input  wire                        read_bank,
    input  wire [INDEX_BITS+17:0]      phase,  // index and fraction; holds until the next one
    input  wire [29:0]                 ticks,  // bit i: a phase came i clocks ago
    output reg  signed [WORD_BITS+3:0] sample
);
    localparam BITS = WORD_BITS + 7;  // of a sum of Horner's rule
    localparam FIRST = 7;             // clocks from a phase to its b3
    localparam SECOND = FIRST + SPACING, THIRD = SECOND + SPACING;

    // Words 3, 2, 1 and 0, and then word 1 again.
    wire [1:0] ahead = {ticks[0] || ticks[1], !(ticks[1] || ticks[3])};
    wire signed [WORD_BITS-1:0] word;
    dac_direct_table #(.WORD_BITS(WORD_BITS), .INDEX_BITS(INDEX_BITS)) words (
        .clock(clock), .write(write), .write_bank(write_bank), .write_index(write_index), .write_data(write_data),
        .read_bank(read_bank), .index(phase[18 +: INDEX_BITS] + {{INDEX_BITS-2{1'b0}}, ahead}), .word(word)
    );

    // All of it is there, of one segment, on the clock of its ticks[FIRST].
    reg signed [WORD_BITS-1:0] word_before;
    reg signed [WORD_BITS:0] rise, rise_before;     // from word to word
    reg signed [WORD_BITS:0] span;                  // from word 0 to word 2
    reg signed [WORD_BITS+1:0] bend, bend_before;   // from rise to rise
    reg signed [WORD_BITS+1:0] thrice;              // word 1, three times
    always @(posedge clock) begin
        word_before <= word;
        rise <= {word_before[WORD_BITS-1], word_before} - {word[WORD_BITS-1], word};
        rise_before <= rise;
        span <= rise_before + rise;
        bend <= {rise_before[WORD_BITS], rise_before} - {rise[WORD_BITS], rise};
        bend_before <= bend;
        thrice <= {{2{word[WORD_BITS-1]}}, word} + {word[WORD_BITS-1], word, 1'b0};
    end
    wire [WORD_BITS+2:0] b3_sixteenth = {bend_before[WORD_BITS+1], bend_before} - {bend[WORD_BITS+1], bend};

    reg [WORD_BITS+3:0] b2_eighth;
    reg [WORD_BITS+2:0] b1_quarter, b1_quarter_on;
    reg [WORD_BITS+2:0] b0_half, b0_half_on, b0_half_at_last;
    always @(posedge clock) begin
        if (ticks[FIRST]) begin
            b2_eighth <= {{2{bend[WORD_BITS+1]}}, bend} + {bend[WORD_BITS+1], bend, 1'b0};
            b1_quarter <= {{2{span[WORD_BITS]}}, span} + {span[WORD_BITS], span, 1'b0};
            b0_half <= {bend[WORD_BITS+1], bend} + {thrice, 1'b0};
        end
        if (ticks[SECOND]) begin
            b1_quarter_on <= b1_quarter;
            b0_half_on <= b0_half;
        end
        if (ticks[THIRD]) b0_half_at_last <= b0_half_on;
    end

    // Twice the fraction has ten digits, and with them the product loses the 20 bits that the rounding drops. The same
    // digits pass all three steps, one after the other.
    reg [19:0] recoded, digits;
    always @(posedge clock) begin
        recoded <= {1'b0, phase[17:0], 1'b0} + {10{2'b01}};
        digits <= ticks[FIRST-1] ? recoded : {2'b01, digits[19:2]};
    end
    wire [1:0] first_digit, second_digit, third_digit;
    dac_delay #(.BITS(2), .CLOCKS(1)) to_first (.clock(clock), .in(digits[1:0]), .out(first_digit));
    dac_delay #(.BITS(2), .CLOCKS(SPACING)) to_second (.clock(clock), .in(first_digit), .out(second_digit));
    dac_delay #(.BITS(2), .CLOCKS(SPACING)) to_third (.clock(clock), .in(second_digit), .out(third_digit));

    // What is below a product adds to the bit that decides how it rounds.
    wire [BITS-1:0] first_product, second_product, third_product;
    wire first_half, second_half, third_half;
    wire [BITS:0] second_sum = {first_product, 1'b1} + {b2_eighth, 3'd0, first_half};
    wire [BITS:0] third_sum =
        {second_product, 1'b1} + {{2{b1_quarter_on[WORD_BITS+2]}}, b1_quarter_on, 2'd0, second_half};
    wire [WORD_BITS+4:0] sum = {third_product[WORD_BITS+3:0], 1'b1} + {b0_half_at_last, 1'b0, third_half};
    wire unused = &{phase, second_sum[0], third_sum[0], sum[0], third_product[BITS-1:WORD_BITS+4]};
    dac_spline_step #(.BITS(BITS)) first (
        .clock(clock), .load(ticks[FIRST]), .sum({b3_sixteenth, 4'd0}), .digit(first_digit), .product(first_product),
        .half(first_half)
    );
    dac_spline_step #(.BITS(BITS)) second (
        .clock(clock), .load(ticks[SECOND]), .sum(second_sum[BITS:1]), .digit(second_digit), .product(second_product),
        .half(second_half)
    );
    dac_spline_step #(.BITS(BITS)) third (
        .clock(clock), .load(ticks[THIRD]), .sum(third_sum[BITS:1]), .digit(third_digit), .product(third_product),
        .half(third_half)
    );
    always @(posedge clock) sample <= sum[WORD_BITS+4:1];

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (INDEX_BITS < 3 || INDEX_BITS > 14) begin : guard_0
            dac_spline_INDEX_BITS_is_not_3_to_14 stop ();
        end
        if (WORD_BITS < 8 || WORD_BITS > 21) begin : guard_1
            dac_spline_WORD_BITS_is_not_8_to_21 stop ();
        end
        if (SPACING != 11) begin : guard_2
            dac_spline_SPACING_is_not_11 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
