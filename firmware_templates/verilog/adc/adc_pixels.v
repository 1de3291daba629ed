// Sums the samples of an ADC over each pixel, and sends a word for each pixel by AXI4-Stream.
//
// The specification is docs/pixels.md, its integer model tablegen/device/adc_pixels.py.
//
// pixel, line, frame  one clock: a pixel, a line, a frame begins; its first sample may come on the same clock
// valid, backward     levels: image data; the backward sweep
// playing, fault      levels: a scan plays; it has a fault. Without such signals, tie them to 1 and 0
//
// m_axis_tdata  from the lowest bits up: a sum of 32 bits for each channel, then count, line, column and flags of 16
//               bits each. A sum is signed where samples are
// m_axis_tuser  the flags: 0 valid, 1 backward, 2 the first pixel of a frame, 3 words were lost just before this one,
//               4 there were more samples than are counted, 5 the last pixel of its sweep
// m_axis_tlast  the last pixel of its sweep
// lost_words    words that found the FIFO full since the reset, up to 65535
//
// Latency: a word is at the output two clocks after the clock that ends its pixel, if the FIFO is empty.

`default_nettype none

module adc_pixels #(
    parameter CHANNELS = 1,                // 1 or 2, sampled together
    parameter SAMPLE_BITS = 16,
    parameter SIGNED = 1,                  // samples are 1: two's complement; 0: straight binary
    parameter COUNT_BITS = 16,             // the first 2^n - 1 samples of a pixel are summed
    parameter DEPTH_BITS = 4,              // a FIFO of 2^n words
    parameter DATA_BITS = 32 * CHANNELS + 64  // follows from CHANNELS: do not set it
) (
    input  wire                            clock,
    input  wire                            reset,
    input  wire                            sample,   // the samples below are new
    input  wire [CHANNELS*SAMPLE_BITS-1:0] samples,  // channel 0 in the lower bits
    input  wire                            pixel,
    input  wire                            line,
    input  wire                            frame,
    input  wire                            backward,
    input  wire                            valid,
    input  wire                            playing,
    input  wire                            fault,
    output wire [DATA_BITS-1:0]            m_axis_tdata,
    output wire [5:0]                      m_axis_tuser,
    output wire                            m_axis_tlast,
    output wire                            m_axis_tvalid,
    input  wire                            m_axis_tready,
    output reg  [15:0]                     lost_words
);
    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (CHANNELS < 1 || CHANNELS > 2) begin : guard_0
            adc_pixels_CHANNELS_is_not_1_to_2 stop ();
        end
        if (SAMPLE_BITS < 2 || SAMPLE_BITS > 30) begin : guard_1
            adc_pixels_SAMPLE_BITS_is_not_2_to_30 stop ();
        end
        if (SIGNED < 0 || SIGNED > 1) begin : guard_2
            adc_pixels_SIGNED_is_not_0_to_1 stop ();
        end
        if (COUNT_BITS < 2 || COUNT_BITS > 16) begin : guard_3
            adc_pixels_COUNT_BITS_is_not_2_to_16 stop ();
        end
        if (SAMPLE_BITS + COUNT_BITS > 32) begin : guard_4
            adc_pixels_SAMPLE_BITS_and_COUNT_BITS_are_more_than_32 stop ();
        end
        if (DEPTH_BITS < 1 || DEPTH_BITS > 16) begin : guard_5
            adc_pixels_DEPTH_BITS_is_not_1_to_16 stop ();
        end
        if (DATA_BITS != 32 * CHANNELS + 64) begin : guard_6
            adc_pixels_DATA_BITS_follows_from_CHANNELS_do_not_set_it stop ();
        end
    endgenerate

    // No sum of so many samples overflows.
    localparam SUM_BITS = SAMPLE_BITS + COUNT_BITS;
    localparam SUMS = CHANNELS * SUM_BITS;
    localparam STORED = SUMS + COUNT_BITS + 16 + 16 + 6;

    // Lines and columns are numbered where they begin. The line after a frame is line 0, whether its pulse comes with
    // that of the frame or, as signals of two pins may, some clocks before or after it.
    reg was_backward, line_is_0, frame_waits;
    reg [15:0] line_number, next_column;
    wire begins = pixel && playing;
    wire sweep_ends = line || frame || backward != was_backward || !playing;
    wire [15:0] line_now = frame ? 16'd0 : line && !line_is_0 ? line_number + 16'd1 : line_number;
    wire [15:0] column_now = sweep_ends ? 16'd0 : next_column;
    initial begin
        was_backward = 1'b0;
        line_is_0 = 1'b1;
        frame_waits = 1'b0;
        line_number = 0;
        next_column = 0;
    end
    always @(posedge clock) begin
        was_backward <= backward;
        line_number <= reset ? 16'd0 : line_now;
        line_is_0 <= reset || ((frame || line_is_0) && !line && !begins);
        next_column <= reset ? 16'd0 : begins ? column_now + 16'd1 : column_now;
        frame_waits <= !reset && (frame || frame_waits) && !begins;
    end

    // The pixel that takes samples.
    reg open, complete, is_backward, is_first, overfull;
    reg [15:0] its_line, its_column;
    reg [COUNT_BITS-1:0] count;
    initial begin
        open = 1'b0;
        complete = 1'b0;
        is_backward = 1'b0;
        is_first = 1'b0;
        overfull = 1'b0;
        its_line = 0;
        its_column = 0;
        count = 0;
    end
    wire window_ends = complete && !valid && !fault;
    wire ends = open && (begins || sweep_ends || window_ends);
    wire counted = &count;
    always @(posedge clock) begin
        open <= !reset && (begins || (open && !ends));
        complete <= (begins || complete) && valid && !fault;
        if (begins) begin
            is_backward <= backward;
            is_first <= frame || frame_waits;
            its_line <= line_now;
            its_column <= column_now;
            count <= {{(COUNT_BITS - 1){1'b0}}, sample};
            overfull <= 1'b0;
        end else if (sample) begin
            if (counted) overfull <= 1'b1;
            else count <= count + 1'b1;
        end
    end

    wire [SUMS-1:0] sums;
    genvar i;
    generate
        for (i = 0; i < CHANNELS; i = i + 1) begin : channel
            wire [SAMPLE_BITS-1:0] value = samples[i*SAMPLE_BITS +: SAMPLE_BITS];
            wire sign = SIGNED != 0 && value[SAMPLE_BITS-1];
            wire [SUM_BITS-1:0] term = sample ? {{COUNT_BITS{sign}}, value} : {SUM_BITS{1'b0}};
            reg [SUM_BITS-1:0] sum;
            initial sum = 0;
            always @(posedge clock)
                if (begins) sum <= term;
                else if (!counted) sum <= sum + term;
            assign sums[i*SUM_BITS +: SUM_BITS] = sum;
        end
    endgenerate

    // The word. What a lost one marked, the next one marks.
    reg lost, first_lost;
    wire full;
    wire [5:0] flags = {
        sweep_ends || !begins, overfull, lost, is_first || first_lost, is_backward, complete && playing && count != 0
    };
    initial begin
        lost = 1'b0;
        first_lost = 1'b0;
        lost_words = 0;
    end
    always @(posedge clock) begin
        if (reset) begin
            lost <= 1'b0;
            first_lost <= 1'b0;
            lost_words <= 0;
        end else if (ends) begin
            lost <= full;
            first_lost <= full && (is_first || first_lost);
            if (full && lost_words != 16'hffff) lost_words <= lost_words + 16'd1;
        end
    end

    wire [STORED-1:0] stored;
    adc_fifo #(.BITS(STORED), .DEPTH_BITS(DEPTH_BITS)) fifo (
        .clock(clock), .reset(reset), .write(ends), .data({flags, its_column, its_line, count, sums}), .full(full),
        .out(stored), .out_valid(m_axis_tvalid), .out_ready(m_axis_tready)
    );

    assign m_axis_tuser = stored[STORED-1 -: 6];
    assign m_axis_tlast = stored[STORED-1];
    assign m_axis_tdata[32*CHANNELS+48 +: 16] = {10'd0, m_axis_tuser};
    assign m_axis_tdata[32*CHANNELS+16 +: 32] = stored[SUMS+COUNT_BITS +: 32];
    generate
        if (COUNT_BITS >= 16) begin : count_fills
            assign m_axis_tdata[32*CHANNELS +: 16] = stored[SUMS +: 16];
        end else begin : count_padded
            assign m_axis_tdata[32*CHANNELS +: 16] = {{(16 - COUNT_BITS){1'b0}}, stored[SUMS +: COUNT_BITS]};
        end
        for (i = 0; i < CHANNELS; i = i + 1) begin : lane
            if (SUM_BITS >= 32) begin : sum_fills
                assign m_axis_tdata[32*i +: 32] = stored[SUM_BITS*i +: 32];
            end else begin : sum_padded
                assign m_axis_tdata[32*i +: 32] = {
                    {(32 - SUM_BITS){SIGNED != 0 && stored[SUM_BITS*i+SUM_BITS-1]}}, stored[SUM_BITS*i +: SUM_BITS]
                };
            end
        end
    endgenerate
endmodule

`default_nettype wire
