// dac_pair_table, whatever is written and read: a word of a table is what was written last to its axis, bank and index,
// and no other word is read for it; `there` is the word after it, and after the last one of an axis the first of that
// axis. The table of y is the shorter one here.
//
// `watch` picks any word. Asked of the surroundings: the bank that was read on the last clock is not written
// (pair_program_properties proves it of the sequencer).

`default_nettype none

module pair_table_properties #(
    parameter WORD_BITS = 2
) (
    input wire                 clock,
    input wire                 write,
    input wire                 write_y,
    input wire                 write_bank,
    input wire [2:0]           write_index,
    input wire [WORD_BITS-1:0] write_data,
    input wire                 read_y,
    input wire                 read_bank,
    input wire [31:0]          phase,
    input wire                 watch_y,
    input wire                 watch_bank,
    input wire [2:0]           watch_index
);
    wire signed [WORD_BITS-1:0] here, there;
    dac_pair_table #(.WORD_BITS(WORD_BITS), .X_INDEX_BITS(3), .Y_INDEX_BITS(2)) tables (
        .clock(clock), .write(write), .write_y(write_y), .write_bank(write_bank), .write_index(write_index),
        .write_data(write_data), .read_y(read_y), .read_bank(read_bank), .phase(phase), .here(here), .there(there)
    );

    // The word that is watched, what was written to it last, and which reads are of it.
    reg watching, known, of_y, of_bank, read_bank_1;
    reg [2:0] of_index;
    reg [WORD_BITS-1:0] word, word_2, word_3;
    reg [3:1] is_here, is_there;
    reg known_2, known_3;
    initial begin
        watching = 0;
        known = 0;
        is_here = 0;
        is_there = 0;
        read_bank_1 = 0;
        known_2 = 0;
        known_3 = 0;
    end
    always @* if (write) assume (write_bank != read_bank_1);
    always @* if (write && write_y) assume (!write_index[2]);
    wire [2:0] index = read_y ? {1'b0, phase[31:30]} : phase[31:29];
    wire [2:0] after = read_y ? {1'b0, phase[31:30] + 2'd1} : phase[31:29] + 3'd1;
    wire read_watched = watching && read_y == of_y && read_bank == of_bank;
    always @(posedge clock) begin
        watching <= 1;
        if (!watching) {of_y, of_bank, of_index} <= {watch_y, watch_bank, watch_index};
        if (watching && write && write_y == of_y && write_bank == of_bank && write_index == of_index) begin
            known <= 1;
            word <= write_data;
        end
        read_bank_1 <= read_bank;
        is_here <= {is_here[2:1], read_watched && index == of_index};
        is_there <= {is_there[2:1], read_watched && after == of_index};
        {known_3, known_2} <= {known_2, known};
        {word_3, word_2} <= {word_2, word};
    end

    // The properties.
    always @* begin
        if (is_here[3] && known_3) assert (here == word_3);
        if (is_there[3] && known_3) assert (there == word_3);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive: the word in its memory, and the rows that are read.
    wire [WORD_BITS-1:0]
        tables__even_words__0, tables__even_words__1, tables__even_words__2, tables__even_words__3,
        tables__even_words__4, tables__even_words__5, tables__even_words__6, tables__even_words__7,
        tables__even_words__8, tables__even_words__9, tables__even_words__10, tables__even_words__11,
        tables__even_words__12, tables__even_words__13, tables__even_words__14, tables__even_words__15;
    wire [16*WORD_BITS-1:0] even_words = {
        tables__even_words__15, tables__even_words__14, tables__even_words__13, tables__even_words__12,
        tables__even_words__11, tables__even_words__10, tables__even_words__9, tables__even_words__8,
        tables__even_words__7, tables__even_words__6, tables__even_words__5, tables__even_words__4,
        tables__even_words__3, tables__even_words__2, tables__even_words__1, tables__even_words__0
    };
    wire [WORD_BITS-1:0]
        tables__odd_words__0, tables__odd_words__1, tables__odd_words__2, tables__odd_words__3,
        tables__odd_words__4, tables__odd_words__5, tables__odd_words__6, tables__odd_words__7,
        tables__odd_words__8, tables__odd_words__9, tables__odd_words__10, tables__odd_words__11,
        tables__odd_words__12, tables__odd_words__13, tables__odd_words__14, tables__odd_words__15;
    wire [16*WORD_BITS-1:0] odd_words = {
        tables__odd_words__15, tables__odd_words__14, tables__odd_words__13, tables__odd_words__12,
        tables__odd_words__11, tables__odd_words__10, tables__odd_words__9, tables__odd_words__8,
        tables__odd_words__7, tables__odd_words__6, tables__odd_words__5, tables__odd_words__4,
        tables__odd_words__3, tables__odd_words__2, tables__odd_words__1, tables__odd_words__0
    };
    wire [3:0] row = {of_y, of_bank, of_index[2:1]};
    wire [3:0] tables__even_row, tables__odd_row;
    wire [WORD_BITS-1:0] tables__even_word, tables__odd_word;
    wire tables__odd_at_row, tables__odd_at_word;
    always @* begin
        assert (tables__even_row[2] == read_bank_1 && tables__odd_row[2] == read_bank_1);
        if (known && !of_index[0]) assert (even_words[row*WORD_BITS +: WORD_BITS] == word);
        if (known && of_index[0]) assert (odd_words[row*WORD_BITS +: WORD_BITS] == word);
        if (known) assert (watching);
        if (is_here[1] || is_there[1]) assert (of_index[0] ? tables__odd_row == row : tables__even_row == row);
        if (is_here[1]) assert (tables__odd_at_row == of_index[0]);
        if (is_there[1]) assert (tables__odd_at_row != of_index[0]);
        if (is_here[2]) assert (tables__odd_at_word == of_index[0]);
        if (is_there[2]) assert (tables__odd_at_word != of_index[0]);
        if ((is_here[2] || is_there[2]) && known_2)
            assert ((of_index[0] ? tables__odd_word : tables__even_word) == word_2);
    end
`endif
endmodule

`default_nettype wire
