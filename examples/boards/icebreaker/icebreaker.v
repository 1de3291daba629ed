// An iCEBreaker as a scanner: linked_scanner.v on its 12 MHz clock, with a Pmod DA3 (AD5541A) for each axis.
//
// The USB port is the serial line, at 115200 baud. The scan of the build is there at power-up, waits at its park codes,
// and begins when it is triggered over the line. While the button is held, no new scan becomes active.

`default_nettype none

module icebreaker #(
    parameter START_CLOCKS = 4096
) (
    input  wire clock,
    input  wire line_in,
    output wire line_out,
    input  wire button_n,
    output wire fault_n,
    output wire image_n,
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
    always @(posedge clock) {permit, permit_1} <= {permit_1, button_n};

    wire fault;
    linked_scanner #(
        .CLOCKS_PER_TICK(96), .CLOCKS_PER_BIT(104), .START_CLOCKS(START_CLOCKS)  // 125 kHz, 115385 baud
    ) scanner (
        .clock(clock), .line_in(line_in), .line_out(line_out), .permit(permit), .sclk(x_sclk), .select_n(x_select_n),
        .x_data(x_data), .y_data(y_data), .load_n(x_load_n), .line(line), .frame(frame), .pixel(pixel),
        .backward(backward), .image(image), .fault(fault)
    );

    assign {y_select_n, y_load_n, y_sclk} = {x_select_n, x_load_n, x_sclk};
    assign fault_n = !fault;
    assign image_n = !image;
endmodule

`default_nettype wire
