// Bench of an emitted NAME_top: a tick every CLOCKS_PER_TICK clocks; it starts the scan once the program has been taken,
// and prints the words and markers of every tick from that one to the TICKS-th of the scan.

`default_nettype none

module top_bench;
    parameter CLOCKS_PER_TICK = 11;
    parameter TICKS = 1;
    parameter ALTERNATE = 0;
    `include "annexin_200nm.vh"

    reg clock = 0, tick = 0, start = 0, taken = 0;
    wire refused, missing, strobe, swapped, playing, line, frame, valid;
    wire [3:0] faults;
    wire [ANNEXIN_200NM_X_DAC_WORD_BITS-1:0] x_word;
    wire [ANNEXIN_200NM_Y_DAC_WORD_BITS-1:0] y_word;
    integer clocks = 0, played = 0;

    annexin_200nm_top #(.START_CLOCKS(50), .ALTERNATE(ALTERNATE)) dut (
        .clock(clock), .reset(1'b0), .write(1'b0), .write_region(3'd0), .write_address(16'd0), .write_data(32'd0),
        .writable(), .refused(refused), .commit(1'b0), .commit_mode(2'd0), .withdraw(1'b0),
        .committed(), .can_keep(), .booting(), .missing(missing),
        .arm(start), .arm_frames(16'd0), .trigger(start), .park(1'b0), .clear_faults(1'b0), .armed(), .running(),
        .tick(tick), .underrun(1'b0), .busy(), .strobe(strobe), .x_code(), .y_code(), .x_word(x_word), .y_word(y_word),
        .line_marker(line), .frame_marker(frame), .pixel_marker(), .backward_marker(), .valid_marker(valid),
        .swapped_marker(swapped), .playing(playing), .parked(), .faults(faults), .fault_counts()
    );

    always begin
        #5 clock = 1;
        #5 clock = 0;
        clocks = clocks + 1;
        tick = clocks % CLOCKS_PER_TICK == 0;
        start = strobe && swapped;
        taken = taken || start;
        if (strobe && taken) begin
            $display("%0d %0d %b", x_word, y_word, {playing, line, frame, valid});
            played = played + playing;
        end
        if (missing || refused || faults != 0 || clocks == 4000000) begin
            $display("missing %b, refused %b, faults %b after %0d clocks", missing, refused, faults, clocks);
            $finish;
        end
        if (played == TICKS) $finish;
    end
endmodule

`default_nettype wire
