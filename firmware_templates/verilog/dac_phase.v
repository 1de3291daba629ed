// Rational phase: at advance k of a period of N advances the phase is exactly floor(k 2^32 / N), for ever.
//
// The integer part of 2^32 / N is added at every advance, and one more whenever the remainder, which grows modulo N,
// wraps. No multiplier, no divider, no drift. The phase of a tick is there two clocks after it.

`default_nettype none

module dac_phase #(
    parameter PERIOD_BITS = 31
) (
    input  wire        clock,
    input  wire        write,
    input  wire [3:0]  write_address,
    input  wire [31:0] write_data,
    input  wire        take,     // the tick of the next clock is the first one of a new program, and a restart
    input  wire        load,     // the tick of this clock is the first one of a new program
    input  wire        tick,
    input  wire        restart,  // with a tick: advance 0 of a period
    input  wire        advance,  // with a tick: the tick advances the phase
    output reg  [31:0] phase
);
    localparam [3:0] PHASE_STEP = 4'd0, PHASE_REMAINDER = 4'd1, PHASE_PERIOD = 4'd2;

    wire [31:0] step;  // floor(2^32 / N)
    dac_register #(.BITS(32)) step_word (
        .clock(clock), .write(write && write_address == PHASE_STEP), .data(write_data), .load(load), .value(step)
    );
    reg [PERIOD_BITS-1:0] idle_remainder, idle_period_inverse;
    initial begin
        idle_remainder = 0;
        idle_period_inverse = 0;
    end
    reg [PERIOD_BITS-1:0] remainder;  // 2^32 mod N
    reg [PERIOD_BITS:0] less;         // remainder - N
    initial begin
        remainder = 0;
        less = 0;
    end
    always @(posedge clock) begin
        if (write && write_address == PHASE_REMAINDER) idle_remainder <= write_data[PERIOD_BITS-1:0];
        if (write && write_address == PHASE_PERIOD) idle_period_inverse <= ~write_data[PERIOD_BITS-1:0];
        if (take) begin
            remainder <= idle_remainder;
            less <= {1'b0, idle_remainder} + {1'b1, idle_period_inverse} + 1;
        end
    end

    // rest + remainder - N, where rest grows by the remainder modulo N: not negative when the next advance wraps it.
    reg [PERIOD_BITS:0] over;
    reg wraps, restarts, advances;
    wire [PERIOD_BITS:0] from = restart ? {PERIOD_BITS+1{1'b0}} : over;
    wire [PERIOD_BITS:0] by = restart || !over[PERIOD_BITS] ? less : {1'b0, remainder};

    initial begin
        over = 0;
        wraps = 1'b0;
        restarts = 1'b0;
        advances = 1'b0;
        phase = 32'd0;
    end

    always @(posedge clock) begin
        restarts <= tick && restart;
        advances <= tick && advance;
        if (tick && (restart || advance)) begin
            over <= from + by;
            wraps <= !restart && !over[PERIOD_BITS];
        end
        // One clock behind, so that the two carry chains are not in series.
        if (restarts)
            phase <= 32'd0;
        else if (advances)
            phase <= phase + step + {31'd0, wraps};
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (PERIOD_BITS < 1 || PERIOD_BITS > 31) begin : guard_0
            dac_phase_PERIOD_BITS_is_not_1_to_31 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
