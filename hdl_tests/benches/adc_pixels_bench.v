`default_nettype none
`timescale 1ns / 1ps

// Bench of adc_pixels: plays stimulus.hex, a line a clock, and writes what was there at each edge to capture.txt:
// {m_axis_tready, m_axis_tvalid, lost_words}, and where tvalid is high the beat. A line of the stimulus is
// {ready, fault, playing, valid, backward, frame, line, pixel, reset, sample, samples of 64 bits}. With SINK the ready
// signal is that of a sink in Python.
module adc_pixels_bench #(
    parameter CLOCKS = 1,
    parameter SINK = 0,
    parameter CHANNELS = 1,
    parameter SAMPLE_BITS = 16,
    parameter SIGNED = 1,
    parameter COUNT_BITS = 16,
    parameter DEPTH_BITS = 4
);
    localparam DATA_BITS = 32 * CHANNELS + 64;

    reg clock, done, m_axis_tready;
    wire all_done = done;
    reg [73:0] stimulus [0:CLOCKS-1];
    reg [72:0] inputs;
    wire [DATA_BITS-1:0] m_axis_tdata;
    wire [5:0] m_axis_tuser;
    wire m_axis_tlast, m_axis_tvalid;
    wire [15:0] lost_words;
    integer next, capture;

    initial begin
        $readmemh("stimulus.hex", stimulus);
        capture = $fopen("capture.txt", "w");
        clock = 1'b0;
        done = 1'b0;
        inputs = 73'd0;
        m_axis_tready = 1'b0;
        next = 0;
    end

    always #5 clock = !clock;

    always @(posedge clock) if (!done) begin
        $fwrite(capture, "%b%b %h", m_axis_tready, m_axis_tvalid, lost_words);
        if (m_axis_tvalid) $fwrite(capture, " %b %h %h", m_axis_tlast, m_axis_tuser, m_axis_tdata);
        $fwrite(capture, "\n");
        if (next == CLOCKS) begin
            $fclose(capture);
            done <= 1'b1;
        end else begin
            inputs <= stimulus[next][72:0];
            if (SINK == 0) m_axis_tready <= stimulus[next][73];
            next <= next + 1;
        end
    end

    adc_pixels #(
        .CHANNELS(CHANNELS), .SAMPLE_BITS(SAMPLE_BITS), .SIGNED(SIGNED), .COUNT_BITS(COUNT_BITS),
        .DEPTH_BITS(DEPTH_BITS)
    ) dut (
        .clock(clock), .reset(inputs[65]), .sample(inputs[64]), .samples(inputs[CHANNELS*SAMPLE_BITS-1:0]),
        .pixel(inputs[66]), .line(inputs[67]), .frame(inputs[68]), .backward(inputs[69]), .valid(inputs[70]),
        .playing(inputs[71]), .fault(inputs[72]), .m_axis_tdata(m_axis_tdata), .m_axis_tuser(m_axis_tuser),
        .m_axis_tlast(m_axis_tlast), .m_axis_tvalid(m_axis_tvalid), .m_axis_tready(m_axis_tready),
        .lost_words(lost_words)
    );
endmodule

`default_nettype wire
