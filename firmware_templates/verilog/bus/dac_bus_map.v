// The address decoder of dac_bus.
// Made by make_registers.py from dac_registers.rdl: do not edit.

`default_nettype none

module dac_bus_map (
    input  wire [19:0] address,
    input  wire        write,        // or a read
    input  wire [31:0] data,         // of a write
    input  wire [4:0]  features_dac_bits,
    input  wire [1:0]  features_shaping,
    input  wire        features_fourier,
    input  wire        features_commit_modes,
    input  wire        features_slow_part,
    input  wire [9:0]  features_harmonics,
    input  wire [1:0]  x_shape_degree,
    input  wire [4:0]  x_shape_index_bits,
    input  wire [4:0]  x_shape_word_bits,
    input  wire [1:0]  y_shape_degree,
    input  wire [4:0]  y_shape_index_bits,
    input  wire [4:0]  y_shape_word_bits,
    input  wire        status_writable,
    input  wire        status_committed,
    input  wire        status_refused,
    input  wire        status_armed,
    input  wire        status_running,
    input  wire        status_playing,
    input  wire        status_parked,
    input  wire        status_busy,
    input  wire        status_booting,
    input  wire        status_missing,
    input  wire        status_can_keep,
    input  wire        faults_slew,
    input  wire        faults_clamp,
    input  wire        faults_overrun,
    input  wire        faults_underrun,
    input  wire [31:0] slew_count,
    input  wire [31:0] clamp_count,
    input  wire [31:0] overrun_count,
    input  wire [31:0] underrun_count,
    input  wire        interrupt_pending_writable,
    input  wire        interrupt_pending_committed,
    input  wire        interrupt_pending_stopped,
    input  wire        interrupt_pending_fault,
    input  wire        interrupt_pending_refused,
    input  wire        interrupt_enable_writable,
    input  wire        interrupt_enable_committed,
    input  wire        interrupt_enable_stopped,
    input  wire        interrupt_enable_fault,
    input  wire        interrupt_enable_refused,
    input  wire [4:0]  memory_shape_pixel_index_bits,
    input  wire [4:0]  memory_shape_slow_index_bits,
    output wire        write_command,
    output wire        write_arm,
    output wire        write_interrupt_pending,
    output wire        write_interrupt_enable,
    output wire        in_program,
    output wire        in_x_fourier,
    output wire        in_y_fourier,
    output wire        in_pixel_ticks,
    output wire        in_x_table,
    output wire        in_y_table,
    output wire        in_x_slow,
    output wire        in_y_slow,
    output wire [15:0] word,         // number of a word in its memory
    output wire        legal,        // the map has this access
    output reg  [31:0] value         // of a register; 0 if the map has no such read
);
    assign write_command = write && address == 20'h0002C && (data & 32'hFFFFFCE0) == 32'd0;
    assign write_arm = write && address == 20'h00030 && (data & 32'hFFFF0000) == 32'd0;
    assign write_interrupt_pending = write && address == 20'h00034 && (data & 32'hFFFFFFE0) == 32'd0;
    assign write_interrupt_enable = write && address == 20'h00038 && (data & 32'hFFFFFFE0) == 32'd0;
    assign in_program = write && address[1:0] == 2'd0 && address[19:8] == 12'd4 && address[7:2] < 6'd48;
    assign in_x_fourier = write && address[1:0] == 2'd0 && address[19:13] == 7'd1 && address[12:2] < 11'd1025;
    assign in_y_fourier = write && address[1:0] == 2'd0 && address[19:13] == 7'd2 && address[12:2] < 11'd1025;
    assign in_pixel_ticks = write && address[1:0] == 2'd0 && address[19:16] == 4'd1;
    assign in_x_table = write && address[1:0] == 2'd0 && address[19:18] == 2'd1;
    assign in_y_table = write && address[1:0] == 2'd0 && address[19:18] == 2'd2;
    assign in_x_slow = write && address[1:0] == 2'd0 && address[19:17] == 3'd6;
    assign in_y_slow = write && address[1:0] == 2'd0 && address[19:17] == 3'd7;
    assign word =
        in_program ? {10'd0, address[7:2]} :
        in_x_fourier ? {5'd0, address[12:2]} :
        in_y_fourier ? {5'd0, address[12:2]} :
        in_pixel_ticks ? {2'd0, address[15:2]} :
        in_x_slow ? {1'd0, address[16:2]} :
        in_y_slow ? {1'd0, address[16:2]} :
        address[17:2];
    reg readable;
    assign legal = (!write && readable) ||
        write_command || write_arm || write_interrupt_pending || write_interrupt_enable ||
        in_program || in_x_fourier || in_y_fourier || in_pixel_ticks ||
        in_x_table || in_y_table || in_x_slow || in_y_slow;

    always @* begin
        readable = 1'b1;
        case (address)
            20'h00000: value = 32'h54424C47;
            20'h00004: value = 32'h1;
            20'h00008: value = {
                6'd0, features_harmonics, 1'd0, features_slow_part, features_commit_modes,
                features_fourier, 2'd0, features_shaping, 3'd0, features_dac_bits
            };
            20'h0000C: value = {11'd0, x_shape_word_bits, 3'd0, x_shape_index_bits, 6'd0, x_shape_degree};
            20'h00010: value = {11'd0, y_shape_word_bits, 3'd0, y_shape_index_bits, 6'd0, y_shape_degree};
            20'h00014: value = {
                21'd0, status_can_keep, status_missing, status_booting, status_busy, status_parked,
                status_playing, status_running, status_armed, status_refused, status_committed, status_writable
            };
            20'h00018: value = {28'd0, faults_underrun, faults_overrun, faults_clamp, faults_slew};
            20'h0001C: value = slew_count;
            20'h00020: value = clamp_count;
            20'h00024: value = overrun_count;
            20'h00028: value = underrun_count;
            20'h00034: value = {
                27'd0, interrupt_pending_refused, interrupt_pending_fault,
                interrupt_pending_stopped, interrupt_pending_committed, interrupt_pending_writable
            };
            20'h00038: value = {
                27'd0, interrupt_enable_refused, interrupt_enable_fault,
                interrupt_enable_stopped, interrupt_enable_committed, interrupt_enable_writable
            };
            20'h0003C: value = {19'd0, memory_shape_slow_index_bits, 3'd0, memory_shape_pixel_index_bits};
            default: begin
                value = 32'd0;
                readable = 1'b0;
            end
        endcase
    end
endmodule

`default_nettype wire
