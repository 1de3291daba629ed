// A memory of words with a port that writes and one that reads: `word` is that of the `address` of two clocks ago.
//
// Of a word that is written while it is read, any value may come: the tables write the bank that does not play alone.
// Here the address is registered, and the word is the output of the block RAM. A part whose block RAMs are slow without
// a register behind them may take another file in the place of this one: that of the ECP5 is in ecp5/.

`default_nettype none

module dac_memory #(
    parameter BITS = 16,
    parameter ADDRESS_BITS = 11
) (
    input  wire                    clock,
    input  wire                    write,
    input  wire [ADDRESS_BITS-1:0] write_address,
    input  wire [BITS-1:0]         write_data,
    input  wire [ADDRESS_BITS-1:0] address,
    output reg  [BITS-1:0]         word
);
    reg [BITS-1:0] words [0:(1<<ADDRESS_BITS)-1];
    reg [ADDRESS_BITS-1:0] row;

    always @(posedge clock) if (write) words[write_address] <= write_data;

    always @(posedge clock) begin
        row <= address;
        word <= words[row];
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1) begin : guard_0
            dac_memory_BITS_is_less_than_1 stop ();
        end
        if (ADDRESS_BITS < 1) begin : guard_1
            dac_memory_ADDRESS_BITS_is_less_than_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
