// Bench of a scan with an ADC: the top of a build plays TICKS ticks of it, its markers pass dac_marker_delay, and
// adc_pixels sums samples.hex. Conversion n is at clock ADC_CLOCKS n and comes ADC_LATENCY clocks later. The ticks of
// the scan go to ticks.txt, each with the clock of its strobe and both codes. The sink is in Python.

`default_nettype none
`timescale 1ns / 1ps

module adc_picture_bench #(
    parameter TICKS = 1,
    parameter CLOCKS_PER_TICK = 8,
    parameter DELAY = 0,
    parameter ADC_CLOCKS = 3,
    parameter ADC_LATENCY = 1,
    parameter CONVERSIONS = 1
);
    reg clock, tick, start, taken, done, sample, m_axis_tready;
    reg signed [15:0] conversions [0:CONVERSIONS-1];
    reg [15:0] value;
    wire strobe, x_line, frame, pixel, backward, valid, swapped, playing, missing, refused;
    wire [3:0] faults;
    wire [15:0] x_code, y_code, lost_words;
    wire [95:0] m_axis_tdata;
    wire [5:0] m_axis_tuser;
    wire m_axis_tlast, m_axis_tvalid;
    integer clocks, played, capture, number;

    annexin_200nm_top #(.START_CLOCKS(50)) scan (
        .clock(clock), .reset(1'b0), .write(1'b0), .write_region(3'd0), .write_address(16'd0), .write_data(32'd0),
        .writable(), .refused(refused), .commit(1'b0), .commit_mode(2'd0), .withdraw(1'b0),
        .committed(), .can_keep(), .booting(), .missing(missing),
        .arm(start), .arm_frames(16'd0), .trigger(start), .park(1'b0), .clear_faults(1'b0), .armed(), .running(),
        .tick(tick), .underrun(1'b0), .busy(), .strobe(strobe), .x_code(x_code), .y_code(y_code), .x_word(), .y_word(),
        .line_marker(x_line), .frame_marker(frame), .pixel_marker(pixel), .backward_marker(backward),
        .valid_marker(valid), .swapped_marker(swapped), .playing(playing), .parked(), .faults(faults), .fault_counts()
    );

    // Pulses of one clock, and levels, all as late as the samples.
    wire [6:0] markers = {
        faults != 4'd0, playing, valid, backward, strobe && frame, strobe && x_line, strobe && pixel
    };
    wire [6:0] late;
    localparam [7:0] CLOCKS_LATE = DELAY;
    dac_marker_delay #(.SIGNALS(7), .DELAY_BITS(8)) delay (
        .clock(clock), .delays({7{CLOCKS_LATE}}), .in(markers), .out(late)
    );
    adc_pixels pixels (
        .clock(clock), .reset(1'b0), .sample(sample), .samples(value), .pixel(late[0]), .line(late[1]),
        .frame(late[2]), .backward(late[3]), .valid(late[4]), .playing(late[5]), .fault(late[6]),
        .m_axis_tdata(m_axis_tdata), .m_axis_tuser(m_axis_tuser), .m_axis_tlast(m_axis_tlast),
        .m_axis_tvalid(m_axis_tvalid), .m_axis_tready(m_axis_tready), .lost_words(lost_words)
    );

    initial begin
        $readmemh("samples.hex", conversions);
        capture = $fopen("ticks.txt", "w");
        clock = 1'b0;
        tick = 1'b0;
        start = 1'b0;
        taken = 1'b0;
        done = 1'b0;
        sample = 1'b0;
        value = 16'd0;
        m_axis_tready = 1'b0;
        clocks = 0;
        played = 0;
    end

    always #5 clock = !clock;

    always @(posedge clock) if (!done) begin
        clocks <= clocks + 1;
        tick <= clocks % CLOCKS_PER_TICK == 0;
        start <= strobe && swapped && !taken;
        taken <= taken || (strobe && swapped);
        number = (clocks + 1 - ADC_LATENCY) / ADC_CLOCKS;
        sample <= clocks + 1 >= ADC_LATENCY && (clocks + 1 - ADC_LATENCY) % ADC_CLOCKS == 0;
        value <= clocks + 1 >= ADC_LATENCY && number < CONVERSIONS ? conversions[number] : 16'd0;
        if (strobe && playing) begin
            $fwrite(capture, "%0d %0d %0d\n", clocks, x_code, y_code);
            played <= played + 1;
        end
        if (played == TICKS || missing || refused || faults != 0 || lost_words != 0) begin
            $fwrite(capture, "%0d %0d %0d\n", {missing, refused}, faults, lost_words);
            $fclose(capture);
            done <= 1'b1;
        end
    end
endmodule

`default_nettype wire
