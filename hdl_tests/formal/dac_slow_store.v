// In the place of dac_slow_store for the proofs: of the words of a program only its colour, which any write sets.

`default_nettype none

module dac_slow_store #(
    parameter INDEX_BITS = 6,
    parameter WORD_BITS = 16,
    parameter SLOW_INDEX_BITS = 7
) (
    input  wire                       clock,
    input  wire                       write_page,
    input  wire                       write_fast,
    input  wire                       write_part,
    input  wire                       write_bank,
    input  wire                       write_axis,
    input  wire [15:0]                write_address,
    input  wire [31:0]                write_data,
    input  wire                       enable,
    input  wire                       bank,
    input  wire                       axis,
    input  wire [3:0]                 page_address,
    input  wire [INDEX_BITS-1:0]      index,
    input  wire [SLOW_INDEX_BITS-1:0] slow_index,
    input  wire [6:0]                 knot,
    output wire [31:0]                page_word,
    output wire [WORD_BITS-1:0]       fast,
    output wire [7:0]                 second,
    output wire [WORD_BITS-1:0]       slow,
    output wire [17:0]                gain,
    output wire [15:0]                ratio
);
    reg [1:0] colours;  // of the program in each bank
    reg colour;
    initial {colours, colour} = 0;
    always @(posedge clock) begin
        if (write_page || write_fast || write_part) colours[write_bank] <= write_data[0];
        if (enable) colour <= colours[bank];
    end
    assign page_word = {31'd0, colour};
    assign {fast, second, slow, gain, ratio} = 0;
endmodule

`default_nettype wire
