// In the place of dac_fourier for the proofs: its ports and its handshake. After `start` it is busy for as long as it
// likes, and writes words of the table of its axis meanwhile; a reset ends that.

`default_nettype none

module dac_fourier #(
    parameter X_INDEX_BITS = 11,
    parameter Y_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_WORD_BITS = 16,
    parameter HARMONICS = 64,
    parameter SINE_FILE = "",
    parameter MULTIPLIER = 0
) (
    input  wire        clock,
    input  wire        reset,
    input  wire        write,
    input  wire        write_axis,
    input  wire [10:0] write_address,
    input  wire [31:0] write_data,
    input  wire        start,
    input  wire        axis,
    input  wire [9:0]  harmonics,
    output reg         busy,
    output reg         table_write,
    output wire        table_axis,
    output reg  [15:0] table_address,
    output reg  [23:0] table_data,
    output wire        missing
);
    (* anyseq *) reg ends, writes, misses;
    assign missing = misses;
    reg of_axis;
    initial begin
        busy = 1'b0;
        table_write = 1'b0;
        of_axis = 1'b0;
    end
    assign table_axis = of_axis;
    always @(posedge clock) begin
        busy <= !reset && (busy ? !ends : start);
        table_write <= !reset && busy && !ends && writes;  // the last word comes while it is busy
        if (start && !busy) of_axis <= axis;
        table_address <= write_address[10:0];
        table_data <= write_data[23:0];
    end
`ifndef PROPERTIES_ALONE
    always @* if (write) assert (!busy);
`endif
endmodule

`default_nettype wire
