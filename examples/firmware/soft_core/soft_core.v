// A scanner with a RISC-V core: dac_wishbone and a sequencer, on the bus of a processor that runs the C link.
//
// The core is VexRiscv as LiteX has it (VexRiscv_Lite.v of the package pythondata-cpu-vexriscv). The memory map:
//
//   0x00000000  RAM, which begins with FIRMWARE
//   0x80000000  the sequencer: docs/registers.md
//   0x90000000  that of z; 0xA0000000 writes to both at once
//   0xC0000000  the serial line, interlock and lines of the frame: soft_core.h
//
// The ports are those of examples/verilog/linked_scanner.v, and z_data. While `permit` is low, no new scan becomes
// active. The scan of the build gives widths, modes and power-up codes; its update rate has to be that of
// CLOCKS_PER_TICK. soft_core.vh, which the Makefile writes, has the constants of the build with the prefix SCAN_. A
// scan at an angle has a slow part on both axes, and the sequencer then plays such scans alone. With z there is a
// second sequencer, in soft_core_z.v.

`default_nettype none

module soft_core #(
    parameter CLOCKS_PER_TICK = 50,
    parameter CLOCKS_PER_BIT = 217,
    parameter START_CLOCKS = 4096,  // block RAMs of some parts are not ready at power-up
    parameter RAM_BYTES = 65536,
    parameter FIRMWARE = "firmware.mem"
) (
    input  wire clock,
    input  wire line_in,
    output wire line_out,
    input  wire permit,
    output wire sclk,
    output wire select_n,
    output wire x_data,
    output wire y_data,
    output wire z_data,
    output wire load_n,
    output wire line,
    output wire frame,
    output wire pixel,
    output wire backward,
    output wire image,
    output wire fault
);
    `include "soft_core.vh"

    localparam COUNT_BITS = 16;

    reg [$clog2(START_CLOCKS+1)-1:0] start;
    initial start = 0;
    wire reset = start != START_CLOCKS;
    always @(posedge clock) if (reset) start <= start + 1'b1;

    // The core has a bus for instructions and one for data.
    wire i_cycle, i_strobe, d_cycle, d_strobe, d_write, i_done, d_done, d_failed;
    wire [29:0] i_address, d_address;
    wire [31:0] d_data;
    wire [3:0] d_bytes;
    reg [31:0] read_data;
    VexRiscv core (
        .clk(clock), .reset(reset), .externalResetVector(32'd0),
        .timerInterrupt(1'b0), .softwareInterrupt(1'b0), .externalInterruptArray(32'd0),
        .iBusWishbone_CYC(i_cycle), .iBusWishbone_STB(i_strobe), .iBusWishbone_ACK(i_done), .iBusWishbone_WE(),
        .iBusWishbone_ADR(i_address), .iBusWishbone_DAT_MISO(read_data), .iBusWishbone_DAT_MOSI(),
        .iBusWishbone_SEL(), .iBusWishbone_ERR(1'b0), .iBusWishbone_CTI(), .iBusWishbone_BTE(),
        .dBusWishbone_CYC(d_cycle), .dBusWishbone_STB(d_strobe), .dBusWishbone_ACK(d_done), .dBusWishbone_WE(d_write),
        .dBusWishbone_ADR(d_address), .dBusWishbone_DAT_MISO(read_data), .dBusWishbone_DAT_MOSI(d_data),
        .dBusWishbone_SEL(d_bytes), .dBusWishbone_ERR(d_failed), .dBusWishbone_CTI(), .dBusWishbone_BTE()
    );

    // They take turns on one bus: an access is chosen, and stays until it is answered.
    localparam [1:0] RAM = 2'd0, SEQUENCER = 2'd2, SYSTEM = 2'd3;
    reg access, of_data;
    initial {access, of_data} = 2'b00;
    wire done, failed;
    always @(posedge clock)
        if (!access) begin
            access <= !reset && ((d_cycle && d_strobe) || (i_cycle && i_strobe));
            of_data <= d_cycle && d_strobe;
        end else if (done || failed)
            access <= 1'b0;
    wire [29:0] address = of_data ? d_address : i_address;
    wire write = of_data && d_write;
    wire [1:0] target = address[29:28];
    assign i_done = done && access && !of_data;
    assign d_done = done && access && of_data;
    assign d_failed = failed && access && of_data;

    // RAM and system answer after a clock, the sequencer when it has done. A write to both ends with that to x and y.
    reg answered;
    initial answered = 1'b0;
    wire at_once = access && target != SEQUENCER && !answered;
    wire of_z = SCAN_Z != 0 && address[27:26] == 2'd1, of_both = SCAN_Z != 0 && address[27:26] == 2'd2;
    wire xy_access = access && target == SEQUENCER && !of_z;
    wire z_access = access && target == SEQUENCER && (of_z || of_both);
    wire xy_done, xy_failed, z_done, z_failed;
    wire [31:0] xy_read, z_read;
    wire scan_done = of_z ? z_done : xy_done;
    wire scan_failed = xy_failed || z_failed;
    wire [31:0] scan_data = of_z ? z_read : xy_read;
    always @(posedge clock) answered <= at_once;
    assign done = answered || scan_done;
    assign failed = scan_failed;

    localparam RAM_BITS = $clog2(RAM_BYTES) - 2;
    reg [31:0] ram [0:RAM_BYTES/4-1];
    reg [31:0] ram_data, system_data;
    initial $readmemh(FIRMWARE, ram);
    wire ram_write = at_once && target == RAM && write;
    always @(posedge clock) begin
        if (ram_write && d_bytes[0]) ram[address[RAM_BITS-1:0]][7:0] <= d_data[7:0];
        if (ram_write && d_bytes[1]) ram[address[RAM_BITS-1:0]][15:8] <= d_data[15:8];
        if (ram_write && d_bytes[2]) ram[address[RAM_BITS-1:0]][23:16] <= d_data[23:16];
        if (ram_write && d_bytes[3]) ram[address[RAM_BITS-1:0]][31:24] <= d_data[31:24];
        ram_data <= ram[address[RAM_BITS-1:0]];
    end
    always @(*)
        case (target)
            RAM: read_data = ram_data;
            SEQUENCER: read_data = scan_data;
            default: read_data = system_data;
        endcase

    // System: 0 a received byte, or one to send; 4 state; 8 line of the frame; 12 programs taken; 16, 20 those of z.
    // What was received waits in 2048 bytes, more than the link lets a host send without an answer.
    localparam FIFO_BITS = 11;
    wire system = at_once && target == SYSTEM && of_data;
    wire send = system && write && address[2:0] == 3'd0;
    wire taken = system && !write && address[2:0] == 3'd0;
    wire [7:0] received;
    wire byte_came, can_send;
    reg [7:0] fifo [0:(1<<FIFO_BITS)-1];
    reg [7:0] first;
    reg [FIFO_BITS:0] fifo_in, fifo_out;
    initial {fifo_in, fifo_out} = 0;
    wire empty = fifo_in == fifo_out;
    wire full = fifo_in - fifo_out == 1 << FIFO_BITS;
    reg fresh;  // `first` is the oldest byte
    initial fresh = 1'b0;
    always @(posedge clock) begin
        if (byte_came && !full) fifo[fifo_in[FIFO_BITS-1:0]] <= received;
        if (byte_came && !full) fifo_in <= fifo_in + 1'b1;
        if (taken && fresh) fifo_out <= fifo_out + 1'b1;
        first <= fifo[fifo_out[FIFO_BITS-1:0]];
        fresh <= !empty && !(taken && fresh);
    end
    dac_uart_rx #(.CLOCKS_PER_BIT(CLOCKS_PER_BIT)) receiver (
        .clock(clock), .line(line_in), .data(received), .received(byte_came)
    );
    dac_uart_tx #(.CLOCKS_PER_BIT(CLOCKS_PER_BIT)) transmitter (
        .clock(clock), .send(send), .data(d_data[7:0]), .ready(can_send), .line(line_out)
    );

    reg permit_1, permit_2;
    initial {permit_1, permit_2} = 2'd0;
    always @(posedge clock) {permit_2, permit_1} <= {permit_1, permit};

    wire strobe, swapped, playing, parked, xy_line, xy_frame, xy_pixel, xy_backward, xy_image;
    reg [15:0] line_number;
    reg [31:0] swaps;
    wire [15:0] z_line_number;
    wire [31:0] z_swaps;
    initial line_number = 16'd0;
    initial swaps = 32'd0;
    always @(posedge clock) if (strobe) begin
        if (xy_line || !playing) line_number <= xy_frame || !playing ? 16'd0 : line_number + 16'd1;
        if (swapped) swaps <= swaps + 32'd1;
    end
    always @(posedge clock)
        case (address[2:0])
            3'd0: system_data <= {23'd0, fresh, first};
            3'd1: system_data <= {30'd0, permit_2, can_send};
            3'd2: system_data <= {16'd0, line_number};
            3'd3: system_data <= swaps;
            3'd4: system_data <= {16'd0, z_line_number};
            default: system_data <= z_swaps;
        endcase

    // The sequencer on the bus. The interlock is in the way of the commit itself, whatever the firmware thinks of it.
    wire host_write, writable, refused, host_commit, withdraw, committed, arm, trigger, park, clear_faults;
    wire armed, running, busy, missed, can_keep, committing, starting;
    wire [1:0] commit_mode;
    wire [2:0] region;
    wire [15:0] word_address, arm_frames;
    wire [31:0] word;
    wire [3:0] faults;
    wire [4*COUNT_BITS-1:0] fault_counts;
    dac_wishbone #(
        .DAC_BITS(SCAN_X_DAC_BITS), .COUNT_BITS(COUNT_BITS), .SHAPING(SCAN_SHAPING),
        .X_INTERPOLATED(SCAN_X_INTERPOLATED), .X_INDEX_BITS(SCAN_X_INDEX_BITS),
        .X_WORD_BITS(SCAN_X_TABLE_BITS), .Y_INTERPOLATED(SCAN_Y_INTERPOLATED),
        .Y_INDEX_BITS(SCAN_Y_INDEX_BITS), .Y_WORD_BITS(SCAN_Y_TABLE_BITS), .COMMIT_MODES(1),
        .SLOW_PART(SCAN_SLOW_PART), .SLOW_INDEX_BITS(SCAN_SLOW_INDEX_BITS)
    ) registers (
        .clock(clock), .reset(reset), .wb_cyc_i(xy_access), .wb_stb_i(xy_access), .wb_we_i(write),
        .wb_adr_i(address[17:0]), .wb_sel_i(d_bytes), .wb_dat_i(d_data), .wb_dat_o(xy_read), .wb_ack_o(xy_done),
        .wb_err_o(xy_failed), .irq(),
        .write(host_write), .write_region(region), .write_address(word_address), .write_data(word),
        .writable(writable && !committing), .refused(refused), .commit(host_commit), .commit_mode(commit_mode),
        .withdraw(withdraw), .committed(committed || committing), .can_keep(can_keep), .booting(1'b0), .missing(1'b0),
        .arm(arm), .arm_frames(arm_frames), .trigger(trigger), .park(park), .clear_faults(clear_faults), .armed(armed),
        .running(running || starting), .busy(busy), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );

    // What the sequencer gets of these requests, and when. With z that is a matter of both.
    wire tick, commits, withdraws, starts, parks;
    wire z_strobe, z_image, z_fault;
    wire update = SCAN_Z != 0 ? z_strobe : strobe;  // of all converters
    reg [1:0] last_mode;  // of a commit that waits for z
    always @(posedge clock) if (host_commit) last_mode <= commit_mode;
    wire [1:0] mode = host_commit || SCAN_Z == 0 ? commit_mode : last_mode;
    generate
        if (SCAN_Z != 0) begin : with_z
            soft_core_z #(.CLOCKS_PER_TICK(CLOCKS_PER_TICK), .COUNT_BITS(COUNT_BITS)) z (
                .clock(clock), .reset(reset), .permit(permit_2), .access(z_access), .write(write),
                .address(address[17:0]), .bytes(d_bytes), .data(d_data), .read_data(z_read), .done(z_done),
                .failed(z_failed), .commit(host_commit), .withdraw(withdraw), .trigger(trigger), .park(park),
                .xy_commits(commits), .xy_withdraws(withdraws), .xy_starts(starts), .xy_parks(parks),
                .writable(writable), .committed(committed), .armed(armed), .running(running), .strobe(strobe),
                .playing(playing), .markers({swapped, xy_backward, xy_pixel, xy_frame, xy_line}),
                .committing(committing), .starting(starting), .tick(tick), .z_strobe(z_strobe), .z_data(z_data),
                .line_number(z_line_number), .swaps(z_swaps), .image(z_image), .fault(z_fault)
            );
            reg [4:0] shown;  // with the converters, for which z is the last one
            initial shown = 5'd0;
            always @(posedge clock)
                if (z_strobe) shown <= {xy_image && z_image, xy_backward, xy_pixel, xy_frame, xy_line};
            assign {image, backward, pixel, frame, line} = shown;
        end else begin : without_z
            reg [$clog2(CLOCKS_PER_TICK)-1:0] divider;
            initial divider = 0;
            assign tick = divider == CLOCKS_PER_TICK - 1;
            always @(posedge clock) divider <= tick ? 0 : divider + 1'b1;
            assign {commits, withdraws, starts, parks} = {host_commit && permit_2, withdraw, trigger, park};
            assign {z_done, z_failed, z_read, z_strobe, z_fault, committing, starting} = 38'd0;
            assign {z_data, z_line_number, z_swaps, z_image} = 50'd0;
            assign {image, backward, pixel, frame, line} = {xy_image, xy_backward, xy_pixel, xy_frame, xy_line};
        end
    endgenerate

    wire [SCAN_X_DAC_BITS-1:0] x_code, y_code;
    dac_sequencer #(
        .DAC_BITS(SCAN_X_DAC_BITS), .COUNT_BITS(COUNT_BITS), .SHAPING(SCAN_SHAPING),
        .X_INTERPOLATED(SCAN_X_INTERPOLATED), .X_INDEX_BITS(SCAN_X_INDEX_BITS),
        .X_WORD_BITS(SCAN_X_TABLE_BITS), .Y_INTERPOLATED(SCAN_Y_INTERPOLATED),
        .Y_INDEX_BITS(SCAN_Y_INDEX_BITS), .Y_WORD_BITS(SCAN_Y_TABLE_BITS), .LOW_AREA(1),
        .COMMIT_MODES(1), .SLOW_PART(SCAN_SLOW_PART), .SLOW_INDEX_BITS(SCAN_SLOW_INDEX_BITS)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(host_write), .write_region(region), .write_address(word_address),
        .write_data(word), .writable(writable), .refused(refused), .commit(commits),
        .commit_mode(mode), .withdraw(withdraws), .committed(committed), .can_keep(can_keep), .arm(arm),
        .arm_frames(arm_frames), .trigger(starts), .park(parks), .clear_faults(clear_faults), .armed(armed),
        .running(running), .tick(tick), .underrun(missed), .busy(busy), .strobe(strobe), .x_code(x_code),
        .y_code(y_code), .line_marker(xy_line), .frame_marker(xy_frame), .pixel_marker(xy_pixel),
        .backward_marker(xy_backward), .valid_marker(xy_image), .swapped_marker(swapped), .playing(playing),
        .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );

    wire [15:0] x_word, y_word;
    dac_coding #(
        .BITS(SCAN_X_DAC_BITS), .WORD_BITS(SCAN_X_DAC_WORD_BITS),
        .TWOS_COMPLEMENT(SCAN_X_DAC_TWOS_COMPLEMENT), .LEFT_ALIGNED(SCAN_X_DAC_LEFT_ALIGNED)
    ) x_coding (.code(x_code), .word(x_word));
    dac_coding #(
        .BITS(SCAN_Y_DAC_BITS), .WORD_BITS(SCAN_Y_DAC_WORD_BITS),
        .TWOS_COMPLEMENT(SCAN_Y_DAC_TWOS_COMPLEMENT), .LEFT_ALIGNED(SCAN_Y_DAC_LEFT_ALIGNED)
    ) y_coding (.code(y_code), .word(y_word));
    dac_spi #(.WORD_BITS(16), .FRAME_BITS(16)) converters (
        .clock(clock), .reset(1'b0), .strobe(update), .x_word(x_word), .y_word(y_word), .sclk(sclk), .cs_x_n(select_n),
        .cs_y_n(), .mosi_x(x_data), .mosi_y(y_data), .ldac_n(load_n), .busy(), .missed(missed)
    );

    assign fault = faults != 4'd0 || refused || z_fault;

    // What this device plays. The reason of a refusal is the name of a module that does not exist.
    localparam CUBIC = SCAN_X_INTERPOLATED == 3 || SCAN_Y_INTERPOLATED == 3;
    localparam STRAIGHT_CLOCKS = (CUBIC ? 90 : 41) + (SCAN_SHAPING != 0 ? 2 : 0);
    localparam CLOCKS = SCAN_SLOW_PART != 0 ? SCAN_CLOCKS : STRAIGHT_CLOCKS;
    generate
        if (SCAN_X_DAC_WORD_BITS != 16 || SCAN_Y_DAC_WORD_BITS != 16) begin : guard_0
            soft_core_serves_converters_with_words_of_16_bits stop ();
        end
        if (SCAN_X_DAC_BITS != SCAN_Y_DAC_BITS) begin : guard_1
            soft_core_serves_converters_of_the_same_bits stop ();
        end
        if (SCAN_PIXEL_INDEX_BITS != 0) begin : guard_2
            soft_core_plays_no_table_of_pixels stop ();
        end
        if (CLOCKS_PER_TICK < CLOCKS) begin : guard_3
            soft_core_CLOCKS_PER_TICK_is_less_than_the_sequencer_takes stop ();
        end
    endgenerate
endmodule

`default_nettype wire
