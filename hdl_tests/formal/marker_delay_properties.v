// dac_marker_delay, whatever comes in and whatever the delays are: the output is the input of so many clocks ago, by the
// delay of the clock before; signals do not meet.

`default_nettype none

module marker_delay_properties (
    input wire       clock,
    input wire [1:0] in,
    input wire [3:0] delays
);
    wire [1:0] out;
    dac_marker_delay #(.SIGNALS(2), .DELAY_BITS(2)) delay (.clock(clock), .delays(delays), .in(in), .out(out));

    // The inputs of the last four clocks, this one first, and the delays of the clock before.
    reg [2:0] past_0, past_1;
    reg [1:0] delay_0, delay_1;
    initial begin
        past_0 = 0;
        past_1 = 0;
        delay_0 = 1;
        delay_1 = 1;
    end
    wire [3:0] history_0 = {past_0, in[0]}, history_1 = {past_1, in[1]};
    always @(posedge clock) begin
        past_0 <= history_0[2:0];
        past_1 <= history_1[2:0];
        {delay_1, delay_0} <= delays;
    end

    // The properties.
    always @* begin
        assert (out[0] == history_0[delay_0]);
        assert (out[1] == history_1[delay_1]);
        cover (delay_0 == 3 && out == 2'b01 && past_0 == 3'b100);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive: the past in the memory.
    wire [1:0] delay__now;
    wire delay__signal__0__past__0, delay__signal__0__past__1, delay__signal__0__past__2, delay__signal__0__past__3;
    wire delay__signal__1__past__0, delay__signal__1__past__1, delay__signal__1__past__2, delay__signal__1__past__3;
    wire [3:0] memory_0 = {
        delay__signal__0__past__3, delay__signal__0__past__2, delay__signal__0__past__1, delay__signal__0__past__0
    };
    wire [3:0] memory_1 = {
        delay__signal__1__past__3, delay__signal__1__past__2, delay__signal__1__past__1, delay__signal__1__past__0
    };
    wire [1:0] one = delay__now - 2'd1, two = delay__now - 2'd2, three = delay__now - 2'd3;
    always @* begin
        assert (past_0 == {memory_0[three], memory_0[two], memory_0[one]});
        assert (past_1 == {memory_1[three], memory_1[two], memory_1[one]});
    end
`endif
endmodule

`default_nettype wire
