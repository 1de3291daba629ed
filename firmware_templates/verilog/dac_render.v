// Between the commit of the host and that of the banks: computes the tables that came as Fourier words, x, then y.
//
// The program word `harmonics` is 0 if the table was uploaded, or H if 2 H + 1 Fourier words were uploaded. The commit
// goes on when the last table word is in its bank, so that a bank that waits to be taken is always complete. A reset
// or a withdrawal ends a rendering; its commit never comes. Nor does it where a word of the sine is missing.

`default_nettype none

module dac_render #(
    parameter X_INDEX_BITS = 11,
    parameter Y_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_WORD_BITS = 16,
    parameter HARMONICS = 64,
    parameter SINE_FILE = "",
    parameter MULTIPLIER = 0
) (
    input  wire        clock,
    input  wire        cancel,
    input  wire        write_x_harmonics,
    input  wire        write_y_harmonics,
    input  wire        write_x_word,
    input  wire        write_y_word,
    input  wire [10:0] write_address,
    input  wire [31:0] write_data,
    input  wire        commit,       // from the host
    output reg         rendered,     // the commit to the banks
    output reg         failed,       // in the place of `rendered`: SINE_FILE has not all of its words
    output wire        rendering,
    output wire        x_write,      // a table word
    output wire        y_write,
    output wire [15:0] address,
    output wire [23:0] data
);
    localparam [1:0] IDLE = 2'd0, X = 2'd1, Y = 2'd2;

    reg [9:0] x_harmonics, y_harmonics;
    reg [1:0] state;
    reg start, incomplete;
    wire busy, write, axis, missing;

    initial begin
        x_harmonics = 10'd0;
        y_harmonics = 10'd0;
        state = IDLE;
        start = 1'b0;
        rendered = 1'b0;
        failed = 1'b0;
        incomplete = 1'b0;
    end

    assign rendering = state != IDLE || rendered;
    assign x_write = write && !axis;
    assign y_write = write && axis;

    always @(posedge clock) begin
        if (write_x_harmonics) x_harmonics <= write_data[9:0];
        if (write_y_harmonics) y_harmonics <= write_data[9:0];
        start <= 1'b0;
        rendered <= 1'b0;
        failed <= 1'b0;
        incomplete <= state != IDLE && (incomplete || missing);
        if (cancel)
            state <= IDLE;
        else
            case (state)
                IDLE: if (commit) begin
                    state <= X;
                    start <= x_harmonics != 0;
                end
                X: if (!start && !busy) begin
                    state <= Y;
                    start <= y_harmonics != 0;
                end
                default: if (!start && !busy) begin
                    state <= IDLE;
                    rendered <= !incomplete;
                    failed <= incomplete;
                end
            endcase
    end

    dac_fourier #(
        .X_INDEX_BITS(X_INDEX_BITS), .Y_INDEX_BITS(Y_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS), .Y_WORD_BITS(Y_WORD_BITS),
        .HARMONICS(HARMONICS), .SINE_FILE(SINE_FILE), .MULTIPLIER(MULTIPLIER)
    ) fourier (
        .clock(clock), .reset(cancel), .write(write_x_word || write_y_word), .write_axis(write_y_word),
        .write_address(write_address), .write_data(write_data), .start(start), .axis(state == Y),
        .harmonics(state == Y ? y_harmonics : x_harmonics), .busy(busy), .table_write(write), .table_axis(axis),
        .table_address(address), .table_data(data), .missing(missing)
    );
endmodule

`default_nettype wire
