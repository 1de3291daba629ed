// A ULX3S as a scanner: linked_scanner.v on its 25 MHz clock, with a Pmod DA3 (AD5541A) for each axis.
//
// The USB port is the serial line, at 115200 baud. The scan of the build is there at power-up, waits at its park codes,
// and begins when it is triggered over the line. While the button is held, no new scan becomes active.

`default_nettype none

module ulx3s #(
    parameter START_CLOCKS = 4096
) (
    input  wire clock,
    input  wire line_in,
    output wire line_out,
    input  wire button,
    output wire fault_lamp,
    output wire image_lamp,
    output wire esp32_boot,
    output wire x_select_n,
    output wire x_data,
    output wire x_load_n,
    output wire x_sclk,
    output wire y_select_n,
    output wire y_data,
    output wire y_load_n,
    output wire y_sclk,
    output wire line,
    output wire frame,
    output wire pixel,
    output wire backward,
    output wire image
);
    reg permit_1, permit;
    initial {permit_1, permit} = 2'd0;
    always @(posedge clock) {permit, permit_1} <= {permit_1, !button};

    linked_scanner #(
        .CLOCKS_PER_TICK(50), .CLOCKS_PER_BIT(217), .START_CLOCKS(START_CLOCKS)  // 115207 baud
    ) scanner (
        .clock(clock), .line_in(line_in), .line_out(line_out), .permit(permit), .sclk(x_sclk), .select_n(x_select_n),
        .x_data(x_data), .y_data(y_data), .load_n(x_load_n), .line(line), .frame(frame), .pixel(pixel),
        .backward(backward), .image(image), .fault(fault_lamp)
    );

    assign {y_select_n, y_load_n, y_sclk} = {x_select_n, x_load_n, x_sclk};
    assign image_lamp = image;
    assign esp32_boot = 1'b1;  // low, an ESP32 on the board would load a bitstream of its own
endmodule

`default_nettype wire
