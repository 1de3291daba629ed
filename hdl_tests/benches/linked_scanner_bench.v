// Bench of examples/verilog/linked_scanner.v: sends +request and prints what comes back, a byte a line, until a zero.

`timescale 1ns / 1ps
`default_nettype none

module linked_scanner_bench #(
    parameter CLOCKS_PER_BIT = 16
);
    localparam BIT = 10 * CLOCKS_PER_BIT;
    reg clock = 0, finished = 0, line = 1;
    reg [7:0] coming = 0;
    wire answer;
    reg [8*64-1:0] request;  // +bytes of them, the first one highest
    integer bytes, i, j, k;

    linked_scanner #(.CLOCKS_PER_BIT(CLOCKS_PER_BIT), .START_CLOCKS(0)) dut (
        .clock(clock), .line_in(line), .line_out(answer), .permit(1'b1), .sclk(), .select_n(), .x_data(), .y_data(),
        .load_n(), .line(), .frame(), .pixel(), .backward(), .image(), .fault()
    );

    initial while (!finished) begin
        #5 clock = 1;
        #5 clock = 0;
    end

    initial begin
        if (!$value$plusargs("request=%h", request) || !$value$plusargs("bytes=%d", bytes)) $finish;
        #1000;
        for (i = bytes - 1; i >= 0; i = i - 1) begin
            line = 0;
            #BIT;
            for (j = 0; j < 8; j = j + 1) begin
                line = request[8*i+j];
                #BIT;
            end
            line = 1;
            #BIT;
        end
    end

    initial begin
        while (!finished) begin
            @(negedge answer);
            #(BIT / 2);
            for (k = 0; k < 8; k = k + 1) begin
                #BIT;
                coming[k] = answer;
            end
            #BIT;
            $display("%h", coming);
            finished = coming == 0;
        end
        $finish;
    end

    initial begin
        #(10000 * BIT);  // no answer
        $finish;
    end
endmodule

`default_nettype wire
