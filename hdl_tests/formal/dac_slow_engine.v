// In the place of dac_slow_engine for the proofs: it writes words of both axes when it likes, and is done at any time
// after both have one. Each word is a label: the line, and the colour of the program that the store has.

`default_nettype none

module dac_slow_engine #(
    parameter X_INDEX_BITS = 6,
    parameter X_WORD_BITS = 16,
    parameter Y_INDEX_BITS = 6,
    parameter Y_WORD_BITS = 16,
    parameter SLOW_INDEX_BITS = 7,
    parameter LINE_BITS = 16,
    parameter INDEX_BITS = X_INDEX_BITS > Y_INDEX_BITS ? X_INDEX_BITS : Y_INDEX_BITS,
    parameter WORD_BITS = X_WORD_BITS > Y_WORD_BITS ? X_WORD_BITS : Y_WORD_BITS
) (
    input  wire                       clock,
    input  wire                       enable,
    input  wire                       start,
    input  wire [LINE_BITS-1:0]       line,
    input  wire [LINE_BITS:0]         lines,
    output reg                        done,
    output wire                       axis,
    output wire [3:0]                 page_address,
    output wire [SLOW_INDEX_BITS-1:0] slow_index,
    output wire [6:0]                 knot,
    input  wire [31:0]                page_word,
    input  wire [WORD_BITS-1:0]       fast,
    input  wire [7:0]                 second,
    input  wire [WORD_BITS-1:0]       slow,
    input  wire [17:0]                gain,
    input  wire [15:0]                ratio,
    output wire                       write,
    output wire [3:0]                 write_address,
    output wire [31:0]                write_data,
    output wire [INDEX_BITS-1:0]      index,
    output wire                       write_table,
    output wire [WORD_BITS-1:0]       table_data,
    output wire                       write_offset,
    output wire [43:0]                offset,
    input  wire [43:0]                offset_here,
    output wire                       write_ramp,
    output wire [43:0]                ramp
);
    (* anyseq *) wire [2:0] any;
    reg works, reads;  // a word is there a clock after its address
    reg [1:0] wrote;
    initial begin
        done = 0;
        works = 0;
        reads = 0;
        wrote = 0;
    end
    assign axis = any[0];
    assign write = enable && works && reads && any[1];
    assign write_data = {line, page_word[0]};
    always @(posedge clock)
        if (start) begin
            done <= 0;
            works <= 1;
            reads <= 0;
            wrote <= 0;
        end else if (enable) begin
            reads <= 1;
            if (write) wrote[axis] <= 1;
            if (works && wrote == 3 && any[2]) begin
                done <= 1;
                works <= 0;
            end
        end
    assign {page_address, slow_index, knot, write_address, index, write_table, table_data, write_offset, offset} = 0;
    assign {write_ramp, ramp} = 0;
endmodule

`default_nettype wire
