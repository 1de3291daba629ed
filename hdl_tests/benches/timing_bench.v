`default_nettype none

// Bench of the timing diagrams: an entry a clock from stimulus.hex, {reset, withdraw, park, trigger, arm, commit, tick,
// write, 5'd0, region[2:0], address[15:0], data[31:0]}; prints what is seen on each clock, the highest bit first.
module timing_bench;
    parameter DEPTH = 1;
    reg [63:0] stimulus [0:DEPTH-1];
    reg [63:0] now;
    reg clock;
    wire writable, refused, committed, armed, running, busy, strobe, line, frame, pixel, backward, valid, swapped;
    wire playing, parked;
    wire [15:0] x_code, y_code;
    wire [3:0] faults;
    wire [63:0] counts;
    integer i;
    dac_sequencer #(.X_INDEX_BITS(3), .Y_INDEX_BITS(2), .TICK_BITS(8)) sequencer (
        .clock(clock), .reset(now[63]), .write(now[56]), .write_region(now[50:48]), .write_address(now[47:32]),
        .write_data(now[31:0]), .writable(writable), .refused(refused), .commit(now[58]), .commit_mode(2'd0),
        .withdraw(now[62]),
        .committed(committed), .arm(now[59]), .arm_frames(16'd0), .trigger(now[60]), .park(now[61]),
        .clear_faults(1'b0), .armed(armed), .running(running), .tick(now[57]), .underrun(1'b0), .busy(busy),
        .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(line), .frame_marker(frame),
        .pixel_marker(pixel), .backward_marker(backward), .valid_marker(valid), .swapped_marker(swapped),
        .playing(playing), .parked(parked), .faults(faults), .fault_counts(counts)
    );
    initial begin
        $readmemh("stimulus.hex", stimulus);
        clock = 0;
        for (i = 0; i < DEPTH; i = i + 1) begin
            now = stimulus[i];
            #1 $display("%b", {writable, refused, committed, armed, running, strobe, swapped, playing, line, parked});
            #1 clock = 1;
            #1 clock = 0;
        end
        $finish;
    end
endmodule

`default_nettype wire
