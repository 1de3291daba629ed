// Keeps the sequencer of z on the ticks of that of x and y, whose registers are on the same bus.
//
//   requests  A write to both windows of registers gives a request of both on one clock. One of x and y alone is for a
//             scan without z: z then stays as it is.
//   commit    z has a slow part, and works a line out before its program can be taken. Without a slow part x and y get
//             their commit when that of z can be taken, and no tick comes between. With one they get it on the same
//             clock: both work out the same line, which is ready before the line that plays ends. Where no scan plays,
//             no tick comes between either. A commit that one of them refuses is withdrawn from both.
//   trigger   x and y start when z runs, and no tick comes between.
//   tick      is `due` unless it has to wait; the next one is CLOCKS_PER_TICK after it, not earlier.
//   apart     is high for a clock where their markers differ while they play together, or where one of them runs and
//             the other one never will: both are then parked.
//
// The strobe of z comes after that of x and y, or with it.

`default_nettype none

module soft_core_both #(
    parameter CLOCKS_PER_TICK = 100,
    parameter SLOW_PART = 0,         // that of x and y
    parameter MARKERS = 6            // bits that are the same of both
) (
    input  wire               clock,
    input  wire               permit,
    // requests to x and y, and to z
    input  wire               commit,
    input  wire               z_commit,
    input  wire               withdraw,
    input  wire               z_withdraw,
    input  wire               trigger,
    input  wire               z_trigger,
    input  wire               park,
    input  wire               z_park,
    // what they get
    output wire               xy_commits,
    output wire               z_commits,
    output wire               xy_withdraws,
    output wire               z_withdraws,
    output wire               xy_starts,
    output wire               z_starts,
    output wire               xy_parks,
    output wire               z_parks,
    // what they are
    input  wire               writable,
    input  wire               z_writable,
    input  wire               committed,
    input  wire               z_committed,
    input  wire               armed,
    input  wire               running,
    input  wire               z_running,
    input  wire               strobe,
    input  wire               z_strobe,
    input  wire               playing,
    input  wire               z_playing,
    input  wire [MARKERS-1:0] markers,
    input  wire [MARKERS-1:0] z_markers,
    // for the registers
    output wire               committing,  // a commit of both is under way
    output reg                starting,    // a trigger waits for its line
    output reg                apart,
    output wire               tick
);
    localparam [2:0] SETTLING = 3'd7;  // clocks until a commit is committed, under way or refused
    localparam [31:0] LAST = CLOCKS_PER_TICK - 1;
    localparam DIVIDER_BITS = $clog2(CLOCKS_PER_TICK);
    wire unused = &LAST;

    // A commit of both, from its request until both have it.
    reg joint, handed;  // x and y have got it
    reg [2:0] settling;
    initial {joint, handed, settling} = 5'd0;
    wire of_both = commit && z_commit && permit;
    wire hand = joint && !handed && z_committed;
    wire failed = joint && settling == 3'd0 && (z_writable || (handed && writable));
    wire ended = (committed && z_committed) || withdraw || z_withdraw || failed;
    always @(posedge clock) begin
        joint <= of_both || (joint && !ended);
        handed <= of_both ? SLOW_PART != 0 : handed || hand;
        settling <= of_both || hand ? SETTLING : settling != 3'd0 ? settling - 3'd1 : 3'd0;
    end
    assign xy_commits = (commit && permit && (SLOW_PART != 0 || !z_commit)) || hand;
    assign z_commits = z_commit && permit;
    assign xy_withdraws = withdraw || failed;
    assign z_withdraws = z_withdraw || failed;
    assign committing = joint;

    // z plays with x and y from a trigger of both on, and alone never.
    reg together;
    initial together = 1'b0;
    wire parks;  // both
    always @(posedge clock) together <= (trigger ? z_trigger : together) && !(xy_parks && z_parks);
    wire alone = together && z_running && !running;
    assign xy_starts = (trigger && !z_trigger) || alone;
    assign z_starts = z_trigger;
    assign xy_parks = park || parks;
    assign z_parks = z_park || parks;
    initial starting = 1'b0;
    always @(posedge clock) starting <= ((trigger && armed) || starting) && !running && !xy_parks;

    // Ticks wait while one of them has a program or runs, and the other one will soon.
    wire plays_on = running && playing;
    wire waits = alone || (joint && committed != z_committed && (SLOW_PART == 0 || !plays_on));
    reg [DIVIDER_BITS-1:0] divider;
    initial divider = 0;
    wire due = divider == LAST[DIVIDER_BITS-1:0];
    assign tick = due && !waits;
    always @(posedge clock) divider <= tick ? {DIVIDER_BITS{1'b0}} : due ? divider : divider + 1'b1;

    // Their markers of a tick.
    reg [MARKERS:0] xy_last;
    initial xy_last = 0;
    wire [MARKERS:0] xy_now = strobe ? {playing, markers} : xy_last;
    wire [MARKERS:0] z_now = {z_playing, z_markers};
    always @(posedge clock) if (strobe) xy_last <= {playing, markers};
    wire differ = z_strobe && xy_now != z_now && (xy_now[MARKERS] || z_playing);
    wire lost = (alone && !armed) || (running && !z_running);
    initial apart = 1'b0;
    always @(posedge clock) apart <= together && (differ || lost) && !apart;
    assign parks = apart;
endmodule

`default_nettype wire
