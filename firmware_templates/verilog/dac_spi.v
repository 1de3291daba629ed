`default_nettype none

// SPI master for serial DACs: every strobe sends the words of both axes, and both outputs change together.
//
// What a converter wants is set by parameters; docs/verilog.md has a table of converters. A frame is FRAME_BITS bits,
// the highest first: the axis's PREFIX (command and address), with the WORD_BITS bits of the word over it, the lowest
// one at bit DATA_LSB. AD5541A: a bare word of 16 bits. AD5791: 24 bits, prefix 24'h100000 (write the DAC register),
// word of 20 bits. DAC8562: 24 bits, prefix for command and channel above a word of 16 bits.
//
// TOPOLOGY, that is how the two outputs hang on the wires:
//   0  two chips in parallel: sclk and the select shared, x on mosi_x, y on mosi_y. The usual, for it is the fastest:
//      both axes take the time of one frame, and differ by one data line only. One axis alone: leave the y pins open.
//   1  one chip with two channels: two frames one after the other on mosi_x, cs_x_n low in both.
//   2  two chips on one data line: two frames one after the other on mosi_x, each with its own select.
//   3  two chips in a daisy chain: one select (cs_x_n) and one frame of 2 FRAME_BITS bits on mosi_x.
// Y_FIRST: the order in 1, 2 and 3; x goes first when it is 0. In a daisy chain what goes first arrives at the far
// chip, the one whose input is the other's output; so with Y_FIRST = 0 the chip on mosi_x is that of y.
//
// SPI modes: CPOL is the level of sclk at rest. With CPHA = 0 the converter samples on the edge that leaves that
// level, with CPHA = 1 on the edge that returns to it. mosi changes on the other edge: half a period to set up, half a
// period to hold. A converter that samples on the falling edge, with sclk low at rest, is CPOL = 0, CPHA = 1.
//
// LDAC_CLOCKS: after the last frame, LDAC_DELAY (>= 1) clocks after its select has risen, ldac_n is low for so many
// clocks; it is never low while a select is. 0: no pulse, ldac_n stays at LDAC_HELD. Held low, the outputs change as
// the selects rise (in 0 and 3 both at once); held high is for chips which a command of the last frame updates.
//
// Timing, in clocks. sclk is high and low for HALF_PERIOD each, and of as many is the time from the select to the
// first edge and from the last edge to the end of the select. Between two selects there are at least GAP.
//   frame  = (2 bits + 1) HALF_PERIOD, where bits is FRAME_BITS, or 2 FRAME_BITS in a daisy chain
//   rest   = GAP, or LDAC_DELAY + LDAC_CLOCKS + 1 if there is a pulse and that is more
//   a tick = frame + rest, or 2 frame + GAP + rest in 1 and 2
// What data sheets ask for, in ns: sclk of at most 50 MHz (AD5541A Rev. A p. 14, AD5791 Rev. D p. 19); sclk high and
// low 8 each, select to sampling edge 13, select high 80, last edge to LDAC 40, LDAC low 80 (DAC8568, timing
// requirements t4 to t12); select high 15 (AD5663R Rev. A p. 21), 160 (DAC80501, timing requirements). The defaults
// are those of the DAC8568 at a clock of 50 MHz; take yours from the sheet of your converter.
// Latency: the select falls on the clock after the strobe; strobes `a tick` apart are sent without a wait, for ever.
//
// A strobe that comes earlier waits in a mailbox for one sample until the rest is over. Should another one come before
// that, the newest wins: what waited is lost, and `missed` is high for a clock. So every strobe is either sent or
// `missed` (or dropped by a reset), what is sent is never older than a tick, and a frame under way is never touched.
// The step at the converter over a missed sample is the sum of two steps: treat `missed` as a fault.
//
// reset drops the sample in the mailbox and ignores strobes, but a frame under way goes out to its end, and its LDAC
// too. To cut it off would leave a torn word in a converter that takes what it has when its select rises, and at a
// piezo that is a kick. The pins need no reset to begin with, and are at rest within `a tick` of the last strobe.
//
// busy: frames are under way, or the rest after them. A strobe with busy low goes out on the next clock.
// All pins but an unused mosi_y come straight from flip-flops.
// Limits: 2 <= FRAME_BITS <= 32, DATA_LSB + WORD_BITS <= FRAME_BITS, HALF_PERIOD, GAP, LDAC_DELAY >= 1; a
// prefix has FRAME_BITS bits.
module dac_spi #(
    parameter WORD_BITS = 16,
    parameter FRAME_BITS = 16,
    parameter DATA_LSB = 0,
    parameter [31:0] X_PREFIX = 32'd0,
    parameter [31:0] Y_PREFIX = 32'd0,
    parameter TOPOLOGY = 0,
    parameter Y_FIRST = 0,
    parameter CPOL = 0,
    parameter CPHA = 0,
    parameter HALF_PERIOD = 1,
    parameter GAP = 4,
    parameter LDAC_CLOCKS = 4,
    parameter LDAC_DELAY = 2,
    parameter LDAC_HELD = 0
) (
    input  wire                 clock,
    input  wire                 reset,
    input  wire                 strobe,
    input  wire [WORD_BITS-1:0] x_word,
    input  wire [WORD_BITS-1:0] y_word,
    output reg                  sclk,
    output reg                  cs_x_n,
    output reg                  cs_y_n,
    output wire                 mosi_x,
    output wire                 mosi_y,
    output wire                 ldac_n,
    output wire                 busy,
    output reg                  missed
);
    localparam PARALLEL = TOPOLOGY == 0;
    localparam TWO_FRAMES = TOPOLOGY == 1 || TOPOLOGY == 2;
    localparam TWO_SELECTS = TOPOLOGY == 2;
    localparam SWAPPED = Y_FIRST != 0;
    localparam RESTING = CPOL != 0;

    // Which selects are low in the first frame and in the second.
    localparam FIRST_X = !(TWO_SELECTS && SWAPPED);
    localparam FIRST_Y = PARALLEL || (TWO_SELECTS && SWAPPED);
    localparam SECOND_X = !(TWO_SELECTS && !SWAPPED);
    localparam SECOND_Y = TWO_SELECTS && !SWAPPED;

    localparam BITS = TOPOLOGY == 3 ? 2 * FRAME_BITS : FRAME_BITS;
    localparam PULSE = LDAC_CLOCKS != 0 ? LDAC_DELAY + LDAC_CLOCKS + 1 : 0;
    localparam REST = GAP > PULSE ? GAP : PULSE;

    localparam HALF_BITS = HALF_PERIOD > 1 ? $clog2(HALF_PERIOD) : 1;
    localparam COUNT_BITS = $clog2(BITS + 1);
    localparam PAUSE_BITS = REST > 1 ? $clog2(REST) : 1;
    // Constants of 32 bits, of which the counters take their part.
    localparam [31:0] HALF_LAST = HALF_PERIOD - 1;
    localparam [31:0] BITS_TO_SEND = BITS;
    localparam [31:0] GAP_LAST = GAP - 1;
    localparam [31:0] REST_LAST = REST - 1;

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (FRAME_BITS < 2 || FRAME_BITS > 32) begin : guard_0
            dac_spi_FRAME_BITS_is_not_2_to_32 stop ();
        end
        if (DATA_LSB < 0 || WORD_BITS < 1 || DATA_LSB + WORD_BITS > FRAME_BITS) begin : guard_1
            dac_spi_word_is_not_inside_FRAME_BITS stop ();
        end
        if (FRAME_BITS < 32 && X_PREFIX >> FRAME_BITS != 32'd0) begin : guard_2
            dac_spi_X_PREFIX_has_more_than_FRAME_BITS stop ();
        end
        if (FRAME_BITS < 32 && Y_PREFIX >> FRAME_BITS != 32'd0) begin : guard_3
            dac_spi_Y_PREFIX_has_more_than_FRAME_BITS stop ();
        end
        if (TOPOLOGY < 0 || TOPOLOGY > 3) begin : guard_4
            dac_spi_TOPOLOGY_is_not_0_to_3 stop ();
        end
        if (Y_FIRST < 0 || Y_FIRST > 1) begin : guard_5
            dac_spi_Y_FIRST_is_not_0_to_1 stop ();
        end
        if (CPOL < 0 || CPOL > 1) begin : guard_6
            dac_spi_CPOL_is_not_0_to_1 stop ();
        end
        if (CPHA < 0 || CPHA > 1) begin : guard_7
            dac_spi_CPHA_is_not_0_to_1 stop ();
        end
        if (HALF_PERIOD < 1 || HALF_PERIOD > 65536) begin : guard_8
            dac_spi_HALF_PERIOD_is_not_1_to_65536 stop ();
        end
        if (GAP < 1 || GAP > 65536) begin : guard_9
            dac_spi_GAP_is_not_1_to_65536 stop ();
        end
        if (LDAC_CLOCKS < 0 || LDAC_CLOCKS > 65536) begin : guard_10
            dac_spi_LDAC_CLOCKS_is_not_0_to_65536 stop ();
        end
        if (LDAC_DELAY < 1 || LDAC_DELAY > 65536) begin : guard_11
            dac_spi_LDAC_DELAY_is_not_1_to_65536 stop ();
        end
        if (LDAC_HELD < 0 || LDAC_HELD > 1) begin : guard_12
            dac_spi_LDAC_HELD_is_not_0_to_1 stop ();
        end
    endgenerate

    reg                  selected;    // a select is low
    reg                  paused;      // between two frames, or at rest after the last
    reg                  second;      // the second of two frames is out, or on its way
    reg [HALF_BITS-1:0]  half;        // clocks left of this half period, less one
    reg [COUNT_BITS-1:0] bits;        // sclk pulses still to come in this frame
    reg [PAUSE_BITS-1:0] pause;       // clocks left of the pause, less one
    reg [FRAME_BITS-1:0] head, tail;  // shifted to the left; in parallel each by itself, else tail into head
    reg                  waiting;     // the mailbox is full
    reg [WORD_BITS-1:0]  x_waiting, y_waiting;

    wire last = !TWO_FRAMES || second;
    wire half_over = half == {HALF_BITS{1'b0}};
    wire pause_over = paused && pause == {PAUSE_BITS{1'b0}};
    wire free = (!selected && !paused) || (pause_over && last);
    wire start = free && (strobe || waiting) && !reset;
    wire active = sclk != RESTING;

    // CPHA = 0: shift as sclk returns to rest. CPHA = 1: shift as it leaves it, but for the first bit, which is there
    // from the start; the last bit is shifted out with the select, so that a second frame is ready in place.
    wire setting_up = bits == BITS_TO_SEND[COUNT_BITS-1:0];
    wire shift = selected && half_over && (CPHA != 0 ? !active && !setting_up : active);

    function [FRAME_BITS-1:0] framed(input [FRAME_BITS-1:0] prefix, input [WORD_BITS-1:0] word);
        begin
            framed = prefix;
            framed[DATA_LSB +: WORD_BITS] = word;
        end
    endfunction

    wire [FRAME_BITS-1:0] x_frame = framed(X_PREFIX[FRAME_BITS-1:0], strobe ? x_word : x_waiting);
    wire [FRAME_BITS-1:0] y_frame = framed(Y_PREFIX[FRAME_BITS-1:0], strobe ? y_word : y_waiting);

    assign mosi_x = head[FRAME_BITS-1];
    assign mosi_y = PARALLEL && tail[FRAME_BITS-1];
    assign busy = selected || paused;

    initial begin
        sclk = RESTING;
        cs_x_n = 1'b1;
        cs_y_n = 1'b1;
        missed = 1'b0;
        selected = 1'b0;
        paused = 1'b0;
        second = 1'b0;
        half = HALF_LAST[HALF_BITS-1:0];
        bits = BITS_TO_SEND[COUNT_BITS-1:0];
        pause = {PAUSE_BITS{1'b0}};
        head = {FRAME_BITS{1'b0}};
        tail = {FRAME_BITS{1'b0}};
        waiting = 1'b0;
        x_waiting = {WORD_BITS{1'b0}};
        y_waiting = {WORD_BITS{1'b0}};
    end

    // The mailbox. A strobe finds it full: what waited is lost, whether the new sample waits in its place or goes out.
    always @(posedge clock) begin
        missed <= strobe && waiting && !reset;
        if (reset || free) waiting <= 1'b0;
        else if (strobe) waiting <= 1'b1;
        if (strobe) begin
            x_waiting <= x_word;
            y_waiting <= y_word;
        end
    end

    // Selects and clock.
    always @(posedge clock) begin
        if (start) begin
            selected <= 1'b1;
            paused <= 1'b0;
            second <= 1'b0;
            cs_x_n <= !FIRST_X;
            cs_y_n <= !FIRST_Y;
        end else if (selected && half_over) begin
            half <= HALF_LAST[HALF_BITS-1:0];
            if (active) begin
                sclk <= RESTING;
            end else if (bits != {COUNT_BITS{1'b0}}) begin
                sclk <= !RESTING;
                bits <= bits - 1'b1;
            end else begin
                selected <= 1'b0;
                paused <= 1'b1;
                cs_x_n <= 1'b1;
                cs_y_n <= 1'b1;
                bits <= BITS_TO_SEND[COUNT_BITS-1:0];
                pause <= last ? REST_LAST[PAUSE_BITS-1:0] : GAP_LAST[PAUSE_BITS-1:0];
            end
        end else if (selected) begin
            half <= half - 1'b1;
        end else if (pause_over) begin
            paused <= 1'b0;
            if (!last) begin
                selected <= 1'b1;
                second <= 1'b1;
                cs_x_n <= !SECOND_X;
                cs_y_n <= !SECOND_Y;
            end
        end else if (paused) begin
            pause <= pause - 1'b1;
        end
    end

    // Data.
    always @(posedge clock) begin
        if (start) begin
            head <= SWAPPED && !PARALLEL ? y_frame : x_frame;
            tail <= SWAPPED && !PARALLEL ? x_frame : y_frame;
        end else if (shift) begin
            head <= {head[FRAME_BITS-2:0], !PARALLEL && tail[FRAME_BITS-1]};
            tail <= {tail[FRAME_BITS-2:0], 1'b0};
        end
    end

    generate
        if (LDAC_CLOCKS != 0) begin : pulsed
            localparam [31:0] FALL = REST - LDAC_DELAY;
            localparam [31:0] RISE = REST - LDAC_DELAY - LDAC_CLOCKS;

            reg low_n;

            initial low_n = 1'b1;

            always @(posedge clock)
                low_n <= !(paused && last && pause <= FALL[PAUSE_BITS-1:0] && pause > RISE[PAUSE_BITS-1:0]);

            assign ldac_n = low_n;
        end else begin : held
            assign ldac_n = LDAC_HELD != 0;
        end
    endgenerate
endmodule

`default_nettype wire
