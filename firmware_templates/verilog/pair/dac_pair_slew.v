// The slew guard of both axes, by turns: each code moves towards its target, by at most max_step a tick.
//
// The law is that of dac_slew. Its loop takes two clocks here, one for the sums and one for the choice, and holds both
// axes: where there is no tick the distance is not changed, because both steps are then 0. Code and `reached` are there
// 5 clocks after the target.

`default_nettype none

module dac_pair_slew #(
    parameter BITS = 16,
    parameter [63:0] X_POWER_UP = 0,
    parameter [63:0] Y_POWER_UP = 0
) (
    input  wire            clock,
    input  wire            valid,      // a target is there
    input  wire [BITS-1:0] target,
    input  wire            load,       // max_step, for the target of this clock
    input  wire [BITS-1:0] max_step,
    output reg  [BITS-1:0] code_inverse,
    output reg             reached     // the code is at its target
);
    wire [BITS-1:0] step_inverse, last_step;
    dac_pair_ring #(.BITS(BITS), .POWER_UP_NOW(32'hffffffff), .POWER_UP_OTHER(32'hffffffff)) steps (
        .clock(clock), .load(load), .value(~max_step), .now(step_inverse), .other(last_step)
    );

    // The targets of both axes, inverted.
    reg [BITS-1:0] target_1, target_2, target_3, target_4;
    reg valid_1;
    reg [BITS:0] delta;
    reg [BITS+1:0] less, plus;
    reg [BITS+2:0] above, below;
    reg signed [BITS:0] behind;
    wire [BITS-1:0] step = ~step_inverse;
    wire is_above = !above[BITS+2];
    wire is_below = below[BITS+2];
    wire unused = &{above[BITS+1], below[BITS+1], last_step};

    initial begin
        target_1 = ~X_POWER_UP[BITS-1:0];
        target_2 = ~Y_POWER_UP[BITS-1:0];
        target_3 = ~X_POWER_UP[BITS-1:0];
        target_4 = ~Y_POWER_UP[BITS-1:0];
        valid_1 = 1'b0;
        delta = 0;
        less = 0;
        plus = 0;
        above = 0;
        below = 0;
        behind = 0;
        code_inverse = ~X_POWER_UP[BITS-1:0];
        reached = 1'b0;
    end

    always @(posedge clock) begin
        delta <= {1'b0, target} + {1'b1, target_2} + 1;
        target_1 <= valid ? ~target : target_2;
        target_2 <= target_1;
        valid_1 <= valid;

        if (valid_1) begin
            less <= {delta[BITS], delta} + {2'b11, step_inverse} + 1;
            plus <= {delta[BITS], delta} + {2'b00, step};
        end else begin
            less <= 0;
            plus <= 0;
        end

        above <= {{2{behind[BITS]}}, behind} + {less[BITS+1], less};
        below <= {{2{behind[BITS]}}, behind} + {plus[BITS+1], plus};
        target_3 <= target_2;

        behind <= is_above ? above[BITS:0] : is_below ? below[BITS:0] : {BITS+1{1'b0}};
        target_4 <= target_3;

        code_inverse <= target_4 + behind[BITS-1:0];
        reached <= behind == 0;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1 || BITS > 32) begin : guard_0
            dac_pair_slew_BITS_is_not_1_to_32 stop ();
        end
        if (X_POWER_UP >> BITS != 64'd0) begin : guard_1
            dac_pair_slew_X_POWER_UP_has_more_than_BITS stop ();
        end
        if (Y_POWER_UP >> BITS != 64'd0) begin : guard_2
            dac_pair_slew_Y_POWER_UP_has_more_than_BITS stop ();
        end
    endgenerate
endmodule

`default_nettype wire
