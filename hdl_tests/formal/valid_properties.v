// The valid marker: never high in a line that settles, off the target, or while a fault is flagged.
//
// dac_markers and dac_verdict as dac_sequencer wires them, with the delay between them cut short: it shifts, and
// nothing else. Ticks, what begins with them, programs, faults and clears come as they like. The reference counts the
// lines that settle at the tick itself and sends its answer along.

`default_nettype none

module valid_properties #(
    parameter TICK_BITS = 4,
    parameter LINE_BITS = 2,
    parameter COUNT_BITS = 2
) (
    input wire                 clock,
    input wire                 write,
    input wire [3:0]           write_address,
    input wire [31:0]          write_data,
    input wire                 take,
    input wire                 tick,
    input wire                 runs_in,
    input wire                 begins_in,
    input wire                 line_in,
    input wire                 frame_in,
    input wire [TICK_BITS-1:0] tick_number,
    input wire [LINE_BITS-1:0] line_number,
    input wire                 clears,
    input wire [3:0]           x,
    input wire [3:0]           y,
    input wire                 reached,
    input wire                 clamped,
    input wire                 overrun,
    input wire                 underrun
);
    // As dac_scan gives them: flags only while a scan plays, and a new program, or a scan, begins with a line.
    reg load;
    initial load = 0;
    always @(posedge clock) load <= take;
    wire runs = runs_in;
    wire begins = runs_in && (begins_in || load);
    wire line = runs_in && (line_in || begins);
    wire frame = line && (frame_in || begins);
    always @* if (load) assume (tick);

    wire line_3, frame_3, pixel_3, backward_3, images_3;
    dac_markers #(.TICK_BITS(TICK_BITS), .LINE_BITS(LINE_BITS)) markers (
        .clock(clock), .write(write), .write_address(write_address), .write_data(write_data), .take(take), .load(load),
        .tick(tick), .runs(runs), .begins(begins), .line(line), .frame(frame), .tick_number(tick_number),
        .line_number(line_number), .line_marker(line_3), .frame_marker(frame_3), .pixel_marker(pixel_3),
        .backward_marker(backward_3), .images(images_3)
    );
    wire done, runs_done, begins_done, swapped_done;
    dac_delay #(.BITS(4), .CLOCKS(3)) with_markers (
        .clock(clock), .in({tick, runs, begins, load}), .out({done, runs_done, begins_done, swapped_done})
    );
    wire strobe, line_marker, frame_marker, pixel_marker, backward_marker, valid_marker, swapped_marker;
    wire playing, parked;
    wire [3:0] x_code, y_code, faults;
    wire [4*COUNT_BITS-1:0] fault_counts;
    dac_verdict #(.DAC_BITS(4), .COUNT_BITS(COUNT_BITS)) verdict (
        .clock(clock), .tick(done), .runs(runs_done), .begins(begins_done), .swapped(swapped_done), .clears(clears),
        .line(line_3), .frame(frame_3), .pixel(pixel_3), .backward(backward_3), .images(images_3), .x(x), .y(y),
        .reached(reached), .clamped(clamped), .overrun(overrun), .underrun(underrun), .strobe(strobe), .x_code(x_code),
        .y_code(y_code), .line_marker(line_marker), .frame_marker(frame_marker), .pixel_marker(pixel_marker),
        .backward_marker(backward_marker), .valid_marker(valid_marker), .swapped_marker(swapped_marker),
        .playing(playing), .parked(parked), .faults(faults), .fault_counts(fault_counts)
    );

    // Lines still to settle, the one of this tick included.
    reg [7:0] written_lines, settle_lines, left;
    initial begin
        written_lines = 0;
        settle_lines = 0;
        left = 0;
    end
    wire [7:0] of_program = load ? written_lines : settle_lines;
    wire [7:0] left_now = begins ? of_program : line && left != 0 ? left - 1 : left;
    wire settles = runs && left_now != 0;
    always @(posedge clock) begin
        if (write && write_address == 4'd2) written_lines <= write_data[7:0];
        if (load) settle_lines <= written_lines;
        if (tick) left <= left_now;
    end
    // With the sample, and with the output that holds until the next one.
    reg settles_1, settles_2, settles_3, settles_out, reached_out, runs_out, clears_out;
    reg [3:0] happened;
    initial begin
        settles_1 = 0;
        settles_2 = 0;
        settles_3 = 0;
        settles_out = 0;
        reached_out = 0;
        runs_out = 0;
        clears_out = 0;
        happened = 0;
    end
    always @(posedge clock) begin
        settles_1 <= settles;
        settles_2 <= settles_1;
        settles_3 <= settles_2;
        if (done) begin
            settles_out <= settles_3;
            reached_out <= reached;
            runs_out <= runs_done;
        end
        clears_out <= done && clears;
        happened <= {underrun, overrun, done && runs_done && clamped, 1'b0};
    end
    always @* begin
        if (valid_marker) assert (!settles_out);
        if (valid_marker) assert (reached_out && runs_out);
        if (valid_marker) assert (faults == 4'd0);
        assert ((faults & happened) == happened);  // what happens is flagged at once
    end
    always @* cover (valid_marker);

    // A flag stays until it is cleared.
    reg [3:0] faults_before;
    initial faults_before = 0;
    always @(posedge clock) faults_before <= faults;
    always @* if (!clears_out) assert ((faults & faults_before) == faults_before);

    // Counters: cleared alone, or one more for each clock of their fault, up to the most they hold, and there they stay.
    // A code off its target is a slew fault, unless a scan or a program has begun and not been caught up with yet.
    reg catching_up, slew;
    initial catching_up = 0;
    initial slew = 0;
    always @(posedge clock) begin
        slew <= done && runs_done && !reached && !catching_up && !begins_done;
        if (done && runs_done) catching_up <= (catching_up || begins_done) && !reached;
    end
    wire [3:0] counted = happened | {3'd0, slew};
    always @* assert ((faults & counted) == counted);
    reg [4*COUNT_BITS-1:0] counts_before;
    initial counts_before = 0;
    always @(posedge clock) counts_before <= fault_counts;
    genvar i;
    generate
        for (i = 0; i < 4; i = i + 1) begin : counter
            wire [COUNT_BITS-1:0] count = fault_counts[i*COUNT_BITS +: COUNT_BITS];
            wire [COUNT_BITS-1:0] from = clears_out ? 0 : counts_before[i*COUNT_BITS +: COUNT_BITS];
            always @* assert (count == (counted[i] && from != {COUNT_BITS{1'b1}} ? from + 1 : from));
        end
    endgenerate

    // What makes it inductive: the count of dac_markers is the one above, two clocks later.
    wire markers__tick_1, markers__tick_2, markers__begins_1, markers__line_1, markers__runs_1, markers__runs_2;
    wire markers__settled_2, verdict__catching_up;
    always @* assert (verdict__catching_up == catching_up);
    wire [7:0] markers__settle_left, markers__settle_lines, markers__settle_lines_word__idle;
    wire [7:0] left_then = !markers__tick_1 ? markers__settle_left
        : markers__begins_1 ? markers__settle_lines
        : markers__line_1 && markers__settle_left != 0 ? markers__settle_left - 1 : markers__settle_left;
    reg tick_1, tick_2;
    initial begin
        tick_1 = 0;
        tick_2 = 0;
    end
    always @(posedge clock) begin
        tick_1 <= tick;
        tick_2 <= tick_1;
    end
    always @* begin
        assert (markers__settle_lines == settle_lines && markers__settle_lines_word__idle == written_lines);
        assert (left_then == left);
        if (markers__settled_2) assert (markers__settle_left == 0);
        assert (markers__tick_1 == tick_1 && markers__tick_2 == tick_2);
        if (tick_1) assert (settles_1 == (markers__runs_1 && left_then != 0));
        if (tick_2 && settles_2) assert (markers__runs_2 && !markers__settled_2);
    end
endmodule

`default_nettype wire
