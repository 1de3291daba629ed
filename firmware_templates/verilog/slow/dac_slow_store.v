// What the slow part of both axes is made of: pages, fast and second tables, slow tables and knots of both programs.
//
// One reader has all of it, so each kind of word is one memory, of two programs and two axes. A word is there a clock
// after its address; with `enable` low it stays.

`default_nettype none

module dac_slow_store #(
    parameter INDEX_BITS = 6,       // of the longer fast table
    parameter WORD_BITS = 16,       // of the wider one
    parameter SLOW_INDEX_BITS = 7
) (
    input  wire                       clock,
    // writes to the idle program, to a register, a word of the fast table, or a part of region 5 or 6
    input  wire                       write_page,
    input  wire                       write_fast,
    input  wire                       write_part,
    input  wire                       write_bank,
    input  wire                       write_axis,     // 1: y
    input  wire [15:0]                write_address,
    input  wire [31:0]                write_data,
    input  wire                       enable,
    input  wire                       bank,
    input  wire                       axis,
    input  wire [3:0]                 page_address,
    input  wire [INDEX_BITS-1:0]      index,
    input  wire [SLOW_INDEX_BITS-1:0] slow_index,
    input  wire [6:0]                 knot,
    output reg  [31:0]                page_word,
    output reg  [WORD_BITS-1:0]       fast,
    output reg  [7:0]                 second,
    output reg  [WORD_BITS-1:0]       slow,
    output reg  [17:0]                gain,
    output reg  [15:0]                ratio
);
    localparam [1:0] SECOND = 2'd0, SLOW = 2'd1, GAINS = 2'd2, RATIOS = 2'd3;

    reg [31:0] pages [0:63];
    reg [WORD_BITS-1:0] fast_words [0:(4<<INDEX_BITS)-1];
    reg [7:0] second_words [0:(4<<INDEX_BITS)-1];
    reg [WORD_BITS-1:0] slow_words [0:(4<<SLOW_INDEX_BITS)-1];
    reg [17:0] gains [0:511];
    reg [15:0] ratios [0:511];

    wire [1:0] part = write_address[15:14];
    wire unused = &{write_address, write_data};
    always @(posedge clock) begin
        if (write_page) pages[{write_bank, write_axis, write_address[3:0]}] <= write_data;
        if (write_fast)
            fast_words[{write_bank, write_axis, write_address[INDEX_BITS-1:0]}] <= write_data[WORD_BITS-1:0];
        if (write_part && part == SECOND)
            second_words[{write_bank, write_axis, write_address[INDEX_BITS-1:0]}] <= write_data[7:0];
        if (write_part && part == SLOW)
            slow_words[{write_bank, write_axis, write_address[SLOW_INDEX_BITS-1:0]}] <= write_data[WORD_BITS-1:0];
        if (write_part && part == GAINS) gains[{write_bank, write_axis, write_address[6:0]}] <= write_data[17:0];
        if (write_part && part == RATIOS) ratios[{write_bank, write_axis, write_address[6:0]}] <= write_data[15:0];
    end

    always @(posedge clock)
        if (enable) begin
            page_word <= pages[{bank, axis, page_address}];
            fast <= fast_words[{bank, axis, index}];
            second <= second_words[{bank, axis, index}];
            slow <= slow_words[{bank, axis, slow_index}];
            gain <= gains[{bank, axis, knot}];
            ratio <= ratios[{bank, axis, knot}];
        end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (INDEX_BITS < 1 || INDEX_BITS > 14) begin : guard_0
            dac_slow_store_INDEX_BITS_is_not_1_to_14 stop ();
        end
        if (WORD_BITS < 1) begin : guard_1
            dac_slow_store_WORD_BITS_is_less_than_1 stop ();
        end
        if (SLOW_INDEX_BITS < 1 || SLOW_INDEX_BITS > 14) begin : guard_2
            dac_slow_store_SLOW_INDEX_BITS_is_not_1_to_14 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
