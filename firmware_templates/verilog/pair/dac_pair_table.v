// The tables of both axes in one memory, two banks each: the bank that plays is read, the other one is written.
//
// As in dac_table, even and odd words are in memories of their own, and `here` and `there` come three clocks after the
// phase. Each axis has the place of the longer table.

`default_nettype none

module dac_pair_table #(
    parameter WORD_BITS = 16,
    parameter X_INDEX_BITS = 11,
    parameter Y_INDEX_BITS = 11,
    parameter LONGER_BITS = X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS  // derived: do not set it
) (
    input  wire                        clock,
    input  wire                        write,
    input  wire                        write_y,
    input  wire                        write_bank,
    input  wire [LONGER_BITS-1:0]      write_index,
    input  wire [WORD_BITS-1:0]        write_data,
    input  wire                        read_y,
    input  wire                        read_bank,
    input  wire [31:0]                 phase,
    output reg  signed [WORD_BITS-1:0] here,
    output reg  signed [WORD_BITS-1:0] there
);
    localparam X_ROW_BITS = X_INDEX_BITS - 1, Y_ROW_BITS = Y_INDEX_BITS - 1, ROW_BITS = LONGER_BITS - 1;

    reg [WORD_BITS-1:0] even_words [0:(2<<LONGER_BITS)-1];
    reg [WORD_BITS-1:0] odd_words [0:(2<<LONGER_BITS)-1];

    reg [ROW_BITS+1:0] even_row, odd_row;
    reg [WORD_BITS-1:0] even_word, odd_word;
    reg odd_at_row, odd_at_word;

    wire unused = &phase;
    wire [X_ROW_BITS-1:0] x_row = phase[31 -: X_ROW_BITS];
    wire [Y_ROW_BITS-1:0] y_row = phase[31 -: Y_ROW_BITS];
    wire odd = read_y ? phase[32-Y_INDEX_BITS] : phase[32-X_INDEX_BITS];
    // The row after the last one of a table is its first.
    wire [X_ROW_BITS-1:0] x_next = x_row + {{X_ROW_BITS-1{1'b0}}, phase[32-X_INDEX_BITS]};
    wire [Y_ROW_BITS-1:0] y_next = y_row + {{Y_ROW_BITS-1{1'b0}}, phase[32-Y_INDEX_BITS]};
    wire [ROW_BITS:0] x_even = {{ROW_BITS-X_ROW_BITS+1{1'b0}}, x_next}, x_odd = {{ROW_BITS-X_ROW_BITS+1{1'b0}}, x_row};
    wire [ROW_BITS:0] y_even = {{ROW_BITS-Y_ROW_BITS+1{1'b0}}, y_next}, y_odd = {{ROW_BITS-Y_ROW_BITS+1{1'b0}}, y_row};

    wire [ROW_BITS+1:0] write_row = {write_y, write_bank, write_index[LONGER_BITS-1:1]};

    always @(posedge clock) begin
        // The bank that is read is never written: said here, it saves the logic for a word that is written and read
        // at once.
        if (write && !write_index[0] && write_bank != even_row[ROW_BITS]) even_words[write_row] <= write_data;
        if (write && write_index[0] && write_bank != odd_row[ROW_BITS]) odd_words[write_row] <= write_data;
    end

    wire [ROW_BITS:0] next = read_y ? y_even : x_even;
    wire [ROW_BITS:0] same = read_y ? y_odd : x_odd;
    initial begin
        even_row = 0;
        odd_row = 0;
    end
    wire unused_high = next[ROW_BITS] || same[ROW_BITS];

    always @(posedge clock) begin
        even_row <= {read_y, read_bank, next[ROW_BITS-1:0]};
        odd_row <= {read_y, read_bank, same[ROW_BITS-1:0]};
        odd_at_row <= odd;

        even_word <= even_words[even_row];
        odd_word <= odd_words[odd_row];
        odd_at_word <= odd_at_row;

        here <= odd_at_word ? odd_word : even_word;
        there <= odd_at_word ? even_word : odd_word;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (WORD_BITS < 1) begin : guard_0
            dac_pair_table_WORD_BITS_is_less_than_1 stop ();
        end
        if (X_INDEX_BITS < 2 || X_INDEX_BITS > 16 || Y_INDEX_BITS < 2 || Y_INDEX_BITS > 16) begin : guard_1
            dac_pair_table_X_or_Y_INDEX_BITS_are_not_2_to_16 stop ();
        end
        if (LONGER_BITS != (X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS)) begin : guard_2
            dac_pair_table_LONGER_BITS_follows_from_X_and_Y_INDEX_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
