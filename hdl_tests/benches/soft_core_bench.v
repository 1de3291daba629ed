// Bench of examples/firmware/soft_core: the whole device, with an asynchronous line to cocotb_loader.py.
//
// A command: `host_count` bytes of `host_data` go onto the line, and `run_clocks` go by. Then `done` is `go`.
// line_log.v writes LINES. While `underrun` is set, the converters miss samples. With z there is a log of its lines,
// Z_LINES, and one of the ticks on which markers of z are not those of x and y, APART: the number of the tick, both
// markers. z has no valid ticks of its own there, and no parked ones.

`timescale 1ns / 1ps
`default_nettype none

module soft_core_bench #(
    parameter CLOCKS_PER_TICK = 50,
    parameter CLOCKS_PER_BIT = 16,
    parameter FIRMWARE = "firmware.mem",
    parameter LINES = "",
    parameter Z_LINES = "",
    parameter APART = ""
);
    `include "soft_core.vh"

    localparam MOST = 1024;
    reg clock = 0, go = 0, done = 0, until_idle = 0, permit = 1, underrun = 0, finished = 0;
    reg [31:0] run_clocks = 0, clocks_left = 0;
    reg [16*MOST-1:0] host_data = 0;
    reg [15:0] host_count = 0, device_count = 0;
    reg [8*MOST-1:0] device_data = 0;

    initial while (!finished) begin
        #5 clock = 1;
        #5 clock = 0;
    end

    wire device_line, fault;
    reg host_line = 1;
    soft_core #(
        .CLOCKS_PER_TICK(CLOCKS_PER_TICK), .CLOCKS_PER_BIT(CLOCKS_PER_BIT), .START_CLOCKS(16), .FIRMWARE(FIRMWARE)
    ) dut (
        .clock(clock), .line_in(host_line), .line_out(device_line), .permit(permit), .sclk(), .select_n(), .x_data(),
        .y_data(), .z_data(), .load_n(), .line(), .frame(), .pixel(), .backward(), .image(), .fault(fault)
    );

    // What is written belongs to the clock that follows.
    integer sent_clocks = 0, at = 0, sending = 0, receiving = 0;
    reg [7:0] coming = 0;
    wire [15:0] entry = host_data[16*at +: 16];
    always @(posedge clock) begin
        if (go != done && clocks_left == 0) begin
            clocks_left = run_clocks;
            at = 0;
            sent_clocks = 0;
            sending = host_count;
            device_count = 0;
        end
        if (sending != 0) begin
            host_line <= sent_clocks < CLOCKS_PER_BIT ? 1'b0 :
                sent_clocks < 9 * CLOCKS_PER_BIT ? entry[sent_clocks/CLOCKS_PER_BIT-1] : 1'b1;
            sent_clocks = sent_clocks + 1;
            if (sent_clocks == 10 * CLOCKS_PER_BIT) begin
                sent_clocks = 0;
                at = at + 1;
                sending = sending - 1;
            end
        end
        if (clocks_left != 0) begin
            clocks_left = clocks_left - 1;
            if (clocks_left == 0) begin
                if (sending != 0) $display("a command ended before its last byte");
                done <= go;
            end
        end
        if (receiving == 0)
            receiving = device_line ? 0 : 1;
        else begin
            receiving = receiving + 1;
            if (receiving % CLOCKS_PER_BIT == CLOCKS_PER_BIT / 2) begin
                if (receiving > 9 * CLOCKS_PER_BIT) begin
                    if (!device_line) $display("a byte without a stop bit");
                    device_data[8*device_count +: 8] = coming;
                    device_count = device_count + 1;
                    receiving = 0;
                end else if (receiving > CLOCKS_PER_BIT)
                    coming = {device_line, coming[7:1]};
            end
        end
    end

    always @(posedge clock)
        if (underrun) force dut.missed = 1'b1;
        else release dut.missed;

    line_log #(.LINES(LINES)) lines (
        .clock(clock), .strobe(dut.strobe), .x_code(dut.x_code), .y_code(dut.y_code), .markers({
            dut.parked, dut.playing, dut.swapped, dut.xy_image, dut.xy_backward, dut.xy_pixel, dut.xy_frame, dut.xy_line
        }), .faults(dut.faults)
    );

`ifdef SOFT_CORE_Z  // of soft_core.vh: a name of a module that is not there is an error wherever it stands
    generate
        if (SCAN_Z != 0) begin : of_z
            wire [7:0] markers = {
                dut.with_z.z.parked, dut.with_z.z.z_playing, dut.with_z.z.swapped, dut.with_z.z.valid,
                dut.with_z.z.backward, dut.with_z.z.pixel, dut.with_z.z.frame, dut.with_z.z.line
            };
            line_log #(.LINES(Z_LINES)) z_lines (
                .clock(clock), .strobe(dut.with_z.z.z_strobe), .x_code(dut.with_z.z.z_code),
                .y_code(dut.with_z.z.rest_code), .markers(markers), .faults(dut.with_z.z.faults)
            );
            // A tick of x and y is followed by its tick of z, or comes with it.
            integer log;
            reg [31:0] number = 0, z_number = 0;
            reg [6:0] queue = 0;
            wire [6:0] now = {
                dut.playing, dut.swapped, 1'b0, dut.xy_backward, dut.xy_pixel, dut.xy_frame, dut.xy_line
            };
            wire [6:0] of_tick = dut.strobe ? now : queue;
            wire [6:0] z_now = markers & 7'b1101111;
            initial log = $fopen(APART, "w");
            always @(posedge clock) begin
                if (dut.strobe) queue <= now;
                if (dut.strobe) number = number + 1;
                if (dut.with_z.z.z_strobe) begin
                    z_number = z_number + 1;
                    if (number != z_number || ((of_tick[6] || z_now[6]) && of_tick != z_now)) begin
                        $fwrite(log, "%h %h %h\n", number, of_tick, z_now);
                        $fflush(log);
                    end
                end
            end
        end
    endgenerate
`endif
endmodule

`default_nettype wire
