// Bench of examples/firmware/soft_core/soft_core_both.v: two sequencers of dac_scan and dac_bank alone, and random
// requests on random clocks. APART gets a line for each tick on which their markers differ, and RESULT the ticks that
// were played, those that waited, the programs taken and the longest wait.
//
// z works its line out, for about as long as a line plays, before a program can be taken or a scan can start; so do x
// and y with SLOW_PART. With LOSES a request now and then reaches z alone: it is then parked with x and y.

`timescale 1ns / 1ps
`default_nettype none

module line_sequencer #(
    parameter SLOW_PART = 1,
    parameter WORK = 300    // clocks in which a line is worked out
) (
    input  wire       clock,
    input  wire       tick,
    input  wire       commit,
    input  wire [1:0] mode,
    input  wire       withdraw,
    input  wire       arm,
    input  wire       trigger,
    input  wire       park,
    output wire       writable,
    output wire       committed,
    output wire       armed,
    output wire       running,
    output wire       strobe,
    output wire       playing,
    output wire [2:0] markers,  // swapped, frame, line
    output wire       refused
);
    reg write = 1;
    reg [3:0] address = 0;
    initial begin
        repeat (2) @(posedge clock) address <= address + 1;
        write <= 0;
    end

    reg preparing = 0, begun = 0, waits = 0;
    reg [15:0] left = 0, ready_in = WORK;
    reg [1:0] how = 0;
    wire bank, loaded, take, due, load, runs, begins, line, frame, y_advance, tick_out, idle_writable, keeps;
    wire [7:0] tick_number;
    wire [3:0] line_number;
    wire can_work = !running || (tick_out && line && (how != 2 || line_number == 2));
    wire prepared = SLOW_PART != 0 ? preparing && begun && left == 0 : commit && writable && !withdraw;
    wire can_start = SLOW_PART == 0 || running || ready_in == 0;
    wire asks = (trigger && (arm || armed)) || waits;
    always @(posedge clock) begin
        if (commit && writable) how <= mode;
        preparing <= SLOW_PART != 0 && ((commit && writable) || preparing) && !withdraw && !prepared && !take;
        begun <= preparing && !withdraw && !prepared && (begun || can_work);
        left <= !begun ? WORK : left != 0 ? left - 1 : 0;
        ready_in <= running || take ? WORK : ready_in != 0 ? ready_in - 1 : 0;
        waits <= SLOW_PART != 0 && asks && !can_start && !park && (loaded || (committed && !withdraw));
    end
    dac_bank banks (
        .clock(clock), .reset(1'b0), .commit(prepared), .withdraw(withdraw), .take(take), .drained(tick_out),
        .bank(bank), .committed(committed), .loaded(loaded), .writable(idle_writable)
    );
    assign writable = idle_writable && !preparing;
    assign refused = commit && !writable;
    dac_scan #(.TICK_BITS(8), .LINE_BITS(4), .FRAME_BITS(16)) scan (
        .clock(clock), .reset(1'b0), .write(write), .write_address(address),
        .write_data(address == 0 ? 32'd12 : 32'd3), .tick(tick), .arm(arm), .arm_frames(16'd2),
        .trigger((trigger || waits) && can_start), .park(park), .committed(committed), .withdraw(withdraw),
        .keep(how == 1), .at_frame(how == 2), .loaded(loaded), .can_keep(keeps), .take(take), .armed(armed),
        .running(running), .due(due), .tick_out(tick_out), .load(load), .runs(runs), .begins(begins), .line(line),
        .frame(frame), .y_advance(y_advance), .tick_number(tick_number), .line_number(line_number)
    );
    assign strobe = tick_out;
    assign playing = runs;
    assign markers = {load, frame, line};
endmodule

module soft_core_both_bench #(
    parameter SLOW_PART = 0,
    parameter LOSES = 0,
    parameter SEED = 1,
    parameter CLOCKS = 20000,
    parameter APART = "apart.log",
    parameter RESULT = "result.log"
);
    localparam CLOCKS_PER_TICK = 8;
    reg clock = 0;
    always #5 clock = !clock;

    reg commit = 0, z_commit = 0, withdraw = 0, trigger = 0, z_trigger = 0, arm = 0, park = 0, z_park = 0;
    reg [1:0] mode = 0, last_mode = 0;
    wire xy_commits, z_commits, xy_withdraws, z_withdraws, xy_starts, z_starts, xy_parks, z_parks;
    wire writable, z_writable, committed, z_committed, armed, z_armed, running, z_running, strobe, z_strobe;
    wire playing, z_playing, committing, starting, apart, tick, refused, z_refused;
    wire [2:0] markers, z_markers;
    always @(posedge clock) if (commit) last_mode <= mode;
    soft_core_both #(.CLOCKS_PER_TICK(CLOCKS_PER_TICK), .SLOW_PART(SLOW_PART), .MARKERS(3)) both (
        .clock(clock), .permit(1'b1), .commit(commit), .z_commit(z_commit), .withdraw(withdraw),
        .z_withdraw(withdraw), .trigger(trigger), .z_trigger(z_trigger), .park(park), .z_park(z_park),
        .xy_commits(xy_commits), .z_commits(z_commits), .xy_withdraws(xy_withdraws), .z_withdraws(z_withdraws),
        .xy_starts(xy_starts), .z_starts(z_starts), .xy_parks(xy_parks), .z_parks(z_parks), .writable(writable),
        .z_writable(z_writable), .committed(committed), .z_committed(z_committed), .armed(armed), .running(running),
        .z_running(z_running), .strobe(strobe), .z_strobe(z_strobe), .playing(playing), .z_playing(z_playing),
        .markers(markers), .z_markers(z_markers), .committing(committing), .starting(starting), .apart(apart),
        .tick(tick)
    );
    line_sequencer #(.SLOW_PART(SLOW_PART), .WORK(70)) of_x_y (
        .clock(clock), .tick(tick), .commit(xy_commits), .mode(commit ? mode : last_mode), .withdraw(xy_withdraws),
        .arm(arm), .trigger(xy_starts), .park(xy_parks), .writable(writable), .committed(committed), .armed(armed),
        .running(running), .strobe(strobe), .playing(playing), .markers(markers), .refused(refused)
    );
    line_sequencer #(.SLOW_PART(1), .WORK(SLOW_PART != 0 ? 60 : 90 + SEED)) of_z (
        .clock(clock), .tick(tick), .commit(z_commits), .mode(mode), .withdraw(z_withdraws), .arm(arm),
        .trigger(z_starts), .park(z_parks), .writable(z_writable), .committed(z_committed), .armed(z_armed),
        .running(z_running), .strobe(z_strobe), .playing(z_playing), .markers(z_markers), .refused(z_refused)
    );

    // Requests as the link makes them: a commit only where both can take one, and to both.
    integer seed = SEED, draw, log, result, at, since = 0, longest = 0, ticks = 0, waited = 0, taken = 0, parks = 0;
    initial begin
        log = $fopen(APART, "w");
        result = $fopen(RESULT, "w");
        repeat (10) @(posedge clock);
        for (at = 0; at < CLOCKS; at = at + 1) begin
            draw = $random(seed);
            commit <= draw[7:0] == 0 && writable && z_writable && !committing && !commit;
            z_commit <= draw[7:0] == 0 && writable && z_writable && !committing && !commit;
            mode <= draw[9:8] == 3 ? 2'd0 : draw[9:8];
            withdraw <= draw[7:0] == 1 && draw[11:9] == 0;
            arm <= draw[7:0] == 2;
            trigger <= draw[7:0] == 3;
            z_trigger <= draw[7:0] == 3;
            park <= draw[7:0] == 4 && draw[11:8] == 0;
            z_park <= (draw[7:0] == 4 || (LOSES != 0 && draw[7:0] == 5)) && draw[11:8] == 0;
            @(posedge clock);
        end
        $fwrite(result, "%0d %0d %0d %0d %0d\n", ticks, waited, taken, longest, parks);
        $fclose(result);
        $fclose(log);
        $finish;
    end
    always @(posedge clock) begin
        since = tick ? 0 : since + 1;
        if (since > longest) longest = since;
        if (since > CLOCKS_PER_TICK - 1 && tick == 0) waited = waited + 1;
        if (apart) parks = parks + 1;
        if (strobe) begin
            if (playing) ticks = ticks + 1;
            if (playing && markers[2]) taken = taken + 1;
            if ((playing || z_playing) && (playing != z_playing || markers != z_markers))
                $fwrite(log, "%0d %b %b\n", at, {playing, markers}, {z_playing, z_markers});
        end
    end
endmodule

`default_nettype wire
