`default_nettype none
`timescale 1ns / 1ps

// dac_axi_lite, or dac_wishbone with WISHBONE = 1, in front of a dac_sequencer; the master is in Python.
//
// host.txt gets a line for each clock on which the host port is used: "w REGION ADDRESS DATA", "a FRAMES" for arm, or
// "r", the bits clear_faults, park, trigger, withdraw, commit, and the mode of a commit. ticks.txt gets a line for each strobe: codes and
// markers. rules.txt gets a line for each broken rule of the bus or the host port.
module bus_bench #(
    parameter WISHBONE = 0,
    parameter ADDRESS_BITS = 32,
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 5,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 5,
    parameter Y_WORD_BITS = 16,
    parameter TICK_BITS = 9,
    parameter LINE_BITS = 4,
    parameter COUNT_BITS = 5,
    parameter FOURIER = 1,
    parameter HARMONICS = 5,
    parameter SINE_FILE = "",
    parameter SHAPING = 0,
    parameter COMMIT_MODES = 1,
    parameter PIXEL_INDEX_BITS = 4,
    parameter SLOW_PART = 0,
    parameter SLOW_INDEX_BITS = 5
);
    `include "dac_registers.vh"

    reg clock = 1'b0, reset = 1'b1, tick = 1'b0, underrun = 1'b0;
    always #5 clock = !clock;

    reg [ADDRESS_BITS-1:0] s_axi_awaddr = 0, s_axi_araddr = 0;
    reg [2:0] s_axi_awprot = 0, s_axi_arprot = 0;
    reg [31:0] s_axi_wdata = 0;
    reg [3:0] s_axi_wstrb = 0;
    reg s_axi_awvalid = 0, s_axi_wvalid = 0, s_axi_bready = 0, s_axi_arvalid = 0, s_axi_rready = 0;
    wire s_axi_awready, s_axi_wready, s_axi_bvalid, s_axi_arready, s_axi_rvalid;
    wire [1:0] s_axi_bresp, s_axi_rresp;
    wire [31:0] s_axi_rdata;

    reg wb_cyc_i = 0, wb_stb_i = 0, wb_we_i = 0;
    reg [ADDRESS_BITS-1:2] wb_adr_i = 0;
    reg [3:0] wb_sel_i = 0;
    reg [31:0] wb_dat_i = 0;
    wire [31:0] wb_dat_o;
    wire wb_ack_o, wb_err_o;

    wire irq, write, writable, refused, commit, withdraw, committed, arm, trigger, park, clear_faults;
    wire armed, running, busy, strobe, line, frame, pixel, backward, valid, swapped, playing, parked;
    wire can_keep;
    wire [1:0] mode;
    wire [2:0] region;
    wire [15:0] address, frames;
    wire [31:0] data;
    wire [3:0] faults;
    wire [4*COUNT_BITS-1:0] fault_counts;
    wire [DAC_BITS-1:0] x_code, y_code;

    generate
        if (WISHBONE) begin : wishbone
            dac_wishbone #(
                .ADDRESS_BITS(ADDRESS_BITS), .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED),
                .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS), .Y_INTERPOLATED(Y_INTERPOLATED),
                .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .COUNT_BITS(COUNT_BITS), .FOURIER(FOURIER),
                .HARMONICS(HARMONICS), .SHAPING(SHAPING), .COMMIT_MODES(COMMIT_MODES),
                .PIXEL_INDEX_BITS(PIXEL_INDEX_BITS), .SLOW_PART(SLOW_PART), .SLOW_INDEX_BITS(SLOW_INDEX_BITS)
            ) bus (
                .clock(clock), .reset(reset), .wb_cyc_i(wb_cyc_i), .wb_stb_i(wb_stb_i), .wb_we_i(wb_we_i),
                .wb_adr_i(wb_adr_i), .wb_sel_i(wb_sel_i), .wb_dat_i(wb_dat_i), .wb_dat_o(wb_dat_o),
                .wb_ack_o(wb_ack_o), .wb_err_o(wb_err_o), .irq(irq), .write(write), .write_region(region),
                .write_address(address), .write_data(data), .writable(writable), .refused(refused), .commit(commit),
                .withdraw(withdraw), .committed(committed), .can_keep(can_keep), .commit_mode(mode),
                .booting(1'b0), .missing(1'b0), .arm(arm),
                .arm_frames(frames), .trigger(trigger), .park(park), .clear_faults(clear_faults), .armed(armed),
                .running(running), .busy(busy), .playing(playing), .parked(parked), .faults(faults),
                .fault_counts(fault_counts)
            );
        end else begin : axi
            dac_axi_lite #(
                .ADDRESS_BITS(ADDRESS_BITS), .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED),
                .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS), .Y_INTERPOLATED(Y_INTERPOLATED),
                .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .COUNT_BITS(COUNT_BITS), .FOURIER(FOURIER),
                .HARMONICS(HARMONICS), .SHAPING(SHAPING), .COMMIT_MODES(COMMIT_MODES),
                .PIXEL_INDEX_BITS(PIXEL_INDEX_BITS), .SLOW_PART(SLOW_PART), .SLOW_INDEX_BITS(SLOW_INDEX_BITS)
            ) bus (
                .clock(clock), .reset(reset), .s_axi_awaddr(s_axi_awaddr), .s_axi_awprot(s_axi_awprot),
                .s_axi_awvalid(s_axi_awvalid), .s_axi_awready(s_axi_awready), .s_axi_wdata(s_axi_wdata),
                .s_axi_wstrb(s_axi_wstrb), .s_axi_wvalid(s_axi_wvalid), .s_axi_wready(s_axi_wready),
                .s_axi_bresp(s_axi_bresp), .s_axi_bvalid(s_axi_bvalid), .s_axi_bready(s_axi_bready),
                .s_axi_araddr(s_axi_araddr), .s_axi_arprot(s_axi_arprot), .s_axi_arvalid(s_axi_arvalid),
                .s_axi_arready(s_axi_arready), .s_axi_rdata(s_axi_rdata), .s_axi_rresp(s_axi_rresp),
                .s_axi_rvalid(s_axi_rvalid), .s_axi_rready(s_axi_rready), .irq(irq), .write(write),
                .write_region(region), .write_address(address), .write_data(data), .writable(writable),
                .refused(refused), .commit(commit), .withdraw(withdraw), .committed(committed), .can_keep(can_keep), .commit_mode(mode),
                .booting(1'b0),
                .missing(1'b0), .arm(arm), .arm_frames(frames), .trigger(trigger), .park(park),
                .clear_faults(clear_faults), .armed(armed), .running(running), .busy(busy), .playing(playing),
                .parked(parked), .faults(faults), .fault_counts(fault_counts)
            );
        end
    endgenerate

    dac_sequencer #(
        .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .TICK_BITS(TICK_BITS),
        .LINE_BITS(LINE_BITS), .COUNT_BITS(COUNT_BITS), .PLAIN_MULTIPLIER(SLOW_PART == 0),
        .LOW_AREA(SLOW_PART), .FOURIER(FOURIER), .HARMONICS(HARMONICS), .SINE_FILE(SINE_FILE), .SHAPING(SHAPING),
        .COMMIT_MODES(COMMIT_MODES), .PIXEL_INDEX_BITS(PIXEL_INDEX_BITS), .SLOW_PART(SLOW_PART),
        .SLOW_INDEX_BITS(SLOW_INDEX_BITS)
    ) sequencer (
        .clock(clock), .reset(1'b0), .write(write), .write_region(region), .write_address(address), .write_data(data),
        .writable(writable), .refused(refused), .commit(commit), .commit_mode(mode), .withdraw(withdraw),
        .committed(committed), .can_keep(can_keep), .arm(arm),
        .arm_frames(frames), .trigger(trigger), .park(park), .clear_faults(clear_faults), .armed(armed),
        .running(running), .tick(tick), .underrun(underrun), .busy(busy), .strobe(strobe), .x_code(x_code),
        .y_code(y_code), .line_marker(line), .frame_marker(frame), .pixel_marker(pixel), .backward_marker(backward),
        .valid_marker(valid), .swapped_marker(swapped), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );

    integer host, ticks, rules;
    initial begin
        host = $fopen("host.txt", "w");
        ticks = $fopen("ticks.txt", "w");
        rules = $fopen("rules.txt", "w");
    end
    always @(posedge clock) begin
        if (write) $fwrite(host, "w %0d %0d %0d\n", region, address, data);
        if (arm) $fwrite(host, "a %0d\n", frames);
        if (clear_faults || park || trigger || withdraw || commit)
            $fwrite(host, "r %b %0d\n", {clear_faults, park, trigger, withdraw, commit}, commit ? mode : 2'd0);
        if (strobe)
            $fwrite(ticks, "%0d %0d %b\n", x_code, y_code, {line, frame, pixel, backward, valid, swapped, playing,
                parked});
        $fflush(host);
        $fflush(ticks);
    end

    // The rules. What is sampled on an edge is compared with what was sampled on the one before.
    reg was_reset = 1'b1, b_waited = 1'b0, r_waited = 1'b0, was_ended = 1'b0;
    reg [1:0] b_was = 0;
    reg [33:0] r_was = 0;
    integer addresses = 0, words = 0, reads = 0, written = 0, answered = 0;
    wire ended = wb_ack_o || wb_err_o;
    always @(posedge clock) begin
        if ((write || commit) && !writable) $fwrite(rules, "a write or a commit while not writable\n");
        if (write + arm + commit > 1) $fwrite(rules, "two accesses at once\n");
        if (^{s_axi_bvalid, s_axi_rvalid, s_axi_awready, s_axi_wready, s_axi_arready} === 1'bx && !WISHBONE)
            $fwrite(rules, "an unknown valid or ready\n");
        if (^{wb_ack_o, wb_err_o} === 1'bx && WISHBONE) $fwrite(rules, "an unknown ack or err\n");
        if (was_reset && (s_axi_bvalid === 1'b1 || s_axi_rvalid === 1'b1)) $fwrite(rules, "valid after a reset\n");
        if (b_waited && !was_reset && (!s_axi_bvalid || s_axi_bresp != b_was))
            $fwrite(rules, "a response to a write has changed\n");
        if (r_waited && !was_reset && (!s_axi_rvalid || {s_axi_rresp, s_axi_rdata} != r_was))
            $fwrite(rules, "a response to a read has changed\n");
        if (s_axi_bvalid === 1'b1 && (written >= addresses || written >= words))
            $fwrite(rules, "a response before address and data of its write\n");
        if (s_axi_rvalid === 1'b1 && answered >= reads) $fwrite(rules, "a response before the address of its read\n");
        if (s_axi_rvalid === 1'b1 && s_axi_rresp != 0 && s_axi_rdata != 0) $fwrite(rules, "data of a failed read\n");
        if (s_axi_bvalid === 1'b1 && s_axi_bresp[0]) $fwrite(rules, "no response of AXI4-Lite\n");
        if (ended === 1'b1 && !(wb_cyc_i && wb_stb_i)) $fwrite(rules, "a termination without a cycle\n");
        if (wb_ack_o === 1'b1 && wb_err_o === 1'b1) $fwrite(rules, "ack with err\n");
        if (ended === 1'b1 && was_ended) $fwrite(rules, "a termination of two clocks\n");
        was_reset <= reset;
        b_waited <= s_axi_bvalid && !s_axi_bready;
        r_waited <= s_axi_rvalid && !s_axi_rready;
        b_was <= s_axi_bresp;
        r_was <= {s_axi_rresp, s_axi_rdata};
        was_ended <= ended === 1'b1;
        if (reset) begin
            addresses <= 0;
            words <= 0;
            reads <= 0;
            written <= 0;
            answered <= 0;
        end else begin
            addresses <= addresses + (s_axi_awvalid && s_axi_awready);
            words <= words + (s_axi_wvalid && s_axi_wready);
            reads <= reads + (s_axi_arvalid && s_axi_arready);
            written <= written + (s_axi_bvalid && s_axi_bready);
            answered <= answered + (s_axi_rvalid && s_axi_rready);
        end
        $fflush(rules);
    end

    // The constants of the header are those that the map has: a bench that reads them sees a wrong one.
    initial if (DAC_IDENTITY_ADDRESS != 0 || DAC_Y_TABLE_WORDS != 65536) $fwrite(rules, "a wrong header\n");
endmodule

`default_nettype wire
