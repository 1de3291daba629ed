`default_nettype none
`timescale 1ns / 1ps

// Bench of dac_marker_delay: plays stimulus.hex, {delays, in} on each clock, and writes `out` before each edge to
// capture.txt.
module marker_delay_bench #(
    parameter CLOCKS = 1,
    parameter SIGNALS = 1,
    parameter DELAY_BITS = 8
);
    localparam BITS = SIGNALS * DELAY_BITS + SIGNALS;

    reg clock, all_done;
    reg [BITS-1:0] stimulus [0:CLOCKS-1];
    reg [BITS-1:0] inputs;
    wire [SIGNALS-1:0] out;
    integer next, capture;

    initial begin
        $readmemh("stimulus.hex", stimulus);
        capture = $fopen("capture.txt", "w");
        clock = 1'b0;
        all_done = 1'b0;
        next = 1;
        inputs = stimulus[0];
    end

    always #5 clock = !clock;

    always @(posedge clock) if (!all_done) begin
        $fwrite(capture, "%b\n", out);
        inputs <= stimulus[next];
        next <= next + 1;
        if (next == CLOCKS) begin
            $fclose(capture);
            all_done <= 1'b1;
        end
    end

    dac_marker_delay #(.SIGNALS(SIGNALS), .DELAY_BITS(DELAY_BITS)) dut (
        .clock(clock), .delays(inputs[BITS-1:SIGNALS]), .in(inputs[SIGNALS-1:0]), .out(out)
    );
endmodule

`default_nettype wire
