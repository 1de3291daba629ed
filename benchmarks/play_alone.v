// Plays the example by itself for TICKS ticks, one a clock, with `*` as the simulator has it, and prints a sum of all
// codes: what `tablegen verify` plays for a frame, without a record, a model or a comparison.
`default_nettype none

module play_alone;
    parameter TICKS = 1000;

    `include "annexin_200nm.vh"

    reg clock = 1'b0, start = 1'b0, loaded = 1'b0;
    wire writable, write, commit, strobe, swapped;
    wire [2:0] region;
    wire [15:0] address;
    wire [31:0] data;
    wire [15:0] x_code, y_code;
    reg [63:0] sum = 64'd0;
    reg [31:0] ticks = 32'd0;

    always #1 clock = !clock;

    always @(posedge clock) begin
        start <= strobe && swapped && !loaded;
        if (strobe && swapped) loaded <= 1'b1;
        if (strobe && loaded) begin
            sum <= sum + x_code + y_code;
            ticks <= ticks + 32'd1;
            if (ticks == TICKS) begin
                $display("%0d", sum);
                $finish;
            end
        end
    end

    dac_boot #(
        .PROGRAM_FILE(ANNEXIN_200NM_PROGRAM_FILE), .X_FILE(ANNEXIN_200NM_X_TABLE_FILE),
        .Y_FILE(ANNEXIN_200NM_Y_TABLE_FILE), .X_WORDS(ANNEXIN_200NM_X_TABLE_LENGTH),
        .Y_WORDS(ANNEXIN_200NM_Y_TABLE_LENGTH), .START_CLOCKS(0)
    ) boot (
        .clock(clock), .reset(1'b0), .host_write(1'b0), .host_region(3'd0), .host_address(16'd0), .host_data(32'd0),
        .host_commit(1'b0), .writable(writable), .write(write), .write_region(region), .write_address(address),
        .write_data(data), .commit(commit), .starting(), .booting(), .missing()
    );

    dac_sequencer #(
        .X_INDEX_BITS(ANNEXIN_200NM_X_INDEX_BITS), .Y_INDEX_BITS(ANNEXIN_200NM_Y_INDEX_BITS), .PLAIN_MULTIPLIER(1)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(write), .write_region(region), .write_address(address), .write_data(data),
        .writable(writable), .refused(), .commit(commit), .commit_mode(2'd0), .withdraw(1'b0), .committed(), .arm(start),
        .arm_frames(16'd0), .trigger(start), .park(1'b0), .clear_faults(1'b0), .armed(), .running(), .tick(1'b1),
        .underrun(1'b0), .busy(), .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(), .frame_marker(),
        .pixel_marker(), .backward_marker(), .valid_marker(), .swapped_marker(swapped), .playing(), .parked(), .faults()
    );
endmodule

`default_nettype wire
