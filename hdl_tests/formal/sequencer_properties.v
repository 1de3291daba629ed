// The control of the sequencer: a swap is one for both axes and for all stages, and what a write may never meet. The
// top, the scan and the banks are the shipped ones; dac_axis.v beside this file stands for the axes.
//
// The host may do anything on any clock: write anything anywhere, commit, withdraw, reset, arm, trigger, park, or let
// ticks come as they like. One thing is asked of what it commits: that all parts of it are of one program, so that what
// is mixed can be told.

`default_nettype none

module sequencer_properties
`include "sequencer_under_test.vh"

    localparam LATENCY = (PLAIN_MULTIPLIER ? 22 : 34) + (SHAPING != 0 ? 1 : 0);

    wire uut__take, uut__bank, uut__host_write, uut__host_commit;
    wire uut__x_table_write, uut__y_table_write, uut__x_write, uut__y_write, uut__scan_write;
    wire uut__banks__draining;

    // What the host has written, from the ports alone.
    wire exists = write_region == 3'd0 ? write_address < 16'd48 : write_region <= 3'd2 && write_address < 16'd8;
    wire accepted = write && writable && exists;
    wire register = accepted && write_region == 3'd0;
    reg x_colour, y_colour, other;  // the bank that is not written
    reg [1:0] x_words, y_words;
    initial begin
        x_colour = 0;
        y_colour = 0;
        other = 0;
        x_words = 0;
        y_words = 0;
    end
    always @(posedge clock) begin
        if (register && write_address == 16'h0010) x_colour <= write_data[0];
        if (register && write_address == 16'h0020) y_colour <= write_data[0];
        if (accepted && write_region == 3'd1) x_words[!other] <= write_data[0];
        if (accepted && write_region == 3'd2) y_words[!other] <= write_data[0];
        if (uut__take) other <= !other;
    end
    // Whether all parts are of one program; a commit with a write on its clock counts that write, too.
    wire one_colour = x_colour == y_colour && x_colour == x_words[!other] && x_colour == y_words[!other];
    always @* if (uut__host_commit) assume (one_colour);

    // a. A swap takes a committed program on a tick; on which one is in scan_properties.
    always @* if (uut__take) assert (tick && committed);

    // b. All parts of both axes are of one program at every sample; the stub's codes are the colours each has met.
    always @* if (strobe) begin
        assert (x_code == 8'b0000 || x_code == 8'b1111);
        assert (x_code == y_code);
    end

    // Not vacuous: a program of the other colour can be taken, and played by both axes.
    always @* cover (strobe && playing && line_marker && x_code == 8'b1111);

    // c. No write while a program waits or is under way; what is written is never what plays.
    always @* begin
        if (uut__x_table_write || uut__y_table_write || uut__x_write || uut__y_write || uut__scan_write)
            assert (!committed && !uut__banks__draining);
    end
    // f. A program that does not fit is not committed, and that is said. A refused write is said, and one to a place that does not exist; a commit stays until it is taken, withdrawn or reset.
    wire uut__commits, uut__fits;
    reg before, refused_write, refused_commit, was_committed, may_go;
    initial before = 0;
    always @(posedge clock) begin
        before <= 1;
        refused_write <= write && !accepted;
        refused_commit <= uut__commits && !uut__fits;
        was_committed <= committed;
        may_go <= uut__take || withdraw || reset;
    end
    always @* if (before) begin
        if (refused_write || refused_commit) assert (refused);
        if (refused_commit) assert (!committed);
        if (was_committed && !may_go) assert (committed);
        if (was_committed && may_go) assert (!committed);
    end

    // A write of a register reaches the page that it names.
    wire [2:0] uut__region;
    wire [15:0] uut__address;
    wire [31:0] uut__data;
    wire [11:0] page = uut__address[15:4];
    wire program_write = uut__host_write && uut__region == 3'd0;
    always @* begin
        assert (uut__scan_write == (program_write && page == 12'd0));
        assert (uut__x_write == (program_write && page == 12'd1));
        assert (uut__y_write == (program_write && page == 12'd2));
    end

`ifndef PROPERTIES_ALONE
    // What makes it inductive.
    wire [LATENCY:0] uut__pipelined__loads_now;
    always @* begin
        assert (!committed || !uut__banks__draining);
        assert (uut__banks__draining == (uut__pipelined__loads_now != 0));
        assert ((uut__pipelined__loads_now & (uut__pipelined__loads_now - 1)) == 0);
        assert (!uut__host_commit || !committed);
        assert (!(uut__host_commit || uut__host_write) || !uut__banks__draining);
    end

    // The stages: each holds the colour of the playing bank once the load has passed it, and until then that of the
    // other one, which nobody writes meanwhile.
    localparam MIDDLE = LATENCY / 2, LAST = LATENCY - 4;
    wire uut__pipelined__x_axis__idle, uut__pipelined__x_axis__first, uut__pipelined__x_axis__middle;
    wire uut__pipelined__x_axis__last, uut__pipelined__y_axis__idle, uut__pipelined__y_axis__first;
    wire uut__pipelined__y_axis__middle, uut__pipelined__y_axis__last;
    wire [1:0] uut__pipelined__x_axis__words, uut__pipelined__y_axis__words;
    wire now = x_words[other], was = x_words[!other];
    wire [LATENCY:0] loads = uut__pipelined__loads_now;
    wire first = loads[0] ? was : now;
    wire middle = loads[MIDDLE:0] != 0 ? was : now;
    wire last = loads[LAST:0] != 0 ? was : now;
    wire x_pending = uut__host_write && uut__region == 3'd0 && uut__address == 16'h0010;
    wire y_pending = uut__host_write && uut__region == 3'd0 && uut__address == 16'h0020;
    wire [1:0] to_other = 2'b01 << !other;
    wire [1:0] x_kept = uut__pipelined__x_axis__words & ~to_other;
    wire [1:0] x_expected = uut__host_write && uut__region == 3'd1
        ? (uut__data[0] ? x_kept | to_other : x_kept) : uut__pipelined__x_axis__words;
    wire [1:0] y_kept = uut__pipelined__y_axis__words & ~to_other;
    wire [1:0] y_expected = uut__host_write && uut__region == 3'd2
        ? (uut__data[0] ? y_kept | to_other : y_kept) : uut__pipelined__y_axis__words;
    always @* begin
        assert (uut__bank == other);
        assert (x_words[other] == y_words[other]);
        assert ((x_pending ? uut__data[0] : uut__pipelined__x_axis__idle) == x_colour);
        assert ((y_pending ? uut__data[0] : uut__pipelined__y_axis__idle) == y_colour);
        assert (x_expected == x_words && y_expected == y_words);
        if (committed) assert (one_colour);
        if (loads != 0) assert (x_words[!other] == y_words[!other]);
        if (loads != 0) assert (uut__pipelined__x_axis__idle == now && uut__pipelined__y_axis__idle == now);
        assert (uut__pipelined__x_axis__first == first && uut__pipelined__y_axis__first == first);
        assert (uut__pipelined__x_axis__middle == middle && uut__pipelined__y_axis__middle == middle);
        assert (uut__pipelined__x_axis__last == last && uut__pipelined__y_axis__last == last);
    end

    // The colours on their way to the code, at any place of the pipeline: those of the playing bank once the load is
    // ahead of them, until then of the other one. So a step of one clock is enough.
    localparam READ_AT = 3;
    wire [READ_AT-1:0] uut__pipelined__x_axis__banks, uut__pipelined__y_axis__banks;
    wire [LAST+3:0] uut__pipelined__x_axis__first_met, uut__pipelined__x_axis__word_met;
    wire [LAST+3:0] uut__pipelined__x_axis__middle_met, uut__pipelined__x_axis__last_met;
    wire [LAST+3:0] uut__pipelined__y_axis__first_met, uut__pipelined__y_axis__word_met;
    wire [LAST+3:0] uut__pipelined__y_axis__middle_met, uut__pipelined__y_axis__last_met;
    wire [LATENCY-1:0] met;  // the colour of a code so many clocks before it is out
    genvar i;
    generate
        for (i = 0; i < LATENCY; i = i + 1) begin : colours
            assign met[i] = loads[i:0] != 0 ? was : now;
        end
        for (i = 0; i < READ_AT; i = i + 1) begin : read
            always @* begin
                assert (uut__pipelined__x_axis__banks[i] == (loads[i:0] != 0 ? !other : other));
                assert (uut__pipelined__y_axis__banks[i] == (loads[i:0] != 0 ? !other : other));
            end
        end
        for (i = 1; i < LATENCY; i = i + 1) begin : of_first
            always @* begin
                assert (uut__pipelined__x_axis__first_met[i-1] == met[i]);
                assert (uut__pipelined__y_axis__first_met[i-1] == met[i]);
            end
        end
        for (i = READ_AT; i < LATENCY; i = i + 1) begin : of_word
            always @* begin
                assert (uut__pipelined__x_axis__word_met[i-READ_AT] == met[i]);
                assert (uut__pipelined__y_axis__word_met[i-READ_AT] == met[i]);
            end
        end
        for (i = MIDDLE + 1; i < LATENCY; i = i + 1) begin : of_middle
            always @* begin
                assert (uut__pipelined__x_axis__middle_met[i-MIDDLE-1] == met[i]);
                assert (uut__pipelined__y_axis__middle_met[i-MIDDLE-1] == met[i]);
            end
        end
        for (i = LAST + 1; i < LATENCY; i = i + 1) begin : of_last
            always @* begin
                assert (uut__pipelined__x_axis__last_met[i-LAST-1] == met[i]);
                assert (uut__pipelined__y_axis__last_met[i-LAST-1] == met[i]);
            end
        end
    endgenerate
`endif
endmodule

`default_nettype wire
