// dac_library alone: picks in turn, and what it writes. `writable` is low on some clocks where BUSY is set.
//
// CAPTURE gets a line for each: "p NUMBER", "w REGION ADDRESS DATA", "c" a commit, "d" a withdrawal, "f" where a pick has
// failed at its end.

`default_nettype none
`timescale 1ns / 1ps

module library_writes_bench #(
    parameter CAPTURE = "capture.txt",
    parameter PICKS = "picks.hex",
    parameter PICK_COUNT = 1,
    parameter MEMORY = "memory.mem",
    parameter MEMORY_WORDS = 1,
    parameter MEMORY_CLOCKS = 1,   // from memory_read to memory_ready
    parameter PROGRAMS = 1,
    parameter BUSY = 0,
    parameter REFUSED = 0          // 1: no commit is taken up
);
    reg clock = 1'b0, pick = 1'b0;
    reg [15:0] number = 16'd0;
    reg [31:0] memory [0:MEMORY_WORDS-1];
    reg [15:0] picks [0:PICK_COUNT-1];
    initial begin
        $readmemh(MEMORY, memory);
        $readmemh(PICKS, picks);
    end
    always #5 clock = !clock;

    wire busy, failed, memory_read, write, commit, withdraw;
    wire [19:0] memory_address;
    wire [2:0] region;
    wire [15:0] address;
    wire [31:0] data;

    reg [7:0] delay = 8'd0;
    reg memory_ready = 1'b0;
    reg [31:0] memory_data = 32'd0;
    reg [15:0] clocks = 16'd0;
    reg answers = 1'b0, committed = 1'b0;  // the clocks after a commit
    wire writable = !answers && (BUSY == 0 || clocks[6:4] == 3'd0);
    always @(posedge clock) begin
        clocks <= clocks + 16'd1;
        answers <= commit;
        committed <= answers && REFUSED == 0;
        if (delay != 0) delay <= delay - 8'd1;
        else if (memory_read) delay <= MEMORY_CLOCKS;
        memory_ready <= delay == 1 || (MEMORY_CLOCKS == 0 && memory_read);
        memory_data <= memory_ready ? 32'hDEADBEEF : memory[memory_address];
    end

    dac_library #(.PROGRAMS(PROGRAMS), .ADDRESS_BITS(20)) picker (
        .clock(clock), .reset(1'b0), .pick(pick), .number(number), .busy(busy), .failed(failed),
        .memory_read(memory_read), .memory_address(memory_address), .memory_ready(memory_ready),
        .memory_data(memory_data), .writable(writable), .committed(committed), .write(write), .write_region(region),
        .write_address(address), .write_data(data), .commit(commit), .withdraw(withdraw)
    );

    integer file, at, waited;
    always @(negedge clock) begin
        if (write) $fwrite(file, "w %0d %0d %h\n", region, address, data);
        if (commit) $fwrite(file, "c\n");
        if (withdraw) $fwrite(file, "d\n");
    end

    initial begin
        file = $fopen(CAPTURE, "w");
        for (at = 0; at < PICK_COUNT; at = at + 1) begin
            @(negedge clock);
            #1 number = picks[at];
            pick = 1'b1;
            $fwrite(file, "p %0d\n", number);
            @(negedge clock);
            #1 pick = 1'b0;
            waited = 0;
            while (busy && waited < 200000) @(negedge clock) waited = waited + 1;
            @(negedge clock);
            #1 if (failed) $fwrite(file, "f\n");
        end
        $fclose(file);
        $finish;
    end
endmodule

`default_nettype wire
