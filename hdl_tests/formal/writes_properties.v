// The writes of the sequencer with a renderer, pipelined or in low area: none meets a program that plays, waits or is
// on its way, and none of the host's meets a rendering.
//
// The host may do anything on any clock. The axes and the renderer are those beside this file.

`default_nettype none

module writes_properties
`include "sequencer_under_test.vh"

    wire uut__take, uut__bank, uut__host_write, uut__host_commit, uut__rendering, uut__rendered;
    wire uut__x_table_write, uut__y_table_write, uut__x_write, uut__y_write, uut__scan_write, uut__banks__draining;
    wire table_write = uut__x_table_write || uut__y_table_write;
    wire register_write = uut__x_write || uut__y_write || uut__scan_write;
    always @* begin
        if (table_write || register_write) assert (!committed && !uut__banks__draining && !uut__take);
        if (uut__host_write) assert (!uut__rendering);
        if (uut__take) assert (tick && !busy && committed);
    end

    // Not vacuous: programs are taken while others play; with a renderer, words come from it.
    reg played;
    initial played = 0;
    always @(posedge clock) played <= played || (strobe && playing);
    always @* cover (played && uut__take && running);
    always @* cover (table_write && uut__rendering);

    // What makes it inductive.
    always @* begin
        assert (!committed || !uut__banks__draining);
        if (uut__rendering || uut__host_commit || uut__host_write) assert (!committed && !uut__banks__draining);
        if (uut__host_commit) assert (!uut__rendering);
        assert (!uut__rendered || uut__rendering);
        assert (!register_write || uut__host_write);
    end
    // The renderer works only between a commit of the host and that of the banks.
    wire uut__fourier__render__busy, uut__fourier__render__start, uut__fourier__render__write;
    always @* begin
        if (uut__fourier__render__busy || uut__fourier__render__start) assert (uut__rendering && !uut__rendered);
        if (uut__fourier__render__write) assert (uut__fourier__render__busy);
        if (uut__fourier__render__start) assert (!uut__fourier__render__busy);
    end
    // In the pipeline the load of a program is the one that the banks wait for.
    reg [22:0] loads;
    initial loads = 0;
    always @(posedge clock) loads <= {loads[21:0], uut__take};
    always @* if (!LOW_AREA) begin
        assert (uut__banks__draining == (loads != 0));
        assert ((loads & (loads - 1)) == 0);
    end
endmodule

`default_nettype wire
