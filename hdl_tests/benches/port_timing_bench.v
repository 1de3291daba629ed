`default_nettype none

// Bench of the timing diagrams of ports: an entry a clock from stimulus.hex, {5'd0, delayed, pin, ready, wishbone_read,
// wishbone_write, axi_read, axi_write, address[19:0], data[31:0]}. A bit of an access begins it; the bench holds it
// until it is taken. Prints what is seen on each clock, the highest bit first.
module port_timing_bench;
    parameter DEPTH = 1;
    reg [63:0] stimulus [0:DEPTH-1];
    reg [63:0] now;
    reg clock;
    integer i;

    reg axi_write, axi_data, axi_read, cycle, writes;
    reg [3:0] kept;
    reg [19:0] written_address, read_address, cycle_address;
    reg [31:0] written_data, cycle_data;
    initial {axi_write, axi_data, axi_read, cycle, writes} = 5'd0;
    wire aw_ready, w_ready, b_valid, ar_ready, r_valid, ack, err;
    wire [1:0] b_response, r_response;
    wire axi_host_write, axi_commit, axi_trigger, host_write, commit;

    dac_axi_lite axi (
        .clock(clock), .reset(1'b0), .s_axi_awaddr(written_address), .s_axi_awprot(3'd0), .s_axi_awvalid(axi_write),
        .s_axi_awready(aw_ready), .s_axi_wdata(written_data), .s_axi_wstrb(4'd15), .s_axi_wvalid(axi_data),
        .s_axi_wready(w_ready), .s_axi_bresp(b_response), .s_axi_bvalid(b_valid), .s_axi_bready(now[56]),
        .s_axi_araddr(read_address), .s_axi_arprot(3'd0), .s_axi_arvalid(axi_read), .s_axi_arready(ar_ready),
        .s_axi_rdata(), .s_axi_rresp(r_response), .s_axi_rvalid(r_valid), .s_axi_rready(now[56]), .irq(),
        .write(axi_host_write), .write_region(), .write_address(), .write_data(), .writable(1'b1), .refused(1'b0),
        .commit(axi_commit), .commit_mode(), .withdraw(), .committed(1'b0), .can_keep(1'b0), .booting(1'b0),
        .missing(1'b0), .arm(), .arm_frames(),
        .trigger(axi_trigger), .park(), .clear_faults(), .armed(1'b0), .running(1'b0), .busy(1'b0), .playing(1'b0),
        .parked(1'b1), .faults(4'd0), .fault_counts(64'd0)
    );
    dac_wishbone wishbone (
        .clock(clock), .reset(1'b0), .wb_cyc_i(cycle), .wb_stb_i(cycle), .wb_we_i(writes),
        .wb_adr_i(cycle_address[19:2]), .wb_sel_i(4'd15), .wb_dat_i(cycle_data), .wb_dat_o(), .wb_ack_o(ack),
        .wb_err_o(err), .irq(), .write(host_write), .write_region(), .write_address(), .write_data(),
        .writable(1'b1), .refused(1'b0), .commit(commit), .commit_mode(), .withdraw(), .committed(1'b0),
        .can_keep(1'b0), .booting(1'b0),
        .missing(1'b0), .arm(), .arm_frames(), .trigger(), .park(), .clear_faults(), .armed(1'b0), .running(1'b0),
        .busy(1'b0), .playing(1'b0), .parked(1'b1), .faults(4'd0), .fault_counts(64'd0)
    );

    wire level, rise, change;
    dac_synchronise level_synchroniser (.clock(clock), .in(now[57]), .out(level));
    dac_synchronise #(.PULSE(1)) rise_synchroniser (.clock(clock), .in(now[57]), .out(rise));
    dac_synchronise #(.PULSE(2)) change_synchroniser (.clock(clock), .in(now[57]), .out(change));

    wire [2:0] delayed;
    dac_marker_delay #(.SIGNALS(3)) delay (
        .clock(clock), .delays({8'd7, 8'd1, 8'd0}), .in({3{now[58]}}), .out(delayed)
    );

    initial begin
        $readmemh("stimulus.hex", stimulus);
        clock = 0;
        for (i = 0; i < DEPTH; i = i + 1) begin
            now = stimulus[i];
            if (now[52]) {axi_write, axi_data, written_address, written_data} = {2'b11, now[51:0]};
            if (now[53]) {axi_read, read_address} = {1'b1, now[51:32]};
            if (now[54] || now[55]) {cycle, writes, cycle_address, cycle_data} = {1'b1, now[54], now[51:0]};
            #1 $display("%b", {axi_write, aw_ready, axi_data, w_ready, b_valid, b_response[1], axi_read, ar_ready,
                               r_valid, r_response[1], axi_host_write, axi_commit, axi_trigger, cycle, writes, ack,
                               err, host_write, commit, level, rise, change, delayed});
            kept = {axi_write && !aw_ready, axi_data && !w_ready, axi_read && !ar_ready, cycle && !ack && !err};
            #1 clock = 1;
            #1 clock = 0;
            {axi_write, axi_data, axi_read, cycle} = kept;
        end
        $finish;
    end
endmodule

`default_nettype wire
