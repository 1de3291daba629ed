// The slew guard: moves the code towards its target, by at most max_step a tick, whatever the target does.
//
// What counts is the distance still to go, behind = last target - code. With the way from target to target, delta =
// target - last target, the next code is target - behind', where
//     behind' = behind + (delta - max_step)    where that is not negative: the code moves by +max_step
//     behind' = behind + (delta + max_step)    where that is negative:     the code moves by -max_step
//     behind' = 0                              otherwise:                  the code arrives
// Only `behind` is fed back, through one addition and a choice, so that a sample a clock is possible. Code and
// `reached` are there 4 clocks after the target. max_step belongs to its target, and may change with every one.
//
// Some values are kept inverted: -x is the inverse of x, and 1, and an inverted register costs nothing.

`default_nettype none

module dac_slew #(
    parameter BITS = 16,
    parameter [63:0] POWER_UP = 0  // the code before the first target
) (
    input  wire            clock,
    input  wire            valid,        // a target is there: one a tick
    input  wire [BITS-1:0] target,
    input  wire [BITS-1:0] max_step,     // a clock after its target
    input  wire [BITS-1:0] step_inverse, // max_step, inverted
    output wire [BITS-1:0] code,
    output reg             reached       // the code is at its target
);
    // Clock 1: the difference of two targets. Clock 2: that difference minus and plus the step.
    reg delta_valid, limit_valid, behind_valid;
    reg [BITS-1:0] delta_inverse, limit_inverse, behind_inverse, code_inverse;  // inverted values
    reg [BITS:0] delta;
    reg [BITS+1:0] delta_less, delta_plus;

    // Clock 3: the loop. behind is within +-(2^BITS - 1), and with delta and step within +-3 of that.
    reg signed [BITS:0] behind;
    wire [BITS+2:0] above = {{2{behind[BITS]}}, behind} + {delta_less[BITS+1], delta_less};
    wire [BITS+2:0] below = {{2{behind[BITS]}}, behind} + {delta_plus[BITS+1], delta_plus};
    wire is_above = !above[BITS+2];
    wire is_below = below[BITS+2];
    wire unused = &{above[BITS+1], below[BITS+1]};

    initial begin
        delta_valid = 1'b0;
        limit_valid = 1'b0;
        behind_valid = 1'b0;
        delta_inverse = ~POWER_UP[BITS-1:0];
        limit_inverse = ~POWER_UP[BITS-1:0];
        behind_inverse = ~POWER_UP[BITS-1:0];
        code_inverse = ~POWER_UP[BITS-1:0];
        behind = 0;
        reached = 1'b0;
    end

    assign code = ~code_inverse;

    always @(posedge clock) begin
        delta_valid <= valid;
        if (valid) begin
            delta <= {1'b0, target} + {1'b1, delta_inverse} + 1;
            delta_inverse <= ~target;
        end

        limit_valid <= delta_valid;
        limit_inverse <= delta_inverse;
        delta_less <= {delta[BITS], delta} + {2'b11, step_inverse} + 1;
        delta_plus <= {delta[BITS], delta} + {2'b00, max_step};

        behind_valid <= limit_valid;
        behind_inverse <= limit_inverse;
        if (limit_valid) behind <= is_above ? above[BITS:0] : is_below ? below[BITS:0] : {BITS+1{1'b0}};

        if (behind_valid) begin
            code_inverse <= behind_inverse + behind[BITS-1:0];
            reached <= behind == 0;
        end
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1 || BITS > 64) begin : guard_0
            dac_slew_BITS_is_not_1_to_64 stop ();
        end
        if (POWER_UP >> BITS != 64'd0) begin : guard_1
            dac_slew_POWER_UP_has_more_than_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
