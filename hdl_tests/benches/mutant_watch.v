// Beside stream_bench: ends the simulation of a mutant at its first sample that is not the model's.
//
// EXPECTED is a text file of SAMPLES words of 64 bits in hexadecimal, those that the capture of stream_bench is to have.
// One line is printed: "tick N" for a sample that differs or that the model does not have, or, at the end of the script,
// "end", the number of samples, whether the last write was refused, jitter, and the fault counts in hexadecimal.

`timescale 1ns / 1ps
`default_nettype none

module mutant_watch #(
    parameter EXPECTED = "",
    parameter SAMPLES = 1
);
    reg [63:0] expected [0:SAMPLES-1];
    integer samples = 0;

    initial $readmemh(EXPECTED, expected);

    always @(negedge stream_bench.clock)
        if (stream_bench.strobe) begin
            if (samples == SAMPLES || stream_bench.sample !== expected[samples]) begin
                $display("tick %0d", samples);
                $finish;
            end
            samples = samples + 1;
        end

    always @(posedge stream_bench.finished) begin
        #1 $display("end %0d %b %0d %h", samples, stream_bench.refused, stream_bench.jitter, stream_bench.fault_counts);
        $finish;
    end
endmodule

`default_nettype wire
