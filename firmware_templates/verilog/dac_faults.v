// Sticky faults and their counters, which saturate. A fault on the clock of a clear stays.

`default_nettype none

module dac_faults #(
    parameter FAULTS = 4,
    parameter COUNT_BITS = 16
) (
    input  wire                         clock,
    input  wire                         clear,
    input  wire [FAULTS-1:0]            happens,
    output reg  [FAULTS-1:0]            faults,
    output reg  [FAULTS*COUNT_BITS-1:0] counts   // the counter of fault 0 is in the lowest bits
);
    initial faults = 0;

    always @(posedge clock) faults <= (clear ? {FAULTS{1'b0}} : faults) | happens;

    genvar i;
    generate
        for (i = 0; i < FAULTS; i = i + 1) begin : counter
            wire [COUNT_BITS-1:0] count = counts[i*COUNT_BITS +: COUNT_BITS];
            initial counts[i*COUNT_BITS +: COUNT_BITS] = 0;
            always @(posedge clock)
                if (clear)
                    counts[i*COUNT_BITS +: COUNT_BITS] <= {{COUNT_BITS-1{1'b0}}, happens[i]};
                else if (happens[i] && count != {COUNT_BITS{1'b1}})
                    counts[i*COUNT_BITS +: COUNT_BITS] <= count + 1;
        end
    endgenerate

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (FAULTS < 1) begin : guard_0
            dac_faults_FAULTS_is_less_than_1 stop ();
        end
        if (COUNT_BITS < 2 || COUNT_BITS > 32) begin : guard_1
            dac_faults_COUNT_BITS_is_not_2_to_32 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
