// Bench of examples/verilog/scanner.v: lets it boot, and from the first tick of its scan on writes the levels of its
// wires to CAPTURE, two hexadecimal digits a clock: {3'd0, load_n}, {select_n, y_data, x_data, sclk}.

`timescale 1ns / 1ps
`default_nettype none

module scanner_bench #(
    parameter CAPTURE = "",
    parameter CLOCKS = 1
);
    reg clock = 0;
    wire sclk, select_n, x_data, y_data, load_n, line, frame, pixel, backward, image, fault;
    reg begun = 0, finished = 0;
    integer capture, captured = 0;

    scanner dut (
        .clock(clock), .run(1'b1), .sclk(sclk), .select_n(select_n), .x_data(x_data), .y_data(y_data), .load_n(load_n),
        .line(line), .frame(frame), .pixel(pixel), .backward(backward), .image(image), .fault(fault)
    );

    initial begin
        capture = $fopen(CAPTURE, "w");
        while (!finished) begin
            #5 clock = 1;
            #5 clock = 0;
            begun = begun || frame;
            if (begun) begin
                $fwrite(capture, "%h", {3'd0, load_n, select_n, y_data, x_data, sclk});
                captured = captured + 1;
                if (captured == CLOCKS) begin
                    $fclose(capture);
                    finished = 1;
                end
            end
        end
    end
endmodule

`default_nettype wire
