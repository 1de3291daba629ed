// dac_pair_phase against the rule of a rational phase, for each axis by itself: at its restart the phase is 0, and at
// each advance it grows by the step of that axis, and by one more where the remainder wraps. What x does changes no
// phase of y, nor the other way round.
//
// Asked of the surroundings: the remainder is below the period, and the words of a new program that does not restart an
// axis are those that it had.

`default_nettype none

module pair_phase_properties #(
    parameter PERIOD_BITS = 4
) (
    input wire                   clock,
    input wire                   load,
    input wire [PERIOD_BITS-1:0] remainder,
    input wire [PERIOD_BITS-1:0] period,
    input wire                   load_step,
    input wire [31:0]            step,
    input wire                   restart,
    input wire                   advance
);
    wire [31:0] phase;
    dac_pair_phase #(.PERIOD_BITS(PERIOD_BITS)) position (
        .clock(clock), .load(load), .remainder(remainder), .less({1'b0, remainder} - {1'b0, period}),
        .load_step(load_step), .step(step), .restart(restart), .advance(advance), .phase(phase)
    );

    // The words and the state of both axes; the flags of a clock are by turns those of either.
    reg of_x;
    reg [PERIOD_BITS-1:0] x_remainder, y_remainder, x_period, y_period, x_rest, y_rest;
    reg [31:0] x_step, y_step, x_phase, y_phase;
    reg loaded;  // on the last clock, for the sample of this one, with other words than before
    initial begin
        of_x = 0;
        loaded = 0;
        {x_remainder, y_remainder, x_period, y_period, x_rest, y_rest} = 0;
        {x_step, y_step, x_phase, y_phase} = 0;
    end
    always @* if (load) assume (remainder < period);
    always @* if (loaded) assume (restart);

    wire [PERIOD_BITS-1:0] by = of_x ? x_remainder : y_remainder, of = of_x ? x_period : y_period;
    wire [PERIOD_BITS:0] sum = {1'b0, of_x ? x_rest : y_rest} + {1'b0, by};
    wire wraps = sum >= {1'b0, of};
    wire [PERIOD_BITS:0] wrapped = wraps ? sum - {1'b0, of} : sum;
    wire [31:0] step_here = load_step ? step : of_x ? x_step : y_step;
    wire [31:0] phase_here = of_x ? x_phase : y_phase;
    wire [PERIOD_BITS-1:0] rest =
        restart ? 0 : advance ? wrapped[PERIOD_BITS-1:0] : of_x ? x_rest : y_rest;
    wire [31:0] after = restart ? 32'd0 : advance ? phase_here + step_here + {31'd0, wraps} : phase_here;
    reg [31:0] after_1, after_2, after_3;  // of the sample of so many clocks ago
    initial {after_1, after_2, after_3} = 0;
    always @(posedge clock) begin
        of_x <= !of_x;
        loaded <= load && (remainder != (of_x ? y_remainder : x_remainder) || period != (of_x ? y_period : x_period));
        if (of_x) {x_step, x_phase, x_rest} <= {step_here, after, rest};
        else {y_step, y_phase, y_rest} <= {step_here, after, rest};
        if (load && !of_x) {x_remainder, x_period} <= {remainder, period};
        if (load && of_x) {y_remainder, y_period} <= {remainder, period};
        {after_3, after_2, after_1} <= {after_2, after_1, after};
    end

    // The property.
    always @* assert (phase == after_3);

`ifndef PROPERTIES_ALONE
    // What makes it inductive: what the loop holds, at every moment.
    reg restart_1, advance_1, wraps_1;
    initial begin
        restart_1 = 0;
        advance_1 = 0;
        wraps_1 = 0;
    end
    always @(posedge clock) begin
        restart_1 <= restart;
        advance_1 <= advance && !restart;
        wraps_1 <= wraps;
    end
    wire [PERIOD_BITS-1:0] position__at_remainder, position__other_remainder;
    wire [PERIOD_BITS:0] position__at_less, position__other_less, position__from, position__by, position__over;
    wire [31:0] position__at_step, position__other_step, position__last, position__way;
    wire position__wraps, position__restarts, position__advances, position__carry;
    wire [PERIOD_BITS-1:0] by_other = of_x ? y_remainder : x_remainder, of_other = of_x ? y_period : x_period;
    wire [PERIOD_BITS-1:0] rest_other = of_x ? y_rest : x_rest;
    wire [PERIOD_BITS:0] less_here = {1'b0, by} - {1'b0, of}, less_other = {1'b0, by_other} - {1'b0, of_other};
    always @* begin
        assert (x_period == 0 ? x_rest == 0 && x_remainder == 0 : x_remainder < x_period);
        assert (y_period == 0 ? y_rest == 0 && y_remainder == 0 : y_remainder < y_period);
        assert (x_period == 0 || x_rest < x_period || (loaded && of_x));
        assert (y_period == 0 || y_rest < y_period || (loaded && !of_x));
        assert (position__at_remainder == by && position__other_remainder == by_other);
        assert (position__at_less == less_here && position__other_less == less_other);
        assert (position__at_step == (of_x ? y_step : x_step) && position__other_step == (of_x ? x_step : y_step));
        if (!loaded) assert (position__over == {1'b0, of_x ? x_rest : y_rest} + less_here);
        assert (position__from + position__by == {1'b0, rest_other} + less_other);
        assert (position__restarts == restart_1 && position__advances == advance_1);
        if (advance_1) assert (position__wraps == wraps_1);
        assert (after_1 == (of_x ? y_phase : x_phase) && after_2 == (of_x ? x_phase : y_phase));
        assert (position__last + position__way + {31'd0, position__carry} == after_2);
        assert (after_1 == (restart_1 ? 32'd0 : advance_1 ? after_3 + position__at_step + {31'd0, wraps_1} : after_3));
    end
`endif
endmodule

`default_nettype wire
