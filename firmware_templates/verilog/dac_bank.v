// Which bank plays, and whether the other one may be written: the commit of a new program, and its taking.
//
// A commit says that the idle program is complete. From then on nobody writes it, until the scan takes it at the start
// of a line and the last sample of the old program has left the pipeline (`drained`), or it is withdrawn.

`default_nettype none

module dac_bank (
    input  wire clock,
    input  wire reset,      // empties the idle bank
    input  wire commit,
    input  wire withdraw,   // a committed program that was not taken yet is not to be played
    input  wire take,       // the tick of this clock is the first of the committed program
    input  wire drained,    // no sample of the old program is on its way any more
    output reg  bank,       // that plays, from the tick that took it
    output reg  committed,
    output reg  loaded,     // there is a program
    output wire writable    // the idle one
);
    reg draining;

    assign writable = !committed && !draining;

    initial begin
        bank = 1'b0;
        committed = 1'b0;
        loaded = 1'b0;
        draining = 1'b0;
    end

    always @(posedge clock) begin
        if (take) begin
            bank <= !bank;
            loaded <= 1'b1;
        end
        if (reset || withdraw || take)
            committed <= 1'b0;
        else if (commit && writable)
            committed <= 1'b1;
        if (take)
            draining <= 1'b1;
        else if (drained)
            draining <= 1'b0;
    end
endmodule

`default_nettype wire
