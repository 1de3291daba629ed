`default_nettype none
`timescale 1ns / 1ps

// Bench of dac_axi_stream: plays stimulus.hex, in the format of outputs_bench with the markers in bits 52:48 (so the
// gap is bits 59:53), and writes the interface of every clock to capture.txt, one hexadecimal number a line:
// {reset, strobe, missed, m_axis_tvalid, m_axis_tready, tuser[4:0], tdata}. The sink is in Python.
module outputs_axi_bench #(
    parameter WORD_BITS = 16,
    parameter DEPTH = 8192
);
    localparam LANE_BITS = 8 * ((WORD_BITS + 7) / 8);

    reg clock, reset, strobe, done;
    reg [23:0] x_word, y_word;
    reg [4:0] markers;
    reg [63:0] stimulus [0:DEPTH-1];
    reg [63:0] entry;
    wire [2*LANE_BITS-1:0] m_axis_tdata;
    wire [4:0] m_axis_tuser;
    wire m_axis_tvalid, missed;
    reg m_axis_tready;
    integer next, left, capture;

    initial begin
        $readmemh("stimulus.hex", stimulus);
        capture = $fopen("capture.txt", "w");
        clock = 1'b0;
        reset = 1'b0;
        strobe = 1'b0;
        done = 1'b0;
        x_word = 24'h000000;
        y_word = 24'hffffff;
        markers = 5'h0a;
        m_axis_tready = 1'b0;
        next = 1;
        entry = stimulus[0];
        left = {25'd0, entry[59:53]};
    end

    always #5 clock = !clock;

    always @(posedge clock) if (!done) begin
        $fwrite(capture, "%h\n",
            {reset, strobe, missed, m_axis_tvalid, m_axis_tready, m_axis_tuser, m_axis_tdata});
        reset <= 1'b0;
        strobe <= 1'b0;
        x_word <= {24{!x_word[0]}};
        y_word <= {24{!y_word[0]}};
        markers <= ~markers;
        if (left != 0) begin
            left = left - 1;
        end else if (entry[63]) begin
            $fclose(capture);
            done <= 1'b1;
        end else begin
            reset <= entry[61];
            strobe <= entry[60];
            markers <= entry[52:48];
            x_word <= entry[47:24];
            y_word <= entry[23:0];
            entry = stimulus[next];
            left = {25'd0, entry[59:53]};
            next = next + 1;
        end
    end

    dac_axi_stream #(.WORD_BITS(WORD_BITS), .MARKER_BITS(5)) stream (
        .clock(clock), .reset(reset), .strobe(strobe), .x_word(x_word[WORD_BITS-1:0]), .y_word(y_word[WORD_BITS-1:0]),
        .markers(markers), .m_axis_tdata(m_axis_tdata), .m_axis_tuser(m_axis_tuser), .m_axis_tvalid(m_axis_tvalid),
        .m_axis_tready(m_axis_tready), .missed(missed)
    );
endmodule

`default_nettype wire
