// adc_fifo, whatever is written and read: words come out as they were written, in their order, each once, and none that
// was not written; a word at the output stays until it is taken; a write is refused only while 2^DEPTH_BITS words wait.
//
// `watch` picks any write; the harness counts the words before it.

`default_nettype none

module fifo_properties #(
    parameter DEPTH_BITS = 2
) (
    input wire       clock,
    input wire       reset,
    input wire       write,
    input wire [1:0] data,
    input wire       ready,
    input wire       watch
);
    wire full, valid;
    wire [1:0] out;
    adc_fifo #(.BITS(2), .DEPTH_BITS(DEPTH_BITS)) fifo (
        .clock(clock), .reset(reset), .write(write), .data(data), .full(full), .out(out), .out_valid(valid),
        .out_ready(ready)
    );

    wire accepted = write && !full, taken = valid && ready;
    reg [DEPTH_BITS+1:0] inside, ahead;  // words in it, and those of them before the watched one
    reg watching, waited, due;
    reg [1:0] watched, was;
    initial begin
        inside = 0;
        ahead = 0;
        watching = 0;
        waited = 0;
        due = 0;
    end
    wire [DEPTH_BITS+1:0] left = inside - taken;
    always @(posedge clock) begin
        inside <= reset ? 0 : left + accepted;
        waited <= valid && !ready && !reset;
        due <= left != 0 && !reset;
        was <= out;
        if (reset || (watching && taken && ahead == 0)) watching <= 0;
        else if (watch && accepted && !watching) watching <= 1;
        if (watching) ahead <= ahead - taken;
        else begin
            ahead <= left;
            watched <= data;
        end
    end

    // The properties.
    always @* begin
        if (waited) assert (valid && out == was);
        if (due) assert (valid);
        if (valid) assert (inside != 0);
        if (full) assert (inside - valid >= 1 << DEPTH_BITS);
        assert (inside <= (1 << DEPTH_BITS) + 1);
        if (watching) assert (ahead < inside);
        if (watching && valid && ahead == 0) assert (out == watched);
        cover (full && valid && ready);
        cover (watching && valid && ahead == 0 && watched == 2);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive: where each word is.
    wire [DEPTH_BITS:0] fifo__stored;
    wire [DEPTH_BITS-1:0] fifo__first, fifo__next;
    wire [1:0] fifo__words__0, fifo__words__1, fifo__words__2, fifo__words__3;
    wire [7:0] words = {fifo__words__3, fifo__words__2, fifo__words__1, fifo__words__0};
    wire [DEPTH_BITS-1:0] place = fifo__first + ahead - valid;
    always @* begin
        assert (inside == fifo__stored + valid);
        assert (fifo__stored <= 1 << DEPTH_BITS);
        assert (fifo__next == fifo__first + fifo__stored[DEPTH_BITS-1:0]);
        if (watching && !(valid && ahead == 0)) assert (words[2*place +: 2] == watched);
    end
`endif
endmodule

`default_nettype wire
