// Sends bytes on an asynchronous line: one start bit, eight bits, the lowest first, one stop bit.

`default_nettype none

module dac_uart_tx #(
    parameter CLOCKS_PER_BIT = 434
) (
    input  wire       clock,
    input  wire       send,    // while ready
    input  wire [7:0] data,
    output wire       ready,
    output reg        line
);
    localparam BITS = $clog2(CLOCKS_PER_BIT);
    localparam [31:0] WHOLE = CLOCKS_PER_BIT - 1;
    wire unused = &{WHOLE};

    // Ones follow the byte, so that the last bit has gone when nothing but ones is left.
    reg [8:0] rest;
    reg [3:0] left;
    reg [BITS-1:0] timer;
    initial begin
        rest = 9'd0;
        left = 4'd0;
        timer = 0;
        line = 1'b1;
    end
    wire next = timer == 0;

    assign ready = left == 4'd0;

    always @(posedge clock) begin
        if (send && ready) begin
            line <= 1'b0;
            rest <= {1'b1, data};
            left <= 4'd10;
            timer <= WHOLE[BITS-1:0];
        end else if (!ready) begin
            timer <= next ? WHOLE[BITS-1:0] : timer - 1;
            if (next) begin
                line <= rest[0];
                rest <= {1'b1, rest[8:1]};
                left <= left - 4'd1;
            end
        end
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (CLOCKS_PER_BIT < 2 || CLOCKS_PER_BIT > 65536) begin : guard_0
            dac_uart_tx_CLOCKS_PER_BIT_is_not_2_to_65536 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
