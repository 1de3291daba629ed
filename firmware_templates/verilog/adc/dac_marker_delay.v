// Delays each signal of a bundle by a number of clocks of its own, which may change while the design runs.
//
// Each signal has its past in a memory, so pulses may follow each other faster than the delay: none is lost, and levels
// keep their length. out[i] is in[i] of delays[i] clocks ago, 0 to 2^DELAY_BITS - 1; with 0 it is in[i], without a
// register. A new delay acts a clock later and at once: what lies between the old and the new one comes twice, or not
// at all. Signals before power-up were low.
//
// There is no reset: after a reset of the scan, what was under way still arrives, as the samples of the ADC do.

`default_nettype none

module dac_marker_delay #(
    parameter SIGNALS = 1,
    parameter DELAY_BITS = 8  // delays of up to 2^n - 1 clocks
) (
    input  wire                          clock,
    input  wire [SIGNALS*DELAY_BITS-1:0] delays,  // in clocks; that of signal 0 in the lowest bits
    input  wire [SIGNALS-1:0]            in,
    output wire [SIGNALS-1:0]            out
);
    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (SIGNALS < 1 || SIGNALS > 64) begin : guard_0
            dac_marker_delay_SIGNALS_is_not_1_to_64 stop ();
        end
        if (DELAY_BITS < 2 || DELAY_BITS > 16) begin : guard_1
            dac_marker_delay_DELAY_BITS_is_not_2_to_16 stop ();
        end
    endgenerate

    reg [DELAY_BITS-1:0] now;  // counts clocks: the address of what comes in on this one
    initial now = 0;
    always @(posedge clock) now <= now + 1'b1;

    genvar i;
    generate
        for (i = 0; i < SIGNALS; i = i + 1) begin : signal
            wire [DELAY_BITS-1:0] delay = delays[i*DELAY_BITS +: DELAY_BITS];
            wire [DELAY_BITS-1:0] address = now + 1'b1 - delay;
            reg past [0:(1<<DELAY_BITS)-1];
            reg recalled, latest, is_0, is_1;
            integer k;
            initial begin
                for (k = 0; k < 1 << DELAY_BITS; k = k + 1) past[k] = 1'b0;
                latest = 1'b0;
                is_0 = 1'b0;
                is_1 = 1'b1;  // the output on the first clock: `recalled` has no power-up value, as in block RAM
            end
            always @(posedge clock) begin
                past[now] <= in[i];
                recalled <= past[address];  // for a delay of 2 or more: it was written before this clock
                latest <= in[i];
                is_0 <= delay == 0;
                is_1 <= delay == 1;
            end
            assign out[i] = is_0 ? in[i] : is_1 ? latest : recalled;
        end
    endgenerate
endmodule

`default_nettype wire
