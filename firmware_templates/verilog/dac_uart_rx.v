// Receives bytes from an asynchronous line: one start bit, eight bits, the lowest first, one stop bit.
//
// A bit is looked at in its middle, which a baud rate may miss by 3 % either way. A byte without a stop bit is dropped,
// and after it (a break) nothing begins before the line has been high again.

`default_nettype none

module dac_uart_rx #(
    parameter CLOCKS_PER_BIT = 434  // 8 or more
) (
    input  wire       clock,
    input  wire       line,         // may be asynchronous
    output reg  [7:0] data,
    output reg        received      // for one clock; `data` stays for half a bit at least
);
    localparam BITS = $clog2(CLOCKS_PER_BIT);
    localparam [31:0] WHOLE = CLOCKS_PER_BIT - 1, HALF = CLOCKS_PER_BIT / 2 - 2;  // the way to here takes the rest
    localparam [3:0] WAIT = 4'd0, START = 4'd1, STOP = 4'd10, BREAK = 4'd11;
    wire unused = &{WHOLE, HALF};

    reg line_1, line_2;
    reg [3:0] state;  // the bits in between are 2..9
    reg [BITS-1:0] timer;
    reg due;          // the middle of a bit
    initial begin
        line_1 = 1'b1;
        line_2 = 1'b1;
        state = WAIT;
        timer = 0;
        due = 1'b0;
        data = 8'd0;
        received = 1'b0;
    end

    always @(posedge clock) begin
        line_1 <= line;
        line_2 <= line_1;
        timer <= state == WAIT ? HALF[BITS-1:0] : timer == 0 ? WHOLE[BITS-1:0] : timer - 1;
        due <= state != WAIT && timer == 1;
        received <= 1'b0;
        case (state)
            WAIT: if (!line_2) state <= START;
            START: if (due) state <= line_2 ? WAIT : START + 4'd1;  // too short: noise
            STOP: if (due) begin
                received <= line_2;
                state <= line_2 ? WAIT : BREAK;
            end
            BREAK: if (line_2) state <= WAIT;
            default: if (due) begin
                data <= {line_2, data[7:1]};
                state <= state + 4'd1;
            end
        endcase
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (CLOCKS_PER_BIT < 8 || CLOCKS_PER_BIT > 65536) begin : guard_0
            dac_uart_rx_CLOCKS_PER_BIT_is_not_8_to_65536 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
