// Bench of an emitted NAME_top with COMMIT_MODES and direct tables: in the second line of the scan a host writes the
// same program again and commits it with MODE. Prints whether can_keep was high, then the line and frame markers of the
// tick on which the program is swapped in.

`default_nettype none

module top_modes_bench;
    parameter MODE = 0;
    `include "annexin_200nm.vh"

    reg clock = 0, tick = 0, start = 0, write = 0, commit = 0, taken = 0;
    reg [2:0] region = 0;
    reg [15:0] address = 0;
    reg [31:0] data = 0;
    wire writable, can_keep, strobe, swapped, playing, line, frame;
    integer clocks = 0, lines = 0, at = -1;
    reg [31:0] program_words [0:47];
    reg [ANNEXIN_200NM_X_TABLE_BITS-1:0] x_words [0:ANNEXIN_200NM_X_TABLE_LENGTH-1];
    reg [ANNEXIN_200NM_Y_TABLE_BITS-1:0] y_words [0:ANNEXIN_200NM_Y_TABLE_LENGTH-1];
    initial begin
        $readmemh(ANNEXIN_200NM_PROGRAM_FILE, program_words);
        $readmemh(ANNEXIN_200NM_X_TABLE_FILE, x_words);
        $readmemh(ANNEXIN_200NM_Y_TABLE_FILE, y_words);
    end

    annexin_200nm_top #(.START_CLOCKS(50), .COMMIT_MODES(1)) dut (
        .clock(clock), .reset(1'b0), .write(write), .write_region(region), .write_address(address), .write_data(data),
        .writable(writable), .refused(), .commit(commit), .commit_mode(MODE[1:0]), .withdraw(1'b0), .committed(),
        .can_keep(can_keep), .booting(), .missing(), .arm(start), .arm_frames(16'd0), .trigger(start), .park(1'b0),
        .clear_faults(1'b0), .armed(), .running(), .tick(tick), .underrun(1'b0), .busy(), .strobe(strobe), .x_code(),
        .y_code(), .x_word(), .y_word(), .line_marker(line), .frame_marker(frame), .pixel_marker(), .backward_marker(),
        .valid_marker(), .swapped_marker(swapped), .playing(playing), .parked(), .faults(), .fault_counts()
    );

    always begin
        #5 clock = 1;
        #5 clock = 0;
        clocks = clocks + 1;
        tick = clocks % 4 == 0;
        if (strobe && swapped && taken) begin
            $display("%b%b line %0d", line, frame, lines);
            $finish;
        end
        start = strobe && swapped;
        taken = taken || start;
        if (strobe && playing && line) lines = lines + 1;
        write = 0;
        commit = 0;
        if (lines == 2 && at < 0 && writable) at = 0;
        if (at >= 0 && at < 48) {write, region, address, data} = {1'b1, 3'd0, at[15:0], program_words[at]};
        else if (at >= 48 && at < 48 + ANNEXIN_200NM_X_TABLE_LENGTH) begin
            {write, region, address} = {1'b1, 3'd1, at[15:0] - 16'd48};
            data = x_words[at-48];
        end else if (at >= 48 && at < 48 + ANNEXIN_200NM_X_TABLE_LENGTH + ANNEXIN_200NM_Y_TABLE_LENGTH) begin
            {write, region, address} = {1'b1, 3'd2, at[15:0] - 16'd48 - ANNEXIN_200NM_X_TABLE_LENGTH[15:0]};
            data = y_words[at-48-ANNEXIN_200NM_X_TABLE_LENGTH];
        end else if (at == 50 + ANNEXIN_200NM_X_TABLE_LENGTH + ANNEXIN_200NM_Y_TABLE_LENGTH) begin
            $display("can_keep %b", can_keep);
            commit = 1;
        end
        if (at >= 0) at = at + 1;
        if (clocks == 1000000) $finish;
    end
endmodule

`default_nettype wire
