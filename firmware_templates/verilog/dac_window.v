// An imaging window of a program, [first, first + count): whether a position is inside, for positions that count up
// from 0.
//
// The window may be empty. `imaging` and `opens` belong to the position two clocks ago.

`default_nettype none

module dac_window #(
    parameter BITS = 24  // bits of a position
) (
    input  wire          clock,
    input  wire          write_first,
    input  wire          write_count,
    input  wire [BITS:0] data,
    input  wire          load,      // the position of the next clock is the first one of a new program
    input  wire          valid,     // the position advances, or restarts
    input  wire          restart,   // the position is 0
    input  wire [BITS-1:0] position,
    output reg           opens,     // the position is `first`
    output reg           imaging,
    output reg  [BITS:0] idle_count  // length of the window in the idle program
);
    reg [BITS:0] idle_first, first, stop;
    initial begin
        idle_first = 0;
        first = 0;
        stop = 0;
    end
    reg is_valid, is_first, is_stop, is_zero;
    initial begin
        is_valid = 0;
        is_first = 0;
        is_stop = 0;
        is_zero = 0;
    end

    initial begin
        opens = 1'b0;
        imaging = 1'b0;
        idle_count = 0;
    end

    always @(posedge clock) begin
        if (write_first) idle_first <= data;
        if (write_count) idle_count <= data;
        if (load) begin
            first <= idle_first;
            stop <= idle_first + idle_count;
        end

        is_valid <= valid;
        is_first <= {1'b0, position} == first;
        is_stop <= {1'b0, position} == stop;
        is_zero <= restart;

        if (is_valid) begin
            opens <= is_first && !is_stop;
            imaging <= !is_stop && (is_first || (imaging && !is_zero));
        end
    end
endmodule

`default_nettype wire
