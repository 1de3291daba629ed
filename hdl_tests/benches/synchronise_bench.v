`timescale 1ns / 1ps
`default_nettype none

// Bench of one dac_synchronise: changes of `in` at the times of a file, in ps, and a line of its levels on each clock:
// `in` at the edge, `out` after it.
module synchronise_bench #(
    parameter TIMES = "times.hex",
    parameter CAPTURE = "capture.txt",
    parameter COUNT = 1,     // times
    parameter CLOCKS = 1,    // of 10 ns, the first edge at 5 ns
    parameter START = 0,     // the level of `in` before the first time
    parameter STAGES = 2,
    parameter PULSE = 0,
    parameter POWER_UP = PULSE == 1
) (
    output reg done
);
    reg [63:0] times [0:COUNT-1];
    reg in, clock, sampled;
    wire out;
    integer i, clocks, capture;

    dac_synchronise #(.STAGES(STAGES), .PULSE(PULSE), .POWER_UP(POWER_UP)) synchroniser (
        .clock(clock), .in(in), .out(out)
    );

    initial begin
        in = START != 0;
        $readmemh(TIMES, times);
        for (i = 0; i < COUNT; i = i + 1) begin
            #((times[i] - (i == 0 ? 64'd0 : times[i-1])) / 1000.0);
            in = !in;
        end
    end

    initial begin
        done = 1'b0;
        clock = 1'b0;
        capture = $fopen(CAPTURE, "w");
        for (clocks = 0; clocks < CLOCKS; clocks = clocks + 1) begin
            #5 sampled = in;
            clock = 1'b1;
            #5 $fwrite(capture, "%b%b\n", sampled, out);
            clock = 1'b0;
        end
        $fclose(capture);
        done = 1'b1;
    end
endmodule

`default_nettype wire
