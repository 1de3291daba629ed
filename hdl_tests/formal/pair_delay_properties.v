// dac_pair_delay, whatever comes in: the output is the input of so many clocks ago, and low before the first one.

`default_nettype none

module pair_delay_properties #(
    parameter CLOCKS = 37
) (
    input wire clock,
    input wire in
);
    reg [5:0] at;
    wire out;
    dac_pair_delay #(.BITS(1), .CLOCKS(CLOCKS)) delay (.clock(clock), .at(at), .in(in), .out(out));

    reg [CLOCKS-1:0] past;  // bit k: k + 1 clocks ago
    initial begin
        at = 0;
        past = 0;
    end
    always @(posedge clock) begin
        at <= at + 1;
        past <= {past[CLOCKS-2:0], in};
    end

    // The property.
    always @* assert (out == past[CLOCKS-1]);

`ifndef PROPERTIES_ALONE
    // What makes it inductive: the past in the memory.
    wire [63:0] words;
    wire
        delay__words__0, delay__words__1, delay__words__2, delay__words__3, delay__words__4, delay__words__5,
        delay__words__6, delay__words__7, delay__words__8, delay__words__9, delay__words__10, delay__words__11,
        delay__words__12, delay__words__13, delay__words__14, delay__words__15, delay__words__16, delay__words__17,
        delay__words__18, delay__words__19, delay__words__20, delay__words__21, delay__words__22, delay__words__23,
        delay__words__24, delay__words__25, delay__words__26, delay__words__27, delay__words__28, delay__words__29,
        delay__words__30, delay__words__31, delay__words__32, delay__words__33, delay__words__34, delay__words__35,
        delay__words__36, delay__words__37, delay__words__38, delay__words__39, delay__words__40, delay__words__41,
        delay__words__42, delay__words__43, delay__words__44, delay__words__45, delay__words__46, delay__words__47,
        delay__words__48, delay__words__49, delay__words__50, delay__words__51, delay__words__52, delay__words__53,
        delay__words__54, delay__words__55, delay__words__56, delay__words__57, delay__words__58, delay__words__59,
        delay__words__60, delay__words__61, delay__words__62, delay__words__63;
    assign words = {
        delay__words__63, delay__words__62, delay__words__61, delay__words__60, delay__words__59, delay__words__58,
        delay__words__57, delay__words__56, delay__words__55, delay__words__54, delay__words__53, delay__words__52,
        delay__words__51, delay__words__50, delay__words__49, delay__words__48, delay__words__47, delay__words__46,
        delay__words__45, delay__words__44, delay__words__43, delay__words__42, delay__words__41, delay__words__40,
        delay__words__39, delay__words__38, delay__words__37, delay__words__36, delay__words__35, delay__words__34,
        delay__words__33, delay__words__32, delay__words__31, delay__words__30, delay__words__29, delay__words__28,
        delay__words__27, delay__words__26, delay__words__25, delay__words__24, delay__words__23, delay__words__22,
        delay__words__21, delay__words__20, delay__words__19, delay__words__18, delay__words__17, delay__words__16,
        delay__words__15, delay__words__14, delay__words__13, delay__words__12, delay__words__11, delay__words__10,
        delay__words__9, delay__words__8, delay__words__7, delay__words__6, delay__words__5, delay__words__4,
        delay__words__3, delay__words__2, delay__words__1, delay__words__0
    };
    wire [127:0] twice = {words, words};
    wire [63:0] stored = twice >> at;  // bit 63 - k: k + 1 clocks ago
    integer k;
    always @* for (k = 0; k < CLOCKS - 1; k = k + 1) assert (stored[63-k] == past[k]);
`endif
endmodule

`default_nettype wire
