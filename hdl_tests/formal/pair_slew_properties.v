// dac_pair_slew against the definition of the slew guard, for each axis by itself: whatever targets, steps and ticks
// come, the code of an axis moves towards its own target by at most the max_step of that axis, and by nothing without a
// target. What x does changes no code of y, nor the other way round.
//
// Nothing is assumed of the inputs. The target of a clock is by turns one of y and one of x; y has the clock of
// power-up. A max_step stays until the next one of its axis.

`default_nettype none

module pair_slew_properties #(
    parameter BITS = 4,
    parameter [63:0] X_POWER_UP = 3,
    parameter [63:0] Y_POWER_UP = 10
) (
    input wire            clock,
    input wire            valid,
    input wire [BITS-1:0] target,
    input wire            load,
    input wire [BITS-1:0] max_step
);
    wire [BITS-1:0] code_inverse;
    wire reached;
    dac_pair_slew #(.BITS(BITS), .X_POWER_UP(X_POWER_UP), .Y_POWER_UP(Y_POWER_UP)) guard (
        .clock(clock), .valid(valid), .target(target), .load(load), .max_step(max_step),
        .code_inverse(code_inverse), .reached(reached)
    );
    wire [BITS-1:0] code = ~code_inverse;

    // The words of both axes, and the last target of each.
    reg of_x;
    reg [BITS-1:0] x_step, y_step, x_target, y_target;
    wire [BITS-1:0] step = load ? max_step : of_x ? x_step : y_step;
    wire [BITS-1:0] aim = valid ? target : of_x ? x_target : y_target;
    // What is on its way: _k belongs to the target of k clocks ago.
    reg [5:1] ticks;
    reg [BITS-1:0] step_1, step_2, step_3, step_4, step_5, aim_1, aim_2, aim_3, aim_4, aim_5, code_1, code_2;
    reg later;
    initial begin
        of_x = 0;
        later = 0;
        x_step = 0;
        y_step = 0;
        x_target = X_POWER_UP[BITS-1:0];
        y_target = Y_POWER_UP[BITS-1:0];
        ticks = 0;
        {step_1, step_2, step_3, step_4, step_5} = 0;
        {aim_1, aim_3, aim_5} = {3{X_POWER_UP[BITS-1:0]}};
        {aim_2, aim_4} = {2{Y_POWER_UP[BITS-1:0]}};
        code_1 = Y_POWER_UP[BITS-1:0];
        code_2 = X_POWER_UP[BITS-1:0];
    end
    always @(posedge clock) begin
        of_x <= !of_x;
        later <= 1;
        if (of_x) begin
            x_step <= step;
            x_target <= aim;
        end else begin
            y_step <= step;
            y_target <= aim;
        end
        ticks <= {ticks[4:1], valid};
        {step_5, step_4, step_3, step_2, step_1} <= {step_4, step_3, step_2, step_1, step};
        {aim_5, aim_4, aim_3, aim_2, aim_1} <= {aim_4, aim_3, aim_2, aim_1, aim};
        {code_2, code_1} <= {code_1, code};
    end

    // The property: the code of this axis before is that of two clocks ago.
    wire [BITS-1:0] distance = code > code_2 ? code - code_2 : code_2 - code;
    always @* begin
        assert (ticks[5] || code == code_2);
        if (ticks[5]) begin
            assert (distance <= step_5);
            assert (code_2 <= aim_5 ? code_2 <= code && code <= aim_5 : code_2 >= code && code >= aim_5);
            assert (code == aim_5 || distance == step_5);
        end
        if (later) assert (reached == (code == aim_5));
    end

`ifndef PROPERTIES_ALONE
    // What makes it inductive: what the registers of the guard hold, at every moment.
    wire guard__valid_1;
    wire [BITS-1:0] guard__target_1, guard__target_2, guard__target_3, guard__target_4;
    wire [BITS-1:0] guard__step_inverse, guard__last_step;
    wire [BITS:0] guard__delta;
    wire [BITS+1:0] guard__less, guard__plus;
    wire [BITS+2:0] guard__above, guard__below;
    wire signed [BITS:0] guard__behind;
    wire signed [BITS+2:0] to_1 = $signed({3'd0, aim_1}) - $signed({3'd0, aim_3});
    wire signed [BITS+2:0] to_2 = $signed({3'd0, aim_2}) - $signed({3'd0, aim_4});
    wire signed [BITS+2:0] by_2 = ticks[2] ? $signed({3'd0, step_2}) : 0;
    wire signed [BITS+2:0] by_3 = ticks[3] ? $signed({3'd0, step_3}) : 0;
    wire signed [BITS+2:0] to_go_3 = $signed({3'd0, aim_3}) - $signed({3'd0, code});
    wire signed [BITS+2:0] to_go_4 = $signed({3'd0, aim_4}) - $signed({3'd0, code_1});
    wire signed [BITS+2:0] left = guard__behind, way = to_go_4 - left, limit = $signed({3'd0, step_4});
    wire signed [BITS+2:0] less = $signed(guard__less), plus = $signed(guard__plus), delta = $signed(guard__delta);
    always @* begin
        assert (guard__valid_1 == ticks[1]);
        assert (guard__target_1 == ~aim_1 && guard__target_2 == ~aim_2);
        assert (guard__target_3 == ~aim_3 && guard__target_4 == ~aim_4);
        assert (aim_2 == (of_x ? x_target : y_target) && aim_1 == (of_x ? y_target : x_target));
        assert (ticks[1] || aim_1 == aim_3);
        assert (ticks[2] || aim_2 == aim_4);
        assert (ticks[3] || aim_3 == aim_5);
        assert (step_1 == (of_x ? y_step : x_step) && step_2 == (of_x ? x_step : y_step));
        assert (guard__step_inverse == ~step_1 && guard__last_step == ~step_2);
        if (ticks[1]) assert (delta == to_1);
        assert (less == (ticks[2] ? to_2 - by_2 : 0) && plus == (ticks[2] ? to_2 + by_2 : 0));
        assert (!later || $signed(guard__above) == to_go_3 - by_3);
        assert (!later || $signed(guard__below) == to_go_3 + by_3);
        assert (later || (guard__above == 0 && guard__below == 0 && to_go_3 == 0));
        if (ticks[4]) begin
            assert (to_go_4 < 0 ? to_go_4 <= left && left <= 0 : 0 <= left && left <= to_go_4);
            assert (way <= limit && -way <= limit);
            assert (left == 0 || (to_go_4 < 0 ? way == -limit : way == limit));
        end else
            assert (left == to_go_4);
    end
`endif
endmodule

`default_nettype wire
