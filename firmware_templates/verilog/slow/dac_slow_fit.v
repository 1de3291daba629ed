// Whether the idle program has a slow part on both axes that fits the device, and all of its words.
//
// As in dac_fit, a word that does not fit spoils the program until a withdrawal or a reset. As in dac_whole, the words
// since the last swap are counted, in any order: words 12 to 15 of both axes, and those of regions 5 and 6. The inputs
// are those of the sequencer's port; `fits` is of the writes up to the last clock.

`default_nettype none

module dac_slow_fit #(
    parameter X_INDEX_BITS = 6,
    parameter Y_INDEX_BITS = 6,
    parameter [31:0] SLOW_INDEX_BITS = 7,
    parameter LINE_BITS = 16
) (
    input  wire        clock,
    input  wire        write,    // one that is accepted
    input  wire [2:0]  region,
    input  wire [15:0] address,
    input  wire [31:0] data,
    input  wire        discard,
    input  wire        take,
    output wire        exists,   // the address is one of region 5 or 6
    output wire        fits
);
    localparam [2:0] PROGRAM = 3'd0, X_PARTS = 3'd5, Y_PARTS = 3'd6;
    localparam [11:0] X_PAGE = 12'd1, Y_PAGE = 12'd2;
    localparam [1:0] PART = 2'd0, SPACING = 2'd1;  // words 12 and 13
    localparam [6:0] MOST_KNOTS = 7'd65;
    localparam [4:0] LEAST_BITS = 5'd3, MOST_BITS = SLOW_INDEX_BITS[4:0];
    localparam [31:0] WORDS = (1 << X_INDEX_BITS) + (1 << Y_INDEX_BITS) + 8;
    // The highest bit of the count ends it, at as many words as any program needs or more.
    localparam COUNT_BITS = $clog2(WORDS + 4 * MOST_KNOTS + (2 << SLOW_INDEX_BITS)) + 1;

    wire [13:0] place = address[13:0];
    wire x_part = region == X_PARTS, y_part = region == Y_PARTS;
    wire in_second = x_part ? place >> X_INDEX_BITS == 0 : place >> Y_INDEX_BITS == 0;
    wire in_part = address[15] ? place < {7'd0, MOST_KNOTS} :
                   address[14] ? place >> SLOW_INDEX_BITS == 0 : in_second;
    assign exists = (x_part || y_part) && in_part;

    wire x_page = region == PROGRAM && address[15:4] == X_PAGE && address[3:2] == 2'd3;
    wire y_page = region == PROGRAM && address[15:4] == Y_PAGE && address[3:2] == 2'd3;
    wire is_part = data[6:0] > 7'd1 && data[6:0] <= MOST_KNOTS && !data[7] && data[12:8] >= LEAST_BITS &&
                   data[12:8] <= MOST_BITS && data[31:13] == 19'd0;
    wire is_spacing = data != 32'd0 && data >> (LINE_BITS + 1) == 0;
    wire writes_part = write && (x_page || y_page) && address[1:0] == PART;
    wire writes_spacing = write && (x_page || y_page) && address[1:0] == SPACING;
    wire spoils = (writes_part && !is_part) || (writes_spacing && !is_spacing);

    reg spoilt;
    reg x_known, y_known;      // how long the parts of the idle program are, by a word that fits
    reg x_spaced, y_spaced;    // a spacing that fits was written last
    reg [6:0] x_knots, y_knots;
    reg [3:0] x_bits, y_bits;  // of the index of a slow table
    reg [COUNT_BITS-1:0] count;
    initial begin
        spoilt = 1'b0;
        x_known = 1'b0;
        y_known = 1'b0;
        x_spaced = 1'b0;
        y_spaced = 1'b0;
        x_knots = 7'd0;
        y_knots = 7'd0;
        x_bits = 4'd0;
        y_bits = 4'd0;
        count = 0;
    end
    always @(posedge clock) begin
        if (spoils)
            spoilt <= 1'b1;
        else if (discard)
            spoilt <= 1'b0;
        x_known <= !take && (writes_part && x_page ? is_part : x_known);
        y_known <= !take && (writes_part && y_page ? is_part : y_known);
        x_spaced <= !take && (writes_spacing && x_page ? is_spacing : x_spaced);
        y_spaced <= !take && (writes_spacing && y_page ? is_spacing : y_spaced);
        if (writes_part && x_page) {x_bits, x_knots} <= {data[11:8], data[6:0]};
        if (writes_part && y_page) {y_bits, y_knots} <= {data[11:8], data[6:0]};
        if (take)
            count <= 0;
        else if (write && (x_page || y_page || x_part || y_part) && !count[COUNT_BITS-1])
            count <= count + 1;
    end
    // Gains and ratios are as many.
    wire [7:0] knots = {1'b0, x_knots} + {1'b0, y_knots};
    localparam [COUNT_BITS-1:0] ONE = 1;
    wire [COUNT_BITS-1:0] needed = WORDS[COUNT_BITS-1:0] + {{COUNT_BITS-9{1'b0}}, knots, 1'b0} + (ONE << x_bits) +
                                   (ONE << y_bits);
    assign fits = !spoilt && x_known && y_known && x_spaced && y_spaced && count >= needed;

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (X_INDEX_BITS < 2 || X_INDEX_BITS > 14 || Y_INDEX_BITS < 2 || Y_INDEX_BITS > 14) begin : guard_0
            dac_slow_fit_X_or_Y_INDEX_BITS_are_not_2_to_14 stop ();
        end
        if (SLOW_INDEX_BITS < 3 || SLOW_INDEX_BITS > 14) begin : guard_1
            dac_slow_fit_SLOW_INDEX_BITS_is_not_3_to_14 stop ();
        end
        if (LINE_BITS < 1 || LINE_BITS > 16) begin : guard_2
            dac_slow_fit_LINE_BITS_is_not_1_to_16 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
