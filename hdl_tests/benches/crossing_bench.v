// Bench of an emitted NAME_top behind a dac_synchronise for its trigger and one for park, whose pins change at the times
// of trigger.hex and park.hex, in ps. The scan is of one frame, and armed on every clock. From the tick that takes the
// program on it prints, for TICKS ticks: the number of the tick, the words, and {swapped, playing, line, frame, parked}.

`timescale 1ps / 1ps
`default_nettype none

module crossing_bench;
    parameter CLOCKS_PER_TICK = 11;
    parameter TICKS = 1;
    parameter CHANGES = 1;  // of each pin
    parameter TRIGGER_PULSE = 1;
    `include "annexin_200nm.vh"

    reg clock = 0, tick = 0, taken = 0, trigger_pin = 0, park_pin = 0;
    wire trigger, park, missing, refused, strobe, swapped, playing, parked, line, frame;
    wire [3:0] faults;
    wire [ANNEXIN_200NM_X_DAC_WORD_BITS-1:0] x_word;
    wire [ANNEXIN_200NM_Y_DAC_WORD_BITS-1:0] y_word;
    reg [63:0] trigger_times [0:CHANGES-1], park_times [0:CHANGES-1];
    integer clocks = 0, strobes = 0, printed = 0, i, k;

    dac_synchronise #(.PULSE(TRIGGER_PULSE)) trigger_synchroniser (.clock(clock), .in(trigger_pin), .out(trigger));
    dac_synchronise park_synchroniser (.clock(clock), .in(park_pin), .out(park));
    annexin_200nm_top #(.START_CLOCKS(50)) dut (
        .clock(clock), .reset(1'b0), .write(1'b0), .write_region(3'd0), .write_address(16'd0), .write_data(32'd0),
        .writable(), .refused(refused), .commit(1'b0), .commit_mode(2'd0), .withdraw(1'b0),
        .committed(), .can_keep(), .booting(), .missing(missing),
        .arm(1'b1), .arm_frames(16'd1), .trigger(trigger), .park(park), .clear_faults(1'b0), .armed(), .running(),
        .tick(tick), .underrun(1'b0), .busy(), .strobe(strobe), .x_code(), .y_code(), .x_word(x_word), .y_word(y_word),
        .line_marker(line), .frame_marker(frame), .pixel_marker(), .backward_marker(), .valid_marker(),
        .swapped_marker(swapped), .playing(playing), .parked(parked), .faults(faults), .fault_counts()
    );

    initial begin
        $readmemh("trigger.hex", trigger_times);
        for (i = 0; i < CHANGES; i = i + 1) #(trigger_times[i] - $time) trigger_pin = !trigger_pin;
    end
    initial begin
        $readmemh("park.hex", park_times);
        for (k = 0; k < CHANGES; k = k + 1) #(park_times[k] - $time) park_pin = !park_pin;
    end

    always begin
        #5000 clock = 1;
        #5000 clock = 0;
        clocks = clocks + 1;
        tick = clocks % CLOCKS_PER_TICK == 0;
        taken = taken || (strobe && swapped);
        strobes = strobes + strobe;
        if (strobe && taken) begin
            $display("%0d %0d %0d %b", strobes, x_word, y_word, {swapped, playing, line, frame, parked});
            printed = printed + 1;
        end
        if (missing || refused || faults != 0 || clocks == 4000000) begin
            $display("missing %b, refused %b, faults %b after %0d clocks", missing, refused, faults, clocks);
            $finish;
        end
        if (printed == TICKS) $finish;
    end
endmodule

`default_nettype wire
