// What a tick turned out to be, once both codes are known: caught up or not, faulty or not, valid or not.
//
// One clock after `tick`, everything that leaves belongs together: codes, markers and `strobe`.

`default_nettype none

module dac_verdict #(
    parameter DAC_BITS = 16,
    parameter COUNT_BITS = 16,
    parameter [63:0] X_POWER_UP_CODE = 0,
    parameter [63:0] Y_POWER_UP_CODE = 0
) (
    input  wire                    clock,
    input  wire                    tick,
    // inputs of this tick
    input  wire                    runs,
    input  wire                    begins,
    input  wire                    swapped,
    input  wire                    clears,      // the tick clears the faults
    input  wire                    line,
    input  wire                    frame,
    input  wire                    pixel,
    input  wire                    backward,
    input  wire                    images,
    input  wire [DAC_BITS-1:0]     x,
    input  wire [DAC_BITS-1:0]     y,
    input  wire                    reached,     // both are at their targets
    input  wire                    clamped,     // a limit changed one of them
    // inputs of any clock
    input  wire                    overrun,
    input  wire                    underrun,
    output reg                     strobe,      // one clock: the outputs below are new
    output reg  [DAC_BITS-1:0]     x_code,
    output reg  [DAC_BITS-1:0]     y_code,
    output reg                     line_marker,
    output reg                     frame_marker,
    output reg                     pixel_marker,
    output reg                     backward_marker,
    output reg                     valid_marker,
    output reg                     swapped_marker,
    output reg                     playing,     // a scan plays
    output reg                     parked,      // no scan plays, and both codes are at their park codes
    output wire [3:0]              faults,      // slew, clamp, overrun, underrun
    output wire [4*COUNT_BITS-1:0] fault_counts
);
    reg catching_up;
    initial catching_up = 0;
    wire was_catching_up = catching_up || begins;
    wire slew_fault = tick && runs && !reached && !was_catching_up;
    wire clamp_fault = tick && runs && clamped;
    wire clear = tick && clears;
    wire [3:0] happens = {underrun, overrun, clamp_fault, slew_fault};
    // A slew fault needs no mention: a code that was held back has not reached its target.
    wire faulty = underrun || overrun || clamp_fault || (faults != 4'd0 && !clear);

    dac_faults #(.FAULTS(4), .COUNT_BITS(COUNT_BITS)) sticky (
        .clock(clock), .clear(clear), .happens(happens), .faults(faults), .counts(fault_counts)
    );

    initial begin
        strobe = 1'b0;
        x_code = X_POWER_UP_CODE[DAC_BITS-1:0];
        y_code = Y_POWER_UP_CODE[DAC_BITS-1:0];
        line_marker = 1'b0;
        frame_marker = 1'b0;
        pixel_marker = 1'b0;
        backward_marker = 1'b0;
        valid_marker = 1'b0;
        swapped_marker = 1'b0;
        playing = 1'b0;
        parked = 1'b0;
    end

    always @(posedge clock) begin
        strobe <= tick;
        if (tick) begin
            x_code <= x;
            y_code <= y;
            line_marker <= line;
            frame_marker <= frame;
            pixel_marker <= pixel;
            backward_marker <= backward;
            valid_marker <= images && reached && !faulty;
            swapped_marker <= swapped;
            playing <= runs;
            parked <= !runs && reached;
            if (runs) catching_up <= was_catching_up && !reached;
        end else if (faulty)
            valid_marker <= 1'b0;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (DAC_BITS < 1) begin : guard_0
            dac_verdict_DAC_BITS_is_less_than_1 stop ();
        end
        if (X_POWER_UP_CODE >> DAC_BITS != 64'd0) begin : guard_1
            dac_verdict_X_POWER_UP_CODE_has_more_than_DAC_BITS stop ();
        end
        if (Y_POWER_UP_CODE >> DAC_BITS != 64'd0) begin : guard_2
            dac_verdict_Y_POWER_UP_CODE_has_more_than_DAC_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
