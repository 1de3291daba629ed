// dac_direct_table of the ECP5: the two-bank table of an axis in dac_memory, with the register of its block RAMs.
//
// `word` is that of the `index` of two clocks ago, as there.

`default_nettype none

module dac_direct_table #(
    parameter WORD_BITS = 16,
    parameter INDEX_BITS = 11
) (
    input  wire                        clock,
    input  wire                        write,
    input  wire                        write_bank,
    input  wire [INDEX_BITS-1:0]       write_index,
    input  wire [WORD_BITS-1:0]        write_data,
    input  wire                        read_bank,
    input  wire [INDEX_BITS-1:0]       index,
    output wire signed [WORD_BITS-1:0] word
);
    dac_memory #(.BITS(WORD_BITS), .ADDRESS_BITS(INDEX_BITS + 1)) memory (
        .clock(clock), .write(write), .write_address({write_bank, write_index}), .write_data(write_data),
        .address({read_bank, index}), .word(word)
    );

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (WORD_BITS < 1) begin : guard_0
            dac_direct_table_WORD_BITS_is_less_than_1 stop ();
        end
        if (INDEX_BITS < 1) begin : guard_1
            dac_direct_table_INDEX_BITS_is_less_than_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
