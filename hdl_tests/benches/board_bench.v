// Bench of a board of examples/boards, that of a macro: sends +requests (a file of bytes; 100: wait for the end of an
// answer), writes what comes back into +answers, a byte a line, and from the first frame marker on the levels of both
// converters' pins into +pins, a hexadecimal byte a clock: x {sclk, load_n, data, select_n}, then y. It ends after
// +clocks of these, or +limit in all.

`timescale 1ns / 1ps
`default_nettype none

module board_bench #(
    parameter CLOCKS_PER_BIT = 104
);
    localparam BIT = 10 * CLOCKS_PER_BIT, STARTED = 1000;
    reg clock = 0, line_in = 1, begun = 0, finished = 0, answered = 0;
    wire line_out, frame, fault, x_select_n, x_data, x_load_n, x_sclk, y_select_n, y_data, y_load_n, y_sclk;
    reg [8:0] requests [0:255];
    reg [7:0] coming;
    reg [8*200-1:0] name;
    integer answers, pins, clocks, captured = 0, total = 0, limit, at, bit_number, k;

`ifdef ICEBREAKER
    wire fault_n;
    assign fault = !fault_n;
    icebreaker dut (
        .button_n(1'b1), .fault_n(fault_n), .image_n(),
`else
    ulx3s dut (
        .button(1'b0), .fault_lamp(fault), .image_lamp(), .esp32_boot(),
`endif
        .clock(clock), .line_in(line_in), .line_out(line_out), .x_select_n(x_select_n), .x_data(x_data),
        .x_load_n(x_load_n), .x_sclk(x_sclk), .y_select_n(y_select_n), .y_data(y_data), .y_load_n(y_load_n),
        .y_sclk(y_sclk), .line(), .frame(frame), .pixel(), .backward(), .image()
    );

    initial begin
        if (!$value$plusargs("clocks=%d", clocks) || !$value$plusargs("answers=%s", name)) $finish;
        answers = $fopen(name, "w");
        if (!$value$plusargs("pins=%s", name) || !$value$plusargs("limit=%d", limit)) $finish;
        pins = $fopen(name, "w");
        while (!finished) begin
            #5 clock = 1;
            #5 clock = 0;
            begun = begun || frame;
            if (begun) begin
                $fwrite(pins, "%h", {x_sclk, x_load_n, x_data, x_select_n, y_sclk, y_load_n, y_data, y_select_n});
                captured = captured + 1;
                finished = captured == clocks;
            end
            total = total + 1;
            finished = finished || total == limit;
        end
        $fclose(pins);
        $fclose(answers);
        $display("fault %b", fault);
        $finish;
    end

    initial begin
        if (!$value$plusargs("requests=%s", name)) $finish;
        $readmemh(name, requests);
        #(10 * (4096 + STARTED));
        for (at = 0; at < 256 && requests[at] !== 9'hx; at = at + 1)
            if (requests[at][8]) begin
                while (!answered) #BIT;
                answered = 0;
            end else begin
                line_in = 0;
                #BIT;
                for (bit_number = 0; bit_number < 8; bit_number = bit_number + 1) begin
                    line_in = requests[at][bit_number];
                    #BIT;
                end
                line_in = 1;
                #BIT;
            end
    end

    always begin
        @(negedge line_out);
        #(BIT / 2);
        for (k = 0; k < 8; k = k + 1) begin
            #BIT;
            coming[k] = line_out;
        end
        $fwrite(answers, "%h\n", coming);
        answered = answered || coming == 0;
        #BIT;
    end
endmodule

`default_nettype wire
