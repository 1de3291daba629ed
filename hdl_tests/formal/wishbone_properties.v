// dac_wishbone against the rules of classic cycles, whatever its sequencer does: a termination is one clock long, comes
// only in a cycle that has been held since its access began, and is that of the access that the master still asks for;
// the host port is used for no word or commit while it is not writable.
//
// Assumed of the master: it holds address and direction until a cycle is terminated or given up.

`default_nettype none

module wishbone_properties (
    input wire        clock,
    input wire        reset,
    input wire        cyc,
    input wire        stb,
    input wire        we,
    input wire [19:2] adr,
    input wire [3:0]  sel,
    input wire [31:0] dat,
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
    wire ack, err, write, commit, withdraw, arm, trigger, park, clear_faults;
    wire [31:0] read;
    wire [1:0] commit_mode;
    dac_wishbone #(.COUNT_BITS(4), .FOURIER(1), .COMMIT_MODES(1), .PIXEL_INDEX_BITS(4)) bus (
        .clock(clock), .reset(reset), .wb_cyc_i(cyc), .wb_stb_i(stb), .wb_we_i(we), .wb_adr_i(adr), .wb_sel_i(sel),
        .wb_dat_i(dat), .wb_dat_o(read), .wb_ack_o(ack), .wb_err_o(err),
        .irq(), .write(write), .write_region(), .write_address(), .write_data(), .writable(writable),
        .refused(refused), .commit(commit), .commit_mode(commit_mode),
        .withdraw(withdraw), .committed(committed), .can_keep(can_keep), .booting(booting),
        .missing(missing), .arm(arm), .arm_frames(), .trigger(trigger), .park(park), .clear_faults(clear_faults),
        .armed(armed), .running(running), .busy(busy), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );
    wire acts = write || commit || withdraw || arm || trigger || park || clear_faults;  // at the host port

    // The clocks before, back to the last termination.
    wire cycle = cyc && stb, ended = ack || err;
    reg held, held_longer, was_reset, was_ended, we_was;
    reg [19:2] adr_was;
    initial begin
        held = 0;
        held_longer = 0;
        was_reset = 0;
        was_ended = 0;
    end
    always @(posedge clock) begin
        held <= cycle && !ended && !reset;
        held_longer <= held && cycle && !ended && !reset;
        was_reset <= reset;
        was_ended <= ended;
        we_was <= we;
        adr_was <= adr;
    end
    always @* if (held && cycle) assume (we == we_was && adr == adr_was);

    // The properties.
    wire bus__works, bus__waits;
    wire bus__registers__acts, bus__registers__held, bus__registers__done, bus__registers__is_write;
    wire [2:0] bus__registers__settling;
    wire [19:0] bus__registers__address;
    always @* begin
        if (ended) assert (cycle && held_longer && !was_ended);
        if (was_reset) assert (!ended);
        assert (!(ack && err));
        if (ended) assert (bus__registers__is_write == we && bus__registers__address[19:2] == adr);
        if (write || commit) assert (writable);
        if (commit) assert (commit_mode != 2'd3);
        if (acts) assert (!bus__registers__done);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive.
    always @* begin
        assert (bus__works == (bus__registers__acts || bus__registers__held || bus__registers__done));
        assert (bus__registers__acts + bus__registers__held + bus__registers__done <= 1);
        assert (!bus__registers__held || (bus__registers__settling != 0 && bus__registers__settling != 7));
        assert (!bus__waits || (bus__works && held));
        assert (!bus__waits || bus__registers__acts || held_longer);
        if (bus__waits) assert (bus__registers__is_write == we_was && bus__registers__address[19:2] == adr_was);
    end
`endif
endmodule

`default_nettype wire
