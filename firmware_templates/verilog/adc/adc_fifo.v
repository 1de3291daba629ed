// FIFO of 2^DEPTH_BITS words in a memory with a registered output, for the words of adc_pixels.
//
// `out` and `out_valid` follow the rule of AXI4-Stream: they stay until the clock on which `out_ready` is high too. A
// word comes out two clocks after its write at the earliest. A write while `full` is high is ignored; `full` does not
// depend on `out_ready` of the same clock. With the word at the output the FIFO holds 2^DEPTH_BITS + 1 words.

`default_nettype none

module adc_fifo #(
    parameter BITS = 32,
    parameter DEPTH_BITS = 4
) (
    input  wire            clock,
    input  wire            reset,     // empties it
    input  wire            write,
    input  wire [BITS-1:0] data,
    output wire            full,
    output reg  [BITS-1:0] out,
    output reg             out_valid,
    input  wire            out_ready
);
    reg [BITS-1:0] words [0:(1<<DEPTH_BITS)-1];
    reg [DEPTH_BITS-1:0] first, next;
    reg [DEPTH_BITS:0] stored;  // words in the memory
    initial begin
        first = 0;
        next = 0;
        stored = 0;
        out_valid = 1'b0;
    end
    assign full = stored[DEPTH_BITS];
    wire writes = write && !full;
    wire reads = stored != 0 && (!out_valid || out_ready);

    always @(posedge clock) begin
        if (writes) words[next] <= data;
        if (reads) out <= words[first];
        if (reset) begin
            first <= 0;
            next <= 0;
            stored <= 0;
            out_valid <= 1'b0;
        end else begin
            if (writes) next <= next + 1'b1;
            if (reads) first <= first + 1'b1;
            if (writes && !reads) stored <= stored + 1'b1;
            if (reads && !writes) stored <= stored - 1'b1;
            if (reads) out_valid <= 1'b1;
            else if (out_ready) out_valid <= 1'b0;
        end
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1) begin : guard_0
            adc_fifo_BITS_is_less_than_1 stop ();
        end
        if (DEPTH_BITS < 1 || DEPTH_BITS > 16) begin : guard_1
            adc_fifo_DEPTH_BITS_is_not_1_to_16 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
