// The two-bank memory of a table without interpolation: one read per sample. The word is valid two clocks after
// `index`.

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
    output reg  signed [WORD_BITS-1:0] word
);
    reg [WORD_BITS-1:0] memory [0:(2<<INDEX_BITS)-1];
    reg [INDEX_BITS:0] row;

    always @(posedge clock)
        if (write) memory[{write_bank, write_index}] <= write_data;

    always @(posedge clock) begin
        row <= {read_bank, index};
        word <= memory[row];
    end

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
