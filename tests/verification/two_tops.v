// Plays a scan with the output z as a design does: both tops on one clock, with the same ticks and requests. Writes a
// line for every strobe: 0 of x and y or 1 of z, the number of its tick, both words, the markers, the faults. A line
// that begins with 2 says before which tick a request came: 1 trigger, 2 park, 3 trigger of one frame.
`timescale 1ns / 1ps
`default_nettype none

module two_tops #(
    parameter PACE = 93,      // clocks from tick to tick
    parameter WAIT = 0,       // clocks from the end of the boot to the first trigger
    parameter HAND_OVER = 0,  // 1: the trigger of z is held until all run, and x and y get theirs from it
    parameter TICKS = 100,    // until the park
    parameter PARKED = 3,     // after it, until the trigger of one frame
    parameter LATER = 100     // after that
);
    reg clock = 0, arm = 0, trigger = 0, park = 0, tick = 0;
    reg [15:0] arm_frames = 0;
    integer clocks = 0, given = 0, of_axes = 0, of_z = 0;

    wire booting, booting_z, running, running_z, strobe, strobe_z;
    wire line, frame, pixel, backward, valid, swapped, playing, parked;
    wire line_z, frame_z, pixel_z, backward_z, valid_z, swapped_z, playing_z, parked_z;
    wire [3:0] faults, faults_z;
    wire [15:0] x_word, y_word, z_word, rest_word;
    wire differ = HAND_OVER != 0 && running != running_z;  // no tick meanwhile
    wire trigger_axes = HAND_OVER != 0 ? running_z && !running : trigger;

    annexin_200nm_top #(.PLAIN_MULTIPLIER(1), .START_CLOCKS(50)) axes (
        .clock(clock), .reset(1'b0), .write(1'b0), .write_region(3'd0), .write_address(16'd0), .write_data(32'd0),
        .writable(), .refused(), .commit(1'b0), .commit_mode(2'd0), .withdraw(1'b0),
        .committed(), .can_keep(), .booting(booting), .missing(),
        .arm(arm), .arm_frames(arm_frames), .trigger(trigger_axes), .park(park), .clear_faults(1'b0), .armed(),
        .running(running), .tick(tick && !differ), .underrun(1'b0), .busy(), .strobe(strobe), .x_code(), .y_code(),
        .x_word(x_word), .y_word(y_word), .line_marker(line), .frame_marker(frame), .pixel_marker(pixel),
        .backward_marker(backward), .valid_marker(valid), .swapped_marker(swapped), .playing(playing),
        .parked(parked), .faults(faults), .fault_counts()
    );
    annexin_200nm_z_top #(.START_CLOCKS(50)) z (
        .clock(clock), .reset(1'b0), .write(1'b0), .write_region(3'd0), .write_address(16'd0), .write_data(32'd0),
        .writable(), .refused(), .commit(1'b0), .commit_mode(2'd0), .withdraw(1'b0),
        .committed(), .can_keep(), .booting(booting_z), .missing(),
        .arm(arm), .arm_frames(arm_frames), .trigger(trigger), .park(park), .clear_faults(1'b0), .armed(),
        .running(running_z), .tick(tick && !differ), .underrun(1'b0), .busy(), .strobe(strobe_z), .x_code(), .y_code(),
        .x_word(z_word), .y_word(rest_word), .line_marker(line_z), .frame_marker(frame_z), .pixel_marker(pixel_z),
        .backward_marker(backward_z), .valid_marker(valid_z), .swapped_marker(swapped_z), .playing(playing_z),
        .parked(parked_z), .faults(faults_z), .fault_counts()
    );

    task step;
        begin
            tick = clocks % PACE == 0;
            #4;
            if (tick && !differ) given = given + 1;
            #1 clock = 1;
            #5 clock = 0;
            clocks = clocks + 1;
            if (strobe) begin
                $display("0 %0d %0d %0d %0d %0d", of_axes, x_word, y_word,
                         {parked, playing, swapped, valid, backward, pixel, frame, line}, faults);
                of_axes = of_axes + 1;
            end
            if (strobe_z) begin
                $display("1 %0d %0d %0d %0d %0d", of_z, z_word, rest_word,
                         {parked_z, playing_z, swapped_z, valid_z, backward_z, pixel_z, frame_z, line_z}, faults_z);
                of_z = of_z + 1;
            end
        end
    endtask

    task play;  // a tick, and a few clocks
        input integer ticks;
        integer until;
        begin
            until = given + ticks;
            while (given < until) step;
            repeat (7) step;
        end
    endtask

    task start;
        input [15:0] frames;
        begin
            arm = 1;
            trigger = 1;
            arm_frames = frames;
            step;
            arm = 0;
            while (HAND_OVER != 0 && !(running && running_z)) step;
            trigger = 0;
        end
    endtask

    initial begin
        step;
        while (booting || booting_z) step;
        repeat (WAIT) step;
        start(0);
        $display("2 %0d 1", given);
        play(TICKS);
        park = 1;
        $display("2 %0d 2", given);
        step;
        park = 0;
        play(PARKED);
        start(1);
        $display("2 %0d 3", given);
        play(LATER);
        repeat (2 * PACE) step;
        $finish(0);
    end
endmodule

`default_nettype wire
