// Decides which bank plays, and whether the other one may be written.
//
// A commit says that the idle program is complete. The idle bank is then locked until the scan has taken the program at
// the start of a line and the last sample of the old program has left the pipeline (`drained`), or until a withdrawal.

`default_nettype none

module dac_bank (
    input  wire clock,
    input  wire reset,      // empties the idle bank
    input  wire commit,
    input  wire withdraw,   // discards a committed program that was not taken yet
    input  wire take,       // the tick of this clock is the first of the committed program
    input  wire drained,    // the pipeline holds no sample of the old program
    output reg  bank,       // the bank that plays
    output reg  committed,
    output reg  loaded,     // the bank that plays holds a program
    output wire writable    // the idle bank may be written
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
