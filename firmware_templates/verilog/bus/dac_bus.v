// Registers in front of the host port of dac_sequencer, for one access of 32 bits at a time; dac_axi_lite and
// dac_wishbone are its bus interfaces. docs/registers.md is the map.
//
//   access    `request` is high for one clock with its inputs, and not again until `done`, one clock too, with `failed`
//             and `read_data`. An access takes 2 clocks, a request to the sequencer (command, arm) 8: a read after it
//             shows what became of it, but for a rendering of Fourier words and what waits for a tick.
//   failed    The access had no effect at all. There is no such register or word, or not for this direction; the
//             address is no multiple of 4; a write has not all of its four bytes, or sets a bit that no field has; a
//             word or a commit came while the idle program is not writable.
//   irq       is high while a pending event is enabled.
//
// A reset ends an access without `done`, and clears pending events and their enables; it does not reach the sequencer.

`default_nettype none

module dac_bus #(
    parameter DAC_BITS = 16,         // these are those of the sequencer
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter Y_WORD_BITS = 16,
    parameter COUNT_BITS = 16,
    parameter FOURIER = 0,
    parameter HARMONICS = 64,
    parameter SHAPING = 0,
    parameter COMMIT_MODES = 0,
    parameter PIXEL_INDEX_BITS = 0,  // 14 or less
    parameter SLOW_PART = 0,         // then X_INDEX_BITS, Y_INDEX_BITS and SLOW_INDEX_BITS are 13 or less
    parameter SLOW_INDEX_BITS = 7
) (
    input  wire                    clock,
    input  wire                    reset,
    // the bus
    input  wire                    request,
    input  wire                    request_write,
    input  wire [19:0]             request_address,  // of a byte
    input  wire [31:0]             request_data,
    input  wire [3:0]              request_bytes,    // those of a write
    output reg                     done,
    output reg                     failed,
    output reg  [31:0]             read_data,
    output wire                    irq,              // interrupt
    // the host port of the sequencer, or of NAME_top
    output wire                    write,
    output wire [2:0]              write_region,
    output wire [15:0]             write_address,
    output wire [31:0]             write_data,
    input  wire                    writable,
    input  wire                    refused,
    output wire                    commit,
    output wire [1:0]              commit_mode,
    output wire                    withdraw,
    input  wire                    committed,
    input  wire                    can_keep,         // 0 without COMMIT_MODES
    input  wire                    booting,          // 0 without dac_boot
    input  wire                    missing,          // 0 without dac_boot
    output wire                    arm,
    output wire [15:0]             arm_frames,
    output wire                    trigger,
    output wire                    park,
    output wire                    clear_faults,
    input  wire                    armed,
    input  wire                    running,
    input  wire                    busy,
    input  wire                    playing,
    input  wire                    parked,
    input  wire [3:0]              faults,
    input  wire [4*COUNT_BITS-1:0] fault_counts
);
    localparam [2:0] PROGRAM = 3'd0, X_TABLE = 3'd1, Y_TABLE = 3'd2, X_FOURIER = 3'd3, Y_FOURIER = 3'd4;
    localparam [2:0] X_PARTS = 3'd5, Y_PARTS = 3'd6, PIXEL_TICKS = 3'd7;
    localparam [12:0] KNOTS = 13'd65;
    localparam [31:0] LAST = 2 * HARMONICS;
    localparam [31:0] MOST_HARMONICS = FOURIER != 0 ? HARMONICS : 0;
    localparam [31:0] BITS = DAC_BITS, ORDER = SHAPING, RENDERS = FOURIER, MODES = COMMIT_MODES, SLOW = SLOW_PART;
    localparam [31:0] PIXEL_INDEX = PIXEL_INDEX_BITS, SLOW_INDEX = SLOW_PART != 0 ? SLOW_INDEX_BITS : 0;
    localparam [31:0] X_DEGREE = X_INTERPOLATED, X_INDEX = X_INDEX_BITS, X_BITS = X_WORD_BITS;
    localparam [31:0] Y_DEGREE = Y_INTERPOLATED, Y_INDEX = Y_INDEX_BITS, Y_BITS = Y_WORD_BITS;
    localparam [2:0] SETTLING = 3'd6;  // clocks until a commit has been refused, is committed or is being rendered
    wire unused_parameters = &{LAST, MOST_HARMONICS, BITS, ORDER, RENDERS, MODES, SLOW, PIXEL_INDEX, SLOW_INDEX,
                               X_DEGREE, X_INDEX, X_BITS, Y_DEGREE, Y_INDEX, Y_BITS};

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (DAC_BITS < 8 || DAC_BITS > 24) begin : guard_0
            dac_bus_DAC_BITS_is_not_8_to_24 stop ();
        end
        if (X_INTERPOLATED != 0 && X_INTERPOLATED != 1 && X_INTERPOLATED != 3) begin : guard_1
            dac_bus_X_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (X_INDEX_BITS < 2 || X_INDEX_BITS > 16) begin : guard_2
            dac_bus_X_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (X_WORD_BITS < 8 || X_WORD_BITS > 24) begin : guard_3
            dac_bus_X_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (Y_INTERPOLATED != 0 && Y_INTERPOLATED != 1 && Y_INTERPOLATED != 3) begin : guard_4
            dac_bus_Y_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (Y_INDEX_BITS < 2 || Y_INDEX_BITS > 16) begin : guard_5
            dac_bus_Y_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (Y_WORD_BITS < 8 || Y_WORD_BITS > 24) begin : guard_6
            dac_bus_Y_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (COUNT_BITS < 2 || COUNT_BITS > 32) begin : guard_7
            dac_bus_COUNT_BITS_is_not_2_to_32 stop ();
        end
        if (FOURIER < 0 || FOURIER > 1) begin : guard_8
            dac_bus_FOURIER_is_not_0_to_1 stop ();
        end
        if (HARMONICS < 1 || HARMONICS > 512) begin : guard_9
            dac_bus_HARMONICS_is_not_1_to_512 stop ();
        end
        if (SHAPING < 0 || SHAPING > 3) begin : guard_10
            dac_bus_SHAPING_is_not_0_to_3 stop ();
        end
        if (COMMIT_MODES < 0 || COMMIT_MODES > 1) begin : guard_11
            dac_bus_COMMIT_MODES_is_not_0_to_1 stop ();
        end
        if (PIXEL_INDEX_BITS != 0 && (PIXEL_INDEX_BITS < 2 || PIXEL_INDEX_BITS > 14)) begin : guard_12
            dac_bus_PIXEL_INDEX_BITS_is_not_0_or_2_to_14 stop ();
        end
        if (SLOW_PART < 0 || SLOW_PART > 1) begin : guard_13
            dac_bus_SLOW_PART_is_not_0_to_1 stop ();
        end
        if (SLOW_PART != 0 && (SLOW_INDEX_BITS < 3 || SLOW_INDEX_BITS > 13)) begin : guard_14
            dac_bus_SLOW_INDEX_BITS_is_not_3_to_13 stop ();
        end
        if (SLOW_PART != 0 && (X_INDEX_BITS > 13 || Y_INDEX_BITS > 13)) begin : guard_15
            dac_bus_X_or_Y_INDEX_BITS_with_SLOW_PART_are_more_than_13 stop ();
        end
    endgenerate

    // An access is held, acts on the next clock, and ends on the one after, or later if it has to settle.
    reg held, acts, is_write, whole;
    reg [19:0] address;
    reg [31:0] data;
    reg [2:0] settling;
    initial begin
        held = 1'b0;
        acts = 1'b0;
        settling = 3'd0;
        done = 1'b0;
        failed = 1'b0;
        read_data = 32'd0;
    end

    // Every field of a register that is read is an input of the map.
    reg [4:0] pending, enabled;  // refused, fault, stopped, committed, writable
    wire command_write, arm_write, pending_write, enable_write, legal;
    wire in_program, in_x_fourier, in_y_fourier, in_pixel_ticks, in_x_table, in_y_table, in_x_slow, in_y_slow;
    wire [15:0] word;
    wire [31:0] value;
    wire [127:0] counts;
    dac_bus_map map (
        .address(address), .write(is_write), .data(data),
        .features_dac_bits(BITS[4:0]), .features_shaping(ORDER[1:0]), .features_fourier(RENDERS[0]),
        .features_commit_modes(MODES[0]), .features_slow_part(SLOW[0]), .features_harmonics(MOST_HARMONICS[9:0]),
        .memory_shape_pixel_index_bits(PIXEL_INDEX[4:0]), .memory_shape_slow_index_bits(SLOW_INDEX[4:0]),
        .x_shape_degree(X_DEGREE[1:0]), .x_shape_index_bits(X_INDEX[4:0]), .x_shape_word_bits(X_BITS[4:0]),
        .y_shape_degree(Y_DEGREE[1:0]), .y_shape_index_bits(Y_INDEX[4:0]), .y_shape_word_bits(Y_BITS[4:0]),
        .status_writable(writable), .status_committed(committed), .status_refused(refused), .status_armed(armed),
        .status_running(running), .status_playing(playing), .status_parked(parked), .status_busy(busy),
        .status_booting(booting), .status_missing(missing), .status_can_keep(can_keep),
        .faults_slew(faults[0]), .faults_clamp(faults[1]), .faults_overrun(faults[2]), .faults_underrun(faults[3]),
        .slew_count(counts[31:0]), .clamp_count(counts[63:32]), .overrun_count(counts[95:64]),
        .underrun_count(counts[127:96]),
        .interrupt_pending_writable(pending[0]), .interrupt_pending_committed(pending[1]),
        .interrupt_pending_stopped(pending[2]), .interrupt_pending_fault(pending[3]),
        .interrupt_pending_refused(pending[4]),
        .interrupt_enable_writable(enabled[0]), .interrupt_enable_committed(enabled[1]),
        .interrupt_enable_stopped(enabled[2]), .interrupt_enable_fault(enabled[3]),
        .interrupt_enable_refused(enabled[4]),
        .write_command(command_write), .write_arm(arm_write), .write_interrupt_pending(pending_write),
        .write_interrupt_enable(enable_write), .in_program(in_program), .in_x_fourier(in_x_fourier),
        .in_y_fourier(in_y_fourier), .in_pixel_ticks(in_pixel_ticks), .in_x_table(in_x_table),
        .in_y_table(in_y_table), .in_x_slow(in_x_slow), .in_y_slow(in_y_slow), .word(word), .legal(legal), .value(value)
    );
    genvar i;
    generate
        for (i = 0; i < 4; i = i + 1) begin : count
            if (COUNT_BITS == 32) begin : full
                assign counts[32*i +: 32] = fault_counts[COUNT_BITS*i +: COUNT_BITS];
            end else begin : padded
                assign counts[32*i +: 32] = {{(32 - COUNT_BITS){1'b0}}, fault_counts[COUNT_BITS*i +: COUNT_BITS]};
            end
        end
    endgenerate

    // Words go to the host port, if they exist in this sequencer.
    wire in_slow = in_x_slow || in_y_slow;
    wire in_memory =
        in_program || in_x_fourier || in_y_fourier || in_pixel_ticks || in_x_table || in_y_table || in_slow;
    wire [12:0] place = word[12:0];  // in one of four parts
    wire in_second = in_x_slow ? place >> X_INDEX_BITS == 13'd0 : place >> Y_INDEX_BITS == 13'd0;
    wire in_part = word[14] ? place < KNOTS : word[13] ? place >> SLOW_INDEX_BITS == 13'd0 : in_second;
    wire exists = !in_memory || in_program || (in_x_table && word >> X_INDEX_BITS == 16'd0) ||
        (in_y_table && word >> Y_INDEX_BITS == 16'd0) ||
        (PIXEL_INDEX_BITS != 0 && in_pixel_ticks && word >> PIXEL_INDEX_BITS == 16'd0) ||
        (SLOW_PART != 0 && in_slow && in_part) ||
        (FOURIER != 0 && (in_x_fourier || in_y_fourier) && word <= LAST[15:0]);
    wire has_mode = !command_write || data[9:8] == 2'd0 || (COMMIT_MODES != 0 && data[9:8] != 2'd3);
    wire waits = (in_memory || (command_write && data[0])) && !writable;
    wire effective = acts && !reset && legal && exists && has_mode && !waits && (!is_write || whole);
    assign write = effective && in_memory;
    assign write_region =
        in_x_table ? X_TABLE : in_y_table ? Y_TABLE : in_x_fourier ? X_FOURIER : in_y_fourier ? Y_FOURIER :
        in_pixel_ticks ? PIXEL_TICKS : in_x_slow ? X_PARTS : in_y_slow ? Y_PARTS : PROGRAM;
    assign write_address = in_slow ? {word[14:13], 1'b0, place} : word;
    assign write_data = data;
    assign {clear_faults, park, trigger, withdraw, commit} = effective && command_write ? data[4:0] : 5'd0;
    assign commit_mode = data[9:8];
    assign arm = effective && arm_write;
    assign arm_frames = data[15:0];

    always @(posedge clock) begin
        acts <= request && !reset;
        done <= 1'b0;
        if (request) begin
            is_write <= request_write;
            address <= request_address;
            data <= request_data;
            whole <= request_bytes == 4'b1111;
        end
        if (acts) begin
            failed <= !effective;
            read_data <= effective ? value : 32'd0;
            settling <= SETTLING;
        end else if (settling != 3'd0)
            settling <= settling - 3'd1;
        if (reset)
            held <= 1'b0;
        else if (acts) begin
            held <= effective && (command_write || arm_write);
            done <= !(effective && (command_write || arm_write));
        end else if (held && settling == 3'd1) begin
            held <= 1'b0;
            done <= 1'b1;
        end
    end

    // An event is a change of what the sequencer says.
    reg was_writable, was_committed, was_running, was_refused;
    reg [3:0] were_faults;
    initial begin
        pending = 5'd0;
        enabled = 5'd0;
        was_writable = 1'b1;
        was_committed = 1'b0;
        was_running = 1'b0;
        was_refused = 1'b0;
        were_faults = 4'd0;
    end
    wire [4:0] events = {
        refused && !was_refused, (faults & ~were_faults) != 4'd0, !running && was_running, committed && !was_committed,
        writable && !was_writable
    };
    wire [4:0] cleared = effective && pending_write ? data[4:0] : 5'd0;
    always @(posedge clock) begin
        was_writable <= writable;
        was_committed <= committed;
        was_running <= running;
        was_refused <= refused;
        were_faults <= faults;
        pending <= reset ? 5'd0 : (pending & ~cleared) | events;
        if (reset)
            enabled <= 5'd0;
        else if (effective && enable_write)
            enabled <= data[4:0];
    end
    assign irq = (pending & enabled) != 5'd0;
endmodule

`default_nettype wire
