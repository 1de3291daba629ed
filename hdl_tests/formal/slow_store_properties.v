// dac_slow_store, whatever is written and read: a word that is read is the one that was written last to its kind, bank,
// axis and place, a clock after its address; with `enable` low it stays. No other write changes it.
//
// `watch` picks any word of a kind. Asked of the surroundings: only addresses that exist are written (dac_slow_fit says
// which ones of regions 5 and 6, the sequencer which ones of the others).

`default_nettype none

module slow_store_properties #(
    parameter KIND = 0  // page, fast, second, slow, gains, ratios
) (
    input wire        clock,
    input wire        write_page,
    input wire        write_fast,
    input wire        write_part,
    input wire        write_bank,
    input wire        write_axis,
    input wire [15:0] write_address,
    input wire [31:0] write_data,
    input wire        enable,
    input wire        bank,
    input wire        axis,
    input wire [3:0]  page_address,
    input wire [1:0]  index,
    input wire [2:0]  slow_index,
    input wire [6:0]  knot,
    input wire        watch_bank,
    input wire        watch_axis,
    input wire [6:0]  watch_place
);
    localparam PAGE = 0, FAST = 1, SECOND = 2, SLOW = 3, GAINS = 4, RATIOS = 5;
    localparam BITS = KIND == PAGE ? 32 : KIND == FAST || KIND == SLOW ? 9 : KIND == SECOND ? 8 :
                      KIND == GAINS ? 18 : 16;
    localparam PLACES = KIND == PAGE ? 16 : KIND == FAST || KIND == SECOND ? 4 : KIND == SLOW ? 8 : 65;
    localparam PLACE_BITS = KIND == PAGE ? 4 : KIND == FAST || KIND == SECOND ? 2 : KIND == SLOW ? 3 : 7;

    wire [31:0] page_word;
    wire [8:0] fast, slow;
    wire [7:0] second;
    wire [17:0] gain;
    wire [15:0] ratio;
    dac_slow_store #(.INDEX_BITS(2), .WORD_BITS(9), .SLOW_INDEX_BITS(3)) store (
        .clock(clock), .write_page(write_page), .write_fast(write_fast), .write_part(write_part),
        .write_bank(write_bank), .write_axis(write_axis), .write_address(write_address), .write_data(write_data),
        .enable(enable), .bank(bank), .axis(axis), .page_address(page_address), .index(index),
        .slow_index(slow_index), .knot(knot), .page_word(page_word), .fast(fast), .second(second), .slow(slow),
        .gain(gain), .ratio(ratio)
    );
    wire [BITS-1:0] given;
    wire [6:0] place;
    generate
        case (KIND)
            PAGE: assign {given, place} = {page_word, 3'd0, page_address};
            FAST: assign {given, place} = {fast, 5'd0, index};
            SECOND: assign {given, place} = {second, 5'd0, index};
            SLOW: assign {given, place} = {slow, 4'd0, slow_index};
            GAINS: assign {given, place} = {gain, knot};
            default: assign {given, place} = {ratio, knot};
        endcase
    endgenerate

    // Addresses that exist: those of the pages, of the fast table, and of each part.
    wire [13:0] places_of_part = write_address[15] ? 65 : write_address[14] ? 8 : 4;
    always @* begin
        if (write_page) assume (write_address >> 4 == (write_axis ? 2 : 1));
        if (write_fast) assume (write_address < 4);
        if (write_part) assume (write_address[13:0] < places_of_part);
    end

    // The word that is watched, and what was written to it last.
    reg watching, known, of_bank, of_axis;
    reg [6:0] of_place;
    reg [BITS-1:0] word;
    initial {watching, known} = 0;
    wire [15:0] of_address = KIND == PAGE ? (of_axis ? 16'h20 : 16'h10) + of_place :
                             KIND == FAST ? of_place : (KIND - SECOND) * 16'h4000 + of_place;
    wire writes = KIND == PAGE ? write_page : KIND == FAST ? write_fast : write_part;
    wire hit = watching && writes && write_bank == of_bank && write_axis == of_axis && write_address == of_address;
    always @* assume (watch_place < PLACES);

    // What the last read has to give.
    reg is_read;
    reg [BITS-1:0] was;
    initial is_read = 0;
    always @(posedge clock) begin
        watching <= 1;
        if (!watching) {of_bank, of_axis, of_place} <= {watch_bank, watch_axis, watch_place};
        if (hit) {known, word} <= {1'b1, write_data[BITS-1:0]};
        if (enable) begin
            is_read <= watching && known && bank == of_bank && axis == of_axis && place == of_place;
            was <= word;
        end
    end

    // The property.
    always @* if (is_read) assert (given == was);

`ifndef PROPERTIES_ALONE
    // What makes it inductive: the word in its memory, by a further port of it.
    wire [BITS-1:0] stored;
    localparam NAME = KIND == PAGE ? "\\store.pages" : KIND == FAST ? "\\store.fast_words" :
                      KIND == SECOND ? "\\store.second_words" : KIND == SLOW ? "\\store.slow_words" :
                      KIND == GAINS ? "\\store.gains" : "\\store.ratios";
    memory_port #(
        .MEMID(NAME), .ABITS(PLACE_BITS + 2), .WIDTH(BITS), .CLK_ENABLE(0), .CLK_POLARITY(1), .TRANSPARENT(0)
    ) port (.CLK(1'bx), .EN(1'b1), .ADDR({of_bank, of_axis, of_place[PLACE_BITS-1:0]}), .DATA(stored));
    always @* if (known) assert (watching && stored == word && of_place < PLACES);
    always @* if (watching) assert (of_place < PLACES);
`endif
endmodule

`default_nettype wire
