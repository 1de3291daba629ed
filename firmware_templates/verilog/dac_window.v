// An imaging window of a program, [first, first + count): whether a position is inside, for positions that count up
// from 0; with JUMPS also where a new program begins at any other one.
//
// The window may be empty. `imaging` and `opens` belong to the position two clocks ago.

`default_nettype none

module dac_window #(
    parameter BITS = 24,  // bits of a position
    parameter JUMPS = 0
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
    // Where positions jump they are compared by the sign of a difference, with both ends stored inverted.
    localparam [BITS:0] INVERTED = {BITS+1{JUMPS != 0}};
    reg [BITS:0] idle_first, first, stop;
    wire [BITS:0] idle_stop = idle_first + idle_count;
    wire [BITS+1:0] behind_first = {2'b00, position} + {1'b1, first} + 1;
    wire [BITS+1:0] behind_stop = {2'b00, position} + {1'b1, stop} + 1;
    wire unused = &{behind_first, behind_stop};
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
            first <= idle_first ^ INVERTED;
            stop <= idle_stop ^ INVERTED;
        end

        is_valid <= valid;
        is_first <= JUMPS != 0 ? !behind_first[BITS+1] : {1'b0, position} == first;
        is_stop <= JUMPS != 0 ? !behind_stop[BITS+1] : {1'b0, position} == stop;
        is_zero <= restart;

        if (is_valid) begin
            opens <= is_first && !is_stop;
            imaging <= !is_stop && (is_first || (JUMPS == 0 && imaging && !is_zero));
        end
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1) begin : guard_0
            dac_window_BITS_is_less_than_1 stop ();
        end
        if (JUMPS < 0 || JUMPS > 1) begin : guard_1
            dac_window_JUMPS_is_not_0_to_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
