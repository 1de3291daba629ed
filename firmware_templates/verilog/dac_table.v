// The two-bank table memory of an axis: the bank that plays is read, the other one is written.
//
// Even and odd words are in memories of their own, so that two neighbouring words are read on one clock from block RAM
// with one read port. `here` is word `index`, `there` the one after it, and after the last the first; both are there
// three clocks after `index`.

`default_nettype none

module dac_table #(
    parameter WORD_BITS = 16,
    parameter INDEX_BITS = 11  // a bank holds 2^INDEX_BITS words; at least 2
) (
    input  wire                         clock,
    input  wire                         write,
    input  wire                         write_bank,
    input  wire [INDEX_BITS-1:0]        write_index,
    input  wire [WORD_BITS-1:0]         write_data,
    input  wire                         read_bank,
    input  wire [INDEX_BITS-1:0]        index,
    output reg  signed [WORD_BITS-1:0]  here,
    output reg  signed [WORD_BITS-1:0]  there
);
    localparam ROW_BITS = INDEX_BITS - 1;

    wire [ROW_BITS-1:0] row = index[INDEX_BITS-1:1];
    wire [ROW_BITS-1:0] next_row = row + {{ROW_BITS-1{1'b0}}, index[0]};
    wire [INDEX_BITS-1:0] write_address = {write_bank, write_index[INDEX_BITS-1:1]};
    wire [WORD_BITS-1:0] even_word, odd_word;
    reg odd_at_row, odd_at_word;

    dac_memory #(.BITS(WORD_BITS), .ADDRESS_BITS(INDEX_BITS)) even (
        .clock(clock), .write(write && !write_index[0]), .write_address(write_address), .write_data(write_data),
        .address({read_bank, next_row}), .word(even_word)
    );
    dac_memory #(.BITS(WORD_BITS), .ADDRESS_BITS(INDEX_BITS)) odd (
        .clock(clock), .write(write && write_index[0]), .write_address(write_address), .write_data(write_data),
        .address({read_bank, row}), .word(odd_word)
    );

    always @(posedge clock) begin
        odd_at_row <= index[0];
        odd_at_word <= odd_at_row;

        here <= odd_at_word ? odd_word : even_word;
        there <= odd_at_word ? even_word : odd_word;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (WORD_BITS < 1) begin : guard_0
            dac_table_WORD_BITS_is_less_than_1 stop ();
        end
        if (INDEX_BITS < 2) begin : guard_1
            dac_table_INDEX_BITS_is_less_than_2 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
