// The serial link of a dac_sequencer: takes new programs from a host while the old one plays (docs/protocol.md).
//
//   line in -> dac_uart_rx -> ring in memory -> dac_loader_core -> dac_uart_tx -> line out
//                                                   |  ^
//                     writes, commit, requests -> sequencer -> strobe, markers, faults
//
// An image is kept in the loader's memory until it is complete and has passed its checks, and then written into the
// sequencer's idle bank: MEMORY_BYTES less 768 is the longest image. docs/verilog.md says what is checked, and what
// need not be. All parameters that a dac_sequencer has too must be those of the sequencer.
//
// `permit` is the interlock: low, nothing is committed. Outputs go to the sequencer, through a dac_boot where there is
// one; `writable` and the rest come from it.

`default_nettype none

module program_loader #(
    parameter CLOCKS_PER_BIT = 434,      // 115200 baud at 50 MHz; from 16 on it keeps up with the line
    parameter MEMORY_BYTES = 2048,       // 2^11..2^16
    parameter WINDOW = 8,                // frames that may be unacknowledged
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 1,        // degree of a table: 0 direct, 1 lines, 3 cubic
    parameter X_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter Y_WORD_BITS = 16,
    parameter TICK_BITS = 24,
    parameter LINE_BITS = 16,            // at most 16
    parameter COMMIT_MODES = 0,          // 1: the sequencer has them too
    parameter FOURIER = 0,
    parameter HARMONICS = 64,
    parameter SHAPING = 0,               // highest order of shaped output
    parameter CONVERTER = DAC_BITS,      // bits of the converter word, + 64 two's complement, + 128 left-aligned
    parameter [31:0] X_CODE_MIN = 0,     // limits of every program
    parameter [31:0] X_CODE_MAX = (1 << DAC_BITS) - 1,
    parameter [31:0] X_MAX_STEP = (1 << DAC_BITS) - 1,
    parameter [31:0] Y_CODE_MIN = 0,
    parameter [31:0] Y_CODE_MAX = (1 << DAC_BITS) - 1,
    parameter [31:0] Y_MAX_STEP = (1 << DAC_BITS) - 1,
    parameter [31:0] UPDATE_RATE = 0,    // ticks a second; has to be set
    parameter [255:0] BOOT_HASH = 0      // SHA-256 of the plan that it boots with; 0: not known
) (
    input  wire        clock,
    input  wire        reset,            // forgets session and upload
    input  wire        line_in,
    output wire        line_out,
    input  wire        permit,
    input  wire [31:0] boot,             // a number that differs from start to start
    input  wire        booting,
    // to the sequencer
    output wire        write,
    output wire [2:0]  write_region,
    output wire [15:0] write_address,
    output wire [31:0] write_data,
    input  wire        writable,
    input  wire        refused,
    output wire        commit,
    output wire [1:0]  commit_mode,
    input  wire        can_keep,
    output wire        withdraw,
    output wire        arm,
    output wire [15:0] arm_frames,
    output wire        trigger,
    output wire        park,
    output wire        clear_faults,
    // from the sequencer
    input  wire        strobe,
    input  wire        line_marker,
    input  wire        frame_marker,
    input  wire        swapped_marker,
    input  wire        playing,
    input  wire        parked,
    input  wire [3:0]  faults,
    input  wire [63:0] fault_counts      // COUNT_BITS = 16
);
    localparam ADDRESS_BITS = $clog2(MEMORY_BYTES);
    localparam [7:0] WITHDRAWN = 8'd25, REFUSED = 8'd28;
    localparam [31:0] IMAGE_AT = 32'h300;
    localparam [31:0] IMAGE_BYTES = (1 << ADDRESS_BITS) - IMAGE_AT;
    localparam [31:0] RING_AT = 32'h180;  // 128 bytes
    localparam [31:0] PAGE_AT = IMAGE_AT + 64;

    // What the device is: constants in its memory (firmware_templates/loader/memory.s), the last one first.
    localparam X_GUARD = X_WORD_BITS < 22 ? 4 : 25 - X_WORD_BITS, Y_GUARD = Y_WORD_BITS < 22 ? 4 : 25 - Y_WORD_BITS;
    localparam [31:0] X_REACH = 1 << (X_WORD_BITS + X_GUARD - 1), Y_REACH = 1 << (Y_WORD_BITS + Y_GUARD - 1);
    localparam [31:0] X_HALF = 1 << (X_WORD_BITS - 1), Y_HALF = 1 << (Y_WORD_BITS - 1);
    localparam [31:0] X_MOST_WORDS = 1 << X_INDEX_BITS, Y_MOST_WORDS = 1 << Y_INDEX_BITS;
    localparam [31:0] X_WORDS = X_INTERPOLATED != 0 ? X_MOST_WORDS : 0;
    localparam [31:0] Y_WORDS = Y_INTERPOLATED != 0 ? Y_MOST_WORDS : 0;
    localparam [31:0] MOST_HARMONICS = FOURIER ? HARMONICS : 0;
    localparam [31:0] X_HARMONICS = X_INTERPOLATED != 0 ? MOST_HARMONICS : 0;
    localparam [31:0] Y_HARMONICS = Y_INTERPOLATED != 0 ? MOST_HARMONICS : 0;
    localparam [31:0] TOP_CODE = (1 << DAC_BITS) - 1, MOST_TICKS = 1 << TICK_BITS, MOST_LINES = 1 << LINE_BITS;
    localparam [31:0] X_INDEX = X_INDEX_BITS, Y_INDEX = Y_INDEX_BITS, X_WORD = X_WORD_BITS, Y_WORD = Y_WORD_BITS;
    localparam [31:0] DAC = DAC_BITS, FRAMES = WINDOW, WORD = CONVERTER, HIGHEST_ORDER = SHAPING;
    localparam [7:0] CUBIC = 8'd128;  // in the index bits of a table
    localparam [7:0] DEGREE = X_INTERPOLATED == 3 || Y_INTERPOLATED == 3 ? 8'd3 : 8'd0;
    localparam [7:0] X_INDEX_WANTED =
        X_INTERPOLATED == 3 ? CUBIC | X_INDEX[7:0] : X_INTERPOLATED != 0 ? X_INDEX[7:0] : 8'd0;
    localparam [7:0] Y_INDEX_WANTED =
        Y_INTERPOLATED == 3 ? CUBIC | Y_INDEX[7:0] : Y_INTERPOLATED != 0 ? Y_INDEX[7:0] : 8'd0;
    localparam [7:0] X_WORD_BYTES = X_WORD_BITS <= 16 ? 8'd2 : 8'd3, Y_WORD_BYTES = Y_WORD_BITS <= 16 ? 8'd2 : 8'd3;
    localparam [7:0] FEATURES = 8'd25 + (FOURIER ? 8'd2 : 8'd0) + (COMMIT_MODES ? 8'd64 : 8'd0);
    localparam [7:0] WITH_MODE = COMMIT_MODES ? 8'd5 : 8'd255;  // bytes of a COMMIT

    // Bytes of a payload by its type, 13 first; 128: acts, 127: not of this device.
    localparam [14*8-1:0] LENGTHS = {
        8'd0, 8'd127, 8'd128, 8'd128, 8'd132, 8'd128, 8'd5, 8'd0, 8'd128, 8'd132, 8'd0, 8'd48, 8'd0, 8'd127
    };
    localparam [64*8-1:0] NUMBERS = {
        8'd0, WITH_MODE, 8'd0, 8'd1, 16'd0,
        LENGTHS, Y_WORD_BYTES, X_WORD_BYTES, PAGE_AT[15:0], RING_AT[15:0], IMAGE_AT[15:0],
        8'd0, DAC[7:0], Y_WORD[7:0], Y_INDEX_WANTED, 8'd0, DAC[7:0], X_WORD[7:0], X_INDEX_WANTED, 32'hffffffff,
        32'h01000000, TOP_CODE, 32'h00020000, IMAGE_BYTES, MOST_LINES, MOST_TICKS
    };
    localparam [40*8-1:0] AXES = {
        Y_HALF, Y_HARMONICS, Y_MOST_WORDS, Y_WORDS, Y_REACH, X_HALF, X_HARMONICS, X_MOST_WORDS, X_WORDS, X_REACH
    };
    localparam [32*8-1:0] HASH = reversed(BOOT_HASH);
    localparam [56*8-1:0] HELLO = {
        UPDATE_RATE, TOP_CODE, Y_MAX_STEP, Y_CODE_MAX, Y_CODE_MIN, TOP_CODE, X_MAX_STEP, X_CODE_MAX, X_CODE_MIN,
        WORD[7:0], DAC[7:0], Y_WORD[7:0], Y_INDEX[7:0], WORD[7:0], DAC[7:0], X_WORD[7:0], X_INDEX[7:0],
        IMAGE_BYTES, DEGREE, HIGHEST_ORDER[7:0], MOST_HARMONICS[15:0], 8'd240, FRAMES[7:0], FEATURES, 8'd1
    };
    function [255:0] reversed(input [255:0] bytes);
        integer i;
        for (i = 0; i < 32; i = i + 1) reversed[8*i +: 8] = bytes[8*(31-i) +: 8];
    endfunction
    wire [4*32-1:0] parts_of_numbers = {X_INDEX, Y_INDEX, X_WORD, Y_WORD};
    wire [6*32-1:0] parts_of_more = {DAC, FRAMES, WORD, HIGHEST_ORDER, MOST_HARMONICS, RING_AT & PAGE_AT};
    wire unused = &{parts_of_numbers, parts_of_more, IMAGE_AT};

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (CLOCKS_PER_BIT < 8 || CLOCKS_PER_BIT > 65536) begin : guard_0
            program_loader_CLOCKS_PER_BIT_is_not_8_to_65536 stop ();
        end
        if (MEMORY_BYTES < 2048 || MEMORY_BYTES > 65536 || MEMORY_BYTES != (1 << $clog2(MEMORY_BYTES))) begin : guard_1
            program_loader_MEMORY_BYTES_is_no_power_of_two_from_2048_to_65536 stop ();
        end
        if (WINDOW < 1 || WINDOW > 255) begin : guard_2
            program_loader_WINDOW_is_not_1_to_255 stop ();
        end
        if (DAC_BITS < 8 || DAC_BITS > 24) begin : guard_3
            program_loader_DAC_BITS_is_not_8_to_24 stop ();
        end
        if (X_INTERPOLATED != 0 && X_INTERPOLATED != 1 && X_INTERPOLATED != 3) begin : guard_4
            program_loader_X_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (X_INDEX_BITS < 2 || X_INDEX_BITS > 16) begin : guard_5
            program_loader_X_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (X_WORD_BITS < 8 || X_WORD_BITS > 24) begin : guard_6
            program_loader_X_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (Y_INTERPOLATED != 0 && Y_INTERPOLATED != 1 && Y_INTERPOLATED != 3) begin : guard_7
            program_loader_Y_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (Y_INDEX_BITS < 2 || Y_INDEX_BITS > 16) begin : guard_8
            program_loader_Y_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (Y_WORD_BITS < 8 || Y_WORD_BITS > 24) begin : guard_9
            program_loader_Y_WORD_BITS_is_not_8_to_24 stop ();
        end
        if (TICK_BITS < 3 || TICK_BITS > 30) begin : guard_10
            program_loader_TICK_BITS_is_not_3_to_30 stop ();
        end
        if (LINE_BITS < 1 || LINE_BITS > 16) begin : guard_11
            program_loader_LINE_BITS_is_not_1_to_16 stop ();
        end
        if (COMMIT_MODES < 0 || COMMIT_MODES > 1) begin : guard_30
            program_loader_COMMIT_MODES_is_not_0_to_1 stop ();
        end
        if (FOURIER < 0 || FOURIER > 1) begin : guard_12
            program_loader_FOURIER_is_not_0_to_1 stop ();
        end
        if (HARMONICS < 1 || HARMONICS > 512) begin : guard_13
            program_loader_HARMONICS_is_not_1_to_512 stop ();
        end
        if (CONVERTER % 64 < DAC_BITS || CONVERTER % 64 > 32 || CONVERTER > 255) begin : guard_14
            program_loader_CONVERTER_is_no_word_of_DAC_BITS_or_more stop ();
        end
        if (X_CODE_MIN > X_CODE_MAX || X_CODE_MAX >= 32'd1 << DAC_BITS) begin : guard_15
            program_loader_X_CODE_MIN_to_X_CODE_MAX_is_no_range_of_DAC_BITS stop ();
        end
        if (X_MAX_STEP < 32'd1 || X_MAX_STEP >= 32'd1 << DAC_BITS) begin : guard_16
            program_loader_X_MAX_STEP_is_not_1_to_the_highest_code stop ();
        end
        if (Y_CODE_MIN > Y_CODE_MAX || Y_CODE_MAX >= 32'd1 << DAC_BITS) begin : guard_17
            program_loader_Y_CODE_MIN_to_Y_CODE_MAX_is_no_range_of_DAC_BITS stop ();
        end
        if (Y_MAX_STEP < 32'd1 || Y_MAX_STEP >= 32'd1 << DAC_BITS) begin : guard_18
            program_loader_Y_MAX_STEP_is_not_1_to_the_highest_code stop ();
        end
        if (SHAPING < 0 || SHAPING > 3) begin : guard_19
            program_loader_SHAPING_is_not_0_to_3 stop ();
        end
        if (X_INTERPOLATED == 3 && (X_INDEX_BITS < 3 || X_INDEX_BITS > 14)) begin : guard_20
            program_loader_X_INDEX_BITS_of_a_cubic_table_is_not_3_to_14 stop ();
        end
        if (X_INTERPOLATED == 3 && X_WORD_BITS > 21) begin : guard_21
            program_loader_X_WORD_BITS_of_a_cubic_table_is_not_8_to_21 stop ();
        end
        if (Y_INTERPOLATED == 3 && (Y_INDEX_BITS < 3 || Y_INDEX_BITS > 14)) begin : guard_22
            program_loader_Y_INDEX_BITS_of_a_cubic_table_is_not_3_to_14 stop ();
        end
        if (Y_INTERPOLATED == 3 && Y_WORD_BITS > 21) begin : guard_23
            program_loader_Y_WORD_BITS_of_a_cubic_table_is_not_8_to_21 stop ();
        end
        if (UPDATE_RATE == 32'd0) begin : guard_24
            program_loader_UPDATE_RATE_is_not_set stop ();
        end
    endgenerate

    // Bytes from the line go into the ring whenever the processor does not write.
    wire [7:0] received, from_memory;
    wire byte_came, core_write;
    wire [ADDRESS_BITS-1:0] read_address, core_write_address;
    wire [7:0] core_write_data;
    reg waits;
    reg [6:0] ring_at;
    reg ring_lap;
    wire ring_write = waits && !core_write;
    wire [ADDRESS_BITS-1:0] ring_address = {RING_AT[ADDRESS_BITS-1:7], ring_at};
    initial begin
        waits = 1'b0;
        {ring_lap, ring_at} = 8'd0;
    end
    always @(posedge clock) begin
        waits <= byte_came || (waits && core_write);
        if (ring_write) {ring_lap, ring_at} <= {ring_lap, ring_at} + 8'd1;
    end

    dac_uart_rx #(.CLOCKS_PER_BIT(CLOCKS_PER_BIT)) receiver (
        .clock(clock), .line(line_in), .data(received), .received(byte_came)
    );
    dac_loader_memory #(.ADDRESS_BITS(ADDRESS_BITS), .NUMBERS(NUMBERS), .DEVICE({AXES, HASH, HELLO})) memory (
        .clock(clock), .read_address(read_address), .read_data(from_memory), .write(core_write || ring_write),
        .write_address(core_write ? core_write_address : ring_address),
        .write_data(core_write ? core_write_data : received)
    );

    // Lines of the frame, and the last one before a program was taken.
    reg [15:0] line, swap_line;
    reg swapped;  // and the processor has not seen it
    wire [31:0] a;
    wire request, ready, send;
    wire seen = request && a[2:0] == 3'd7;
    initial begin
        line = 16'd0;
        swap_line = 16'd0;
        swapped = 1'b0;
    end
    always @(posedge clock) begin
        if (strobe && (line_marker || !playing)) line <= frame_marker || !playing ? 16'd0 : line + 16'd1;
        if (strobe && swapped_marker) swap_line <= line;
        swapped <= (strobe && swapped_marker) || (swapped && !seen);
    end

    // What the processor reads. `permit` and `writable` come from outside.
    reg permit_1, permit_2;
    initial {permit_1, permit_2} = 2'd0;
    always @(posedge clock) begin
        permit_1 <= permit;
        permit_2 <= permit_1;
    end
    wire reads_input;
    reg from_input;
    reg [7:0] in;
    reg may_write;
    initial from_input = 1'b0;
    always @(posedge clock) begin
        from_input <= reads_input;
        may_write <= writable && !booting;
        case (read_address[4:0])
            5'd0: in <= boot[7:0];
            5'd1: in <= boot[15:8];
            5'd2: in <= boot[23:16];
            5'd3: in <= boot[31:24];
            5'd4: in <= swap_line[7:0];
            5'd5: in <= swap_line[15:8];
            5'd6: in <= line[7:0];
            5'd7: in <= line[15:8];
            5'd8: in <= fault_counts[7:0];
            5'd9: in <= fault_counts[15:8];
            5'd10: in <= fault_counts[23:16];
            5'd11: in <= fault_counts[31:24];
            5'd12: in <= fault_counts[39:32];
            5'd13: in <= fault_counts[47:40];
            5'd14: in <= fault_counts[55:48];
            5'd15: in <= fault_counts[63:56];
            5'd16: in <= {4'd0, faults};
            5'd17: in <= {ring_lap, ring_at};
            5'd18: in <= {7'd0, permit_2};
            5'd19: in <= {7'd0, ready};
            5'd20: in <= {7'd0, swapped};
            5'd21: in <= {7'd0, may_write};
            5'd22: in <= {6'd0, playing ? 2'd3 : parked ? 2'd1 : 2'd2};
            5'd23: in <= playing && !can_keep ? 8'd1 : 8'd3;
            default: in <= refused ? REFUSED : WITHDRAWN;
        endcase
    end

    wire [ADDRESS_BITS-1:0] p;
    dac_loader_core #(.ADDRESS_BITS(ADDRESS_BITS)) core (
        .clock(clock), .reset(reset), .read_address(read_address), .reads_input(reads_input),
        .read_data(from_input ? in : from_memory), .write(core_write), .write_address(core_write_address),
        .write_data(core_write_data), .a(a), .p(p), .program_write(write), .program_region(write_region),
        .request(request), .send(send)
    );
    dac_uart_tx #(.CLOCKS_PER_BIT(CLOCKS_PER_BIT)) transmitter (
        .clock(clock), .send(send), .data(a[7:0]), .ready(ready), .line(line_out)
    );

    // To the sequencer. The interlock is in the way of the commit itself, whatever the processor thinks of it.
    wire [ADDRESS_BITS+15:0] p_wide = {16'd0, p};
    wire unused_bits = &p_wide;
    assign write_address = p_wide[15:0];
    assign write_data = a;
    assign commit = request && a[2:0] == 3'd1 && permit_2;
    assign commit_mode = a[9:8];
    assign withdraw = request && a[2:0] == 3'd2;
    assign park = request && a[2:0] == 3'd3;
    assign arm = request && a[2:0] == 3'd4;
    assign trigger = request && a[2:0] == 3'd5;
    assign clear_faults = request && a[2:0] == 3'd6;
    assign arm_frames = a[31:16];
endmodule

`default_nettype wire
