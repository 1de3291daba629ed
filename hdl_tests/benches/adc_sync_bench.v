`default_nettype none
`timescale 1ns / 1ps

// Bench of adc_pixels with line and frame signals of pins: changes of pins.hex, {time in ps, frame, line, pixel}, through
// dac_synchronise. A sample comes on every clock, the number of the clock modulo 1000; the sink is in Python.
module adc_sync_bench #(
    parameter CHANGES = 1
);
    reg [66:0] changes [0:CHANGES-1];
    reg clock, done, frame_pin, line_pin, pixel_pin, m_axis_tready;
    reg [15:0] value;
    wire frame, line, pixel, m_axis_tlast, m_axis_tvalid;
    wire [5:0] m_axis_tuser;
    wire [95:0] m_axis_tdata;
    wire [15:0] lost_words;
    integer i;

    dac_synchronise #(.PULSE(1)) frame_in (.clock(clock), .in(frame_pin), .out(frame));
    dac_synchronise #(.PULSE(1)) line_in (.clock(clock), .in(line_pin), .out(line));
    dac_synchronise #(.PULSE(1)) pixel_in (.clock(clock), .in(pixel_pin), .out(pixel));
    adc_pixels pixels (
        .clock(clock), .reset(1'b0), .sample(1'b1), .samples(value), .pixel(pixel), .line(line), .frame(frame),
        .backward(1'b0), .valid(1'b1), .playing(1'b1), .fault(1'b0), .m_axis_tdata(m_axis_tdata),
        .m_axis_tuser(m_axis_tuser), .m_axis_tlast(m_axis_tlast), .m_axis_tvalid(m_axis_tvalid),
        .m_axis_tready(m_axis_tready), .lost_words(lost_words)
    );

    initial begin
        clock = 1'b0;
        value = 16'd0;
        m_axis_tready = 1'b0;
        forever #5 clock = !clock;
    end
    always @(posedge clock) value <= value == 16'd999 ? 16'd0 : value + 16'd1;

    initial begin
        $readmemh("pins.hex", changes);
        done = 1'b0;
        {frame_pin, line_pin, pixel_pin} = 3'd0;
        for (i = 0; i < CHANGES; i = i + 1) begin
            #((changes[i][66:3] - (i == 0 ? 64'd0 : changes[i-1][66:3])) / 1000.0);
            {frame_pin, line_pin, pixel_pin} = changes[i][2:0];
        end
        #500 done = 1'b1;
    end
endmodule

`default_nettype wire
