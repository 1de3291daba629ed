// dac_axi_lite against the rules of AXI4-Lite, whatever its master and its sequencer do: a response stays as it is until
// it is taken, none comes before its request, and none after a reset; the host port is used for an accepted write alone,
// and for no word or commit while it is not writable.

`default_nettype none

module axi_properties (
    input wire        clock,
    input wire        reset,
    input wire [19:0] awaddr,
    input wire        awvalid,
    input wire [31:0] wdata,
    input wire [3:0]  wstrb,
    input wire        wvalid,
    input wire        bready,
    input wire [19:0] araddr,
    input wire        arvalid,
    input wire        rready,
    input wire        writable,
    input wire        refused,
    input wire        committed,
    input wire        can_keep,
    input wire        booting,
    input wire        missing,
    input wire        armed,
    input wire        running,
    input wire        busy,
    input wire        playing,
    input wire        parked,
    input wire [3:0]  faults,
    input wire [15:0] fault_counts
);
    wire awready, wready, bvalid, arready, rvalid, write, commit, withdraw, arm, trigger, park, clear_faults;
    wire [1:0] bresp, rresp;
    wire [31:0] rdata;
    wire [1:0] commit_mode;
    dac_axi_lite #(.COUNT_BITS(4), .FOURIER(1), .COMMIT_MODES(1), .PIXEL_INDEX_BITS(4)) bus (
        .clock(clock), .reset(reset), .s_axi_awaddr(awaddr), .s_axi_awprot(3'd0), .s_axi_awvalid(awvalid),
        .s_axi_awready(awready), .s_axi_wdata(wdata), .s_axi_wstrb(wstrb), .s_axi_wvalid(wvalid),
        .s_axi_wready(wready), .s_axi_bresp(bresp), .s_axi_bvalid(bvalid), .s_axi_bready(bready),
        .s_axi_araddr(araddr), .s_axi_arprot(3'd0), .s_axi_arvalid(arvalid), .s_axi_arready(arready),
        .s_axi_rdata(rdata), .s_axi_rresp(rresp), .s_axi_rvalid(rvalid), .s_axi_rready(rready),
        .irq(), .write(write), .write_region(), .write_address(), .write_data(), .writable(writable),
        .refused(refused), .commit(commit), .commit_mode(commit_mode),
        .withdraw(withdraw), .committed(committed), .can_keep(can_keep), .booting(booting),
        .missing(missing), .arm(arm), .arm_frames(), .trigger(trigger), .park(park), .clear_faults(clear_faults),
        .armed(armed), .running(running), .busy(busy), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );
    wire acts = write || commit || withdraw || arm || trigger || park || clear_faults;  // at the host port

    // Beats that were accepted and not answered yet, and what the clock before was like.
    reg [1:0] addresses, words, reads, b_was, r_was;
    reg [31:0] data_was;
    reg b_waited, r_waited, was_reset;
    initial begin
        addresses = 0;
        words = 0;
        reads = 0;
        b_waited = 0;
        r_waited = 0;
        was_reset = 0;
    end
    always @(posedge clock) begin
        addresses <= reset ? 0 : addresses + (awvalid && awready) - (bvalid && bready);
        words <= reset ? 0 : words + (wvalid && wready) - (bvalid && bready);
        reads <= reset ? 0 : reads + (arvalid && arready) - (rvalid && rready);
        b_waited <= bvalid && !bready && !reset;
        r_waited <= rvalid && !rready && !reset;
        was_reset <= reset;
        b_was <= bresp;
        r_was <= rresp;
        data_was <= rdata;
    end

    // The properties.
    always @* begin
        if (b_waited) assert (bvalid && bresp == b_was);
        if (r_waited) assert (rvalid && rresp == r_was && rdata == data_was);
        if (was_reset) assert (!bvalid && !rvalid);
        if (bvalid) assert (addresses != 0 && words != 0);
        if (rvalid) assert (reads != 0);
        if (rvalid && rresp != 0) assert (rdata == 0);
        assert (!bresp[0] && !rresp[0]);
        if (write || commit) assert (writable);
        if (commit) assert (commit_mode != 2'd3);
        if (acts) assert (addresses != 0 && words != 0 && !bvalid);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive: where each beat is, and that an access is under way in one place.
    wire bus__aw_kept, bus__w_kept, bus__ar_kept, bus__works, bus__writes;
    wire bus__registers__acts, bus__registers__held, bus__registers__done, bus__registers__is_write;
    wire bus__registers__failed;
    wire [2:0] bus__registers__settling;
    wire [31:0] bus__registers__read_data;
    wire writing = bus__works && bus__writes, reading = bus__works && !bus__writes;
    always @* begin
        assert (addresses == bus__aw_kept + writing + bvalid);
        assert (words == bus__w_kept + writing + bvalid);
        assert (reads == bus__ar_kept + reading + rvalid);
        assert (!(writing && bvalid) && !(reading && rvalid));
        assert (bus__works == (bus__registers__acts || bus__registers__held || bus__registers__done));
        assert (bus__registers__acts + bus__registers__held + bus__registers__done <= 1);
        assert (!bus__registers__held || (bus__registers__settling != 0 && bus__registers__settling != 7));
        assert (!bus__works || bus__registers__is_write == bus__writes);
        assert (!bus__registers__failed || bus__registers__read_data == 0);
        assert (rresp == 0 || rdata == 0);
    end
`endif
endmodule

`default_nettype wire
