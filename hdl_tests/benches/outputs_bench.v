`default_nettype none

// Bench of one dac_spi behind two dac_coding: plays a stimulus of codes, and writes what every wire was on every clock.
//
// STIMULUS is read by $readmemh: words of 64 bits, {end, 1'b0, reset, strobe, gap[11:0], x_code[23:0], y_code[23:0]}.
// Each one waits `gap` clocks, then is applied for one clock; `end` waits its gap, closes the capture and raises done.
// Between strobes the codes are all ones or all zeros in turn, so that nobody may look at them then. There is no reset
// but those of the stimulus: the initial values have to do.
// CAPTURE gets three hexadecimal digits a clock, the levels just before the rising edge:
// {2'b00, reset, strobe, busy, missed, ldac_n, cs_y_n, cs_x_n, mosi_y, mosi_x, sclk}.
module outputs_bench #(
    parameter STIMULUS = "stimulus.hex",
    parameter CAPTURE = "capture.txt",
    parameter DEPTH = 4096,
    parameter BITS = 16,
    parameter TWOS_COMPLEMENT = 0,
    parameter LEFT_ALIGNED = 0,
    parameter WORD_BITS = 16,
    parameter FRAME_BITS = 16,
    parameter DATA_LSB = 0,
    parameter [31:0] X_PREFIX = 0,
    parameter [31:0] Y_PREFIX = 0,
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
    input  wire clock,
    output reg  done
);
    reg [63:0] stimulus [0:DEPTH-1];
    reg [63:0] entry;
    reg reset, strobe;
    reg [23:0] x_code, y_code;
    wire [WORD_BITS-1:0] x_word, y_word;
    wire sclk, cs_x_n, cs_y_n, mosi_x, mosi_y, ldac_n, busy, missed;
    wire [11:0] levels =
        {2'b00, reset, strobe, busy, missed, ldac_n, cs_y_n, cs_x_n, mosi_y, mosi_x, sclk};
    integer next, left, capture;

    initial begin
        $readmemh(STIMULUS, stimulus);
        capture = $fopen(CAPTURE, "w");
        done = 1'b0;
        reset = 1'b0;
        strobe = 1'b0;
        x_code = 24'h000000;
        y_code = 24'hffffff;
        next = 1;
        entry = stimulus[0];
        left = {20'd0, entry[59:48]};
    end

    always @(posedge clock) if (!done) begin
        $fwrite(capture, "%h", levels);
        reset <= 1'b0;
        strobe <= 1'b0;
        x_code <= {24{!x_code[0]}};
        y_code <= {24{!y_code[0]}};
        if (left != 0) begin
            left = left - 1;
        end else if (entry[63]) begin
            $fclose(capture);
            done <= 1'b1;
        end else begin
            reset <= entry[61];
            strobe <= entry[60];
            x_code <= entry[47:24];
            y_code <= entry[23:0];
            entry = stimulus[next];
            left = {20'd0, entry[59:48]};
            next = next + 1;
        end
    end

    dac_coding #(.BITS(BITS), .WORD_BITS(WORD_BITS), .TWOS_COMPLEMENT(TWOS_COMPLEMENT), .LEFT_ALIGNED(LEFT_ALIGNED))
        x_coding (.code(x_code[BITS-1:0]), .word(x_word));
    dac_coding #(.BITS(BITS), .WORD_BITS(WORD_BITS), .TWOS_COMPLEMENT(TWOS_COMPLEMENT), .LEFT_ALIGNED(LEFT_ALIGNED))
        y_coding (.code(y_code[BITS-1:0]), .word(y_word));

    dac_spi #(
        .WORD_BITS(WORD_BITS), .FRAME_BITS(FRAME_BITS), .DATA_LSB(DATA_LSB), .X_PREFIX(X_PREFIX), .Y_PREFIX(Y_PREFIX),
        .TOPOLOGY(TOPOLOGY), .Y_FIRST(Y_FIRST), .CPOL(CPOL), .CPHA(CPHA), .HALF_PERIOD(HALF_PERIOD), .GAP(GAP),
        .LDAC_CLOCKS(LDAC_CLOCKS), .LDAC_DELAY(LDAC_DELAY), .LDAC_HELD(LDAC_HELD)
    ) spi (
        .clock(clock), .reset(reset), .strobe(strobe), .x_word(x_word), .y_word(y_word), .sclk(sclk),
        .cs_x_n(cs_x_n), .cs_y_n(cs_y_n), .mosi_x(mosi_x), .mosi_y(mosi_y), .ldac_n(ldac_n), .busy(busy),
        .missed(missed)
    );
endmodule

`default_nettype wire
