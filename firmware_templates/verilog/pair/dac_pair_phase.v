// The phases of both axes, by turns: at advance k of a period of N, floor(k 2^32 / N), as in dac_phase.
//
// A loop of two clocks holds what one flip-flop and one adder of dac_phase hold: while the sum of one axis is made, the
// other's is in the register. What does not advance goes round as it is. The phase of a sample is there three clocks
// after its flags.

`default_nettype none

module dac_pair_phase #(
    parameter PERIOD_BITS = 31
) (
    input  wire                   clock,
    input  wire                   load,       // for the sample of the next clock
    input  wire [PERIOD_BITS-1:0] remainder,  // 2^32 mod N
    input  wire [PERIOD_BITS:0]   less,       // remainder - N
    input  wire                   load_step,  // for the sample of this clock
    input  wire [31:0]            step,       // floor(2^32 / N)
    input  wire                   restart,    // advance 0 of a period
    input  wire                   advance,    // the sample advances the phase
    output reg  [31:0]            phase
);
    wire [PERIOD_BITS-1:0] at_remainder, other_remainder;
    wire [PERIOD_BITS:0] at_less, other_less;
    wire [31:0] at_step, other_step;
    dac_pair_ring #(.BITS(PERIOD_BITS)) remainders (
        .clock(clock), .load(load), .value(remainder), .now(at_remainder), .other(other_remainder)
    );
    dac_pair_ring #(.BITS(PERIOD_BITS + 1)) lesses (
        .clock(clock), .load(load), .value(less), .now(at_less), .other(other_less)
    );
    dac_pair_ring #(.BITS(32)) steps (
        .clock(clock), .load(load_step), .value(step), .now(at_step), .other(other_step)
    );
    wire unused = &{other_remainder, other_less, other_step};

    // over is rest + remainder - N, where rest grows by the remainder modulo N: not negative when the next advance
    // wraps it.
    reg [PERIOD_BITS:0] from, by, over;
    reg wraps, restarts, advances;
    reg [31:0] last, way;
    reg carry;
    wire [32:0] sum = {last, 1'b1} + {way, carry};
    wire unused_sum = sum[0];

    initial begin
        from = 0;
        by = 0;
        over = 0;
        wraps = 1'b0;
        restarts = 1'b0;
        advances = 1'b0;
        last = 32'd0;
        way = 32'd0;
        carry = 1'b0;
        phase = 32'd0;
    end

    always @(posedge clock) begin
        from <= restart ? {PERIOD_BITS+1{1'b0}} : over;
        if (restart || advance)
            by <= restart || !over[PERIOD_BITS] ? at_less : {1'b0, at_remainder};
        else
            by <= 0;
        over <= from + by;

        wraps <= !over[PERIOD_BITS];
        restarts <= restart;
        advances <= advance && !restart;
        last <= restarts ? 32'd0 : phase;
        way <= advances ? at_step : 32'd0;
        carry <= advances && wraps;
        phase <= sum[32:1];
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (PERIOD_BITS < 1 || PERIOD_BITS > 31) begin : guard_0
            dac_pair_phase_PERIOD_BITS_is_not_1_to_31 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
