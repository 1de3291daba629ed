// Both axes by turns in the sequencer: no word of a program is written from the load of a new one until its last word
// is read, and no word of a table whose bank is read; a program is loaded by a clock of x, and not before the last one
// has all of its words. A strobe comes 48 clocks after its tick, with `playing` exactly where the scan ran at that
// tick, and `busy` is high on the clock after a tick alone.
//
// The host may do anything on any clock. pair_program_properties has the words.
//
// `pair` is `uut.alternating.axes`
// `with_tick` is `uut.alternating.with_tick`
// `alternating` is `uut.alternating`

`default_nettype none

module pair_play_properties
`include "sequencer_under_test.vh"

    localparam LATENCY = 48, FLAGS_AT = 46;

    wire uut__take, uut__bank, uut__tick_0, uut__load_0, uut__runs_0;
    wire uut__x_write, uut__y_write, uut__x_table_write, uut__y_table_write, uut__banks__draining;
    wire [5:0] alternating__at;
    wire pair__begins, pair__waits, pair__tick_load, pair__read_bank;
    wire [5:0] pair__idle__stage;
    wire beat = alternating__at[0];
    wire [5:0] stage = pair__idle__stage;  // of x in the pipeline, after a new program has begun
    wire load = pair__begins && (uut__tick_0 ? uut__load_0 : pair__tick_load);

    // a. Nothing is written that is read.
    reg read_bank_1;
    initial read_bank_1 = 0;
    always @(posedge clock) read_bank_1 <= pair__read_bank;
    always @* begin
        if (uut__x_write || uut__y_write) assert (stage > 38 && !load);
        if (uut__x_table_write || uut__y_table_write) assert (pair__read_bank == uut__bank && read_bank_1 == uut__bank);
        if (load) assert (stage > 38);
    end

    // b. What comes out of the ports.
    reg [LATENCY-1:0] ticks, ran;
    initial begin
        ticks = 0;
        ran = 0;
    end
    always @(posedge clock) begin
        ticks <= {ticks[LATENCY-2:0], tick && !busy};
        ran <= {ran[LATENCY-2:0], tick && !busy && running};
    end
    always @* begin
        assert (strobe == ticks[LATENCY-1]);
        assert (busy == ticks[0]);
        if (strobe) assert (playing == ran[LATENCY-1]);
    end
    // Not vacuous: a program is taken while another one plays.
    always @* cover (load && strobe && playing);

`ifndef PROPERTIES_ALONE
    // What makes it inductive: where a new program is, and the words in their memory.
    reg [FLAGS_AT:1] loads;  // bit k: load_0 k clocks ago
    initial loads = 0;
    always @(posedge clock) loads <= {loads[FLAGS_AT-1:1], uut__load_0};
    wire pending = uut__load_0 || (loads[1] && pair__waits);
    wire [8:0] pair__with_phase__some__line;
    wire pair__tick_bank, pair__y_bank;
    wire uut__host_write, uut__host_commit;
    wire [5*FLAGS_AT-1:0] with_tick__line;

    integer k;
    always @* begin
        assert (!committed || !uut__banks__draining);
        assert (uut__banks__draining == (uut__load_0 || loads != 0));
        assert (uut__load_0 ? loads == 0 : (loads & (loads - 1)) == 0);
        assert (!uut__host_commit || !committed);
        assert (!(uut__host_commit || uut__host_write) || !uut__banks__draining);
        // The stage.
        if (stage != 63) assert (beat != stage[0]);
        for (k = 1; k <= FLAGS_AT; k = k + 1)
            if (loads[k] && !pending) assert (stage + 1 == k || (stage + 2 == k));
        if (pending) assert (stage == 63 || stage > 44);
        if (loads == 0 && !uut__load_0) assert (stage > 44);
        if (pair__waits) assert (!beat && ticks[1]);
        if (uut__load_0) assert (uut__tick_0);
        if (loads[1] && pair__waits) assert (pair__tick_load);
        if (pair__waits && !loads[1]) assert (!pair__tick_load);
        assert (uut__tick_0 == ticks[0]);
        // The bank.
        if (!uut__load_0) assert (pair__tick_bank == uut__bank);
        if (!pending && stage >= 1) assert (pair__y_bank == uut__bank);
        if (!pending) for (k = 0; k < 9; k = k + 1)
            if (stage >= k + 1) assert (pair__with_phase__some__line[k] == uut__bank);
        // The flags on their way.
        for (k = 0; k < FLAGS_AT; k = k + 1) begin
            assert (with_tick__line[5*k+4] == ticks[k+1]);
            if (ticks[k+1]) assert (with_tick__line[5*k+3] == ran[k+1]);
            assert (with_tick__line[5*k+1] == loads[k+1]);
        end
        if (ticks[0]) assert (uut__runs_0 == ran[0]);
    end
`endif
endmodule

`default_nettype wire
