// The slew guard against its definition: whatever targets, steps and ticks come, a code moves towards its target by at
// most the max_step of that target, and by nothing without one.
//
// Nothing is assumed of the inputs but what dac_output gives: max_step a clock after its target, and its inverse beside
// it.

`default_nettype none

module slew_properties #(
    parameter BITS = 8,
    parameter [63:0] POWER_UP = 3
) (
    input wire            clock,
    input wire            valid,
    input wire [BITS-1:0] target,
    input wire [BITS-1:0] step   // of that target
);
    wire [BITS-1:0] code;
    wire reached;
    reg [BITS-1:0] step_1, step_2, step_3;
    dac_slew #(.BITS(BITS), .POWER_UP(POWER_UP)) guard (
        .clock(clock), .valid(valid), .target(target), .max_step(step_1), .step_inverse(~step_1),
        .code(code), .reached(reached)
    );

    // What is on its way.
    reg valid_1, valid_2, valid_3, moved;
    reg [BITS-1:0] target_1, target_2, target_3, last_target, code_before, step_taken;
    initial begin
        valid_1 = 0;
        valid_2 = 0;
        valid_3 = 0;
        moved = 0;
        target_1 = POWER_UP[BITS-1:0];
        target_2 = POWER_UP[BITS-1:0];
        target_3 = POWER_UP[BITS-1:0];
        last_target = POWER_UP[BITS-1:0];
        code_before = POWER_UP[BITS-1:0];
        step_taken = 0;
    end
    always @(posedge clock) begin
        step_1 <= step;
        step_2 <= step_1;
        step_3 <= step_2;
        valid_1 <= valid;
        valid_2 <= valid_1;
        valid_3 <= valid_2;
        if (valid) target_1 <= target;
        target_2 <= target_1;
        target_3 <= target_2;
        moved <= valid_3;
        code_before <= code;
        if (valid_3) begin
            last_target <= target_3;
            step_taken <= step_3;
        end
    end

    // The property. It leaves one code only: the target, or a whole step towards it.
    wire [BITS-1:0] distance = code > code_before ? code - code_before : code_before - code;
    always @* begin
        assert (moved || code == code_before);
        if (moved) begin
            assert (distance <= step_taken);
            assert (code_before <= last_target ? code_before <= code && code <= last_target
                                               : code_before >= code && code >= last_target);
            assert (code == last_target || distance == step_taken);
            assert (reached == (code == last_target));
        end
    end

    // What makes it inductive: what the registers of the guard hold, at every moment.
    wire guard__delta_valid, guard__limit_valid, guard__behind_valid;
    wire [BITS-1:0] guard__delta_inverse, guard__limit_inverse, guard__behind_inverse;
    wire [BITS:0] guard__delta;
    wire [BITS+1:0] guard__delta_less, guard__delta_plus;
    wire signed [BITS:0] guard__behind;
    wire signed [BITS+1:0] to_2 = $signed({2'b00, target_1}) - $signed({2'b00, target_2});
    wire signed [BITS+1:0] to_3 = $signed({2'b00, target_2}) - $signed({2'b00, target_3});
    wire signed [BITS+1:0] to_go = $signed({2'b00, target_3}) - $signed({2'b00, code});
    wire signed [BITS+1:0] limit = $signed({2'b00, step_3});
    wire signed [BITS+1:0] left = guard__behind;
    wire signed [BITS+1:0] way = to_go - left;
    always @* begin
        assert (guard__delta_valid == valid_1 && guard__limit_valid == valid_2 && guard__behind_valid == valid_3);
        assert (guard__delta_inverse == ~target_1 && guard__limit_inverse == ~target_2);
        assert (guard__behind_inverse == ~target_3);
        assert (valid_1 || target_1 == target_2);
        assert (valid_2 || target_2 == target_3);
        assert (valid_3 || target_3 == last_target);
        if (valid_1) assert ($signed(guard__delta) == to_2);
        if (valid_2) assert ($signed(guard__delta_less) == to_3 - $signed({2'b00, step_2}));
        if (valid_2) assert ($signed(guard__delta_plus) == to_3 + $signed({2'b00, step_2}));
        if (valid_3) begin
            assert (to_go < 0 ? to_go <= left && left <= 0 : 0 <= left && left <= to_go);
            assert (way <= limit && -way <= limit);
            assert (left == 0 || (to_go < 0 ? way == -limit : way == limit));
        end else
            assert (left == to_go);
    end
endmodule

`default_nettype wire
