// dac_synchronise, whatever `in` is on each clock: that is also what the first flip-flop has settled to where `in`
// changed at an edge of the clock.
//
// The level is that of `in` STAGES clocks ago. A pulse is one clock long, is never lost or made up: as many pulses as
// rises, or changes, of that level. A level that was high since power-up is no rise.

`default_nettype none

module synchronise_properties #(
    parameter STAGES = 2
) (
    input wire clock,
    input wire in
);
    wire level, rise, change;
    dac_synchronise #(.STAGES(STAGES)) levels (.clock(clock), .in(in), .out(level));
    dac_synchronise #(.STAGES(STAGES), .PULSE(1)) rises (.clock(clock), .in(in), .out(rise));
    dac_synchronise #(.STAGES(STAGES), .PULSE(2)) changes (.clock(clock), .in(in), .out(change));

    // `in` of the last STAGES + 1 clocks, and for how many clocks there is one.
    reg [STAGES:0] history;
    reg [3:0] clocks;
    reg was_rise, odd_changes, was_low;  // a change of an odd number is a rise from the low power-up level
    initial begin
        history = 0;
        clocks = 0;
        was_rise = 0;
        odd_changes = 0;
        was_low = 0;
    end
    always @(posedge clock) begin
        history <= {history[STAGES-1:0], in};
        if (clocks != 4'd15) clocks <= clocks + 1;
        was_rise <= rise;
        odd_changes <= odd_changes ^ change;
        was_low <= was_low || !in;
    end

    // The properties.
    always @* begin
        if (clocks >= STAGES) assert (level == history[STAGES-1]);
        else assert (!level && !rise && !change);
        if (clocks > STAGES) begin
            assert (rise == (history[STAGES-1] && !history[STAGES]));
            assert (change == (history[STAGES-1] != history[STAGES]));
        end
        assert (!(rise && was_rise));
        assert ((odd_changes ^ change) == level);
        if (!was_low) assert (!rise);
        cover (rise && clocks > STAGES + 3);
        cover (change && !level);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive.
    wire rises__level, rises__edges__level_before, changes__level, changes__edges__level_before;
    wire [STAGES-2:0] rises__dac_synchronise_later;
    wire rises__dac_synchronise_first;
    always @* begin
        assert (clocks < STAGES || rises__level == level);
        assert (changes__level == level && changes__edges__level_before == odd_changes);
        if (!was_low) assert (rises__level && rises__edges__level_before && &rises__dac_synchronise_later
            && rises__dac_synchronise_first);
    end
`endif
endmodule

`default_nettype wire
