`default_nettype none

// AXI4-Stream source: one beat a strobe, for a DMA, a JESD204 core, a FIFO into another clock, or an ILA.
//
// m_axis_tdata  x in the lower lane, y in the upper one; a lane is the word in as many whole bytes as it needs, the
//               bits above the word 0
// m_axis_tuser  the markers of the same tick, as given
// missed        one clock: the sample of a strobe was lost, because the beat before it still waited
//
// There is no tlast, tkeep or tstrb: every beat is whole and stands for itself. m_axis_tvalid does not wait for
// m_axis_tready, and once it is high it and its beat stay as they are until the clock on which m_axis_tready is high
// too; that is the rule of AXI, and it decides what is lost: a strobe that finds a beat waiting loses its OWN sample,
// since the waiting one may no longer change. A sink that has to pause needs a FIFO of the length of its pauses.
// At one strobe a clock and a sink that is always ready there is one beat a clock, and nothing is lost.
//
// Latency: one clock from strobe to m_axis_tvalid.
// reset empties it, as AXI wants it. A strobe on a clock with reset is ignored and is not counted as missed.
module dac_axi_stream #(
    parameter WORD_BITS = 16,
    parameter MARKER_BITS = 5,
    parameter LANE_BITS = 8 * ((WORD_BITS + 7) / 8)    // follows from WORD_BITS: do not set it
) (
    input  wire                   clock,
    input  wire                   reset,
    input  wire                   strobe,
    input  wire [WORD_BITS-1:0]   x_word,
    input  wire [WORD_BITS-1:0]   y_word,
    input  wire [MARKER_BITS-1:0] markers,
    output wire [2*LANE_BITS-1:0] m_axis_tdata,
    output reg  [MARKER_BITS-1:0] m_axis_tuser,
    output reg                    m_axis_tvalid,
    input  wire                   m_axis_tready,
    output reg                    missed
);
    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (WORD_BITS < 1 || WORD_BITS > 64) begin : guard_0
            dac_axi_stream_WORD_BITS_is_not_1_to_64 stop ();
        end
        if (MARKER_BITS < 1 || MARKER_BITS > 64) begin : guard_1
            dac_axi_stream_MARKER_BITS_is_not_1_to_64 stop ();
        end
        if (LANE_BITS != 8 * ((WORD_BITS + 7) / 8)) begin : guard_2
            dac_axi_stream_LANE_BITS_follows_from_WORD_BITS_do_not_set_it stop ();
        end
    endgenerate

    reg [WORD_BITS-1:0] x_held, y_held;

    // The beat in the register leaves on this clock, or there is none.
    wire free = !m_axis_tvalid || m_axis_tready;

    initial begin
        x_held = {WORD_BITS{1'b0}};
        y_held = {WORD_BITS{1'b0}};
        m_axis_tuser = {MARKER_BITS{1'b0}};
        m_axis_tvalid = 1'b0;
        missed = 1'b0;
    end

    generate
        if (LANE_BITS == WORD_BITS) begin : whole
            assign m_axis_tdata = {y_held, x_held};
        end else begin : padded
            assign m_axis_tdata = {
                {(LANE_BITS - WORD_BITS){1'b0}}, y_held, {(LANE_BITS - WORD_BITS){1'b0}}, x_held
            };
        end
    endgenerate

    always @(posedge clock) begin
        missed <= strobe && !free && !reset;
        if (reset) m_axis_tvalid <= 1'b0;
        else if (free) m_axis_tvalid <= strobe;
        if (strobe && free) begin
            x_held <= x_word;
            y_held <= y_word;
            m_axis_tuser <= markers;
        end
    end
endmodule

`default_nettype wire
