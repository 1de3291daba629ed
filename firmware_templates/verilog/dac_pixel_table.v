// Pixels of a program that has the ticks of each pixel, and the check of such a table at its commit.
//
// A bank has the ticks of the pixels of the forward window, then of the backward one, each in order of time. A program
// whose word 14 is 0, or was not written since the last swap, has no table: its pixels are `counted`. The commit of one
// with a table is accepted when all of it has been read: `checking` is high for 2 pixels + 6 clocks. `refused` is high
// for a clock where it is not complete, where a pixel has no tick, or where the pixels of a window do not fill it.
//
// The marker of a tick is there three clocks after `tick`. Each bank is a memory of its own, so that the idle one is
// read by the check while the other one plays.

`default_nettype none

module dac_pixel_table #(
    parameter TICK_BITS = 24,
    parameter INDEX_BITS = 9   // a bank holds the ticks of 2^(INDEX_BITS - 1) pixels of each window
) (
    input  wire                  clock,
    // the idle program
    input  wire                  write_word,      // word 14
    input  wire                  write_table,
    input  wire [INDEX_BITS-1:0] table_address,
    input  wire [31:0]           write_data,
    input  wire [TICK_BITS:0]    idle_pixels,
    input  wire [TICK_BITS:0]    forward_count,
    input  wire [TICK_BITS:0]    backward_count,
    input  wire                  discard,
    input  wire                  commit,          // by the words of the program it may be committed
    output wire                  accepted,
    output wire                  checking,
    output wire                  refused,
    // the program that plays
    input  wire                  bank,
    input  wire                  take,            // the first tick of a new program comes with the next clock
    input  wire                  load,            // the clock before that of its first tick here
    input  wire                  tick,
    input  wire                  forward_opens,   // the first tick of a window
    input  wire                  backward_opens,
    input  wire                  imaging,
    input  wire [TICK_BITS:0]    pixels,
    input  wire                  counted,         // of a program without a table, a clock after its tick
    output reg                   pixel
);
    localparam [31:0] MOST_PIXELS = 1 << (INDEX_BITS - 1);
    localparam ROOM_BITS = (TICK_BITS > 15 ? TICK_BITS : 15) + 2;  // of the ticks that a window has left, signed

    wire [31:0] wide_idle_pixels = {{31-TICK_BITS{1'b0}}, idle_pixels};
    wire [31:0] wide_pixels = {{31-TICK_BITS{1'b0}}, pixels};
    wire unused = &{wide_idle_pixels, wide_pixels};

    // The idle program: whether it has a table, and how many words of it were written.
    reg has_table, spoilt;
    reg [INDEX_BITS:0] written;
    initial begin
        has_table = 1'b0;
        spoilt = 1'b0;
        written = 0;
    end
    wire has_table_now = write_word ? write_data != 32'd0 : has_table;  // with the write of this clock
    always @(posedge clock) begin
        has_table <= has_table_now && !take;
        if (take || discard)
            spoilt <= 1'b0;
        else if ((write_word && write_data[31:1] != 31'd0) || (write_table && write_data[31:16] != 16'd0))
            spoilt <= 1'b1;
        if (take)
            written <= 0;
        else if (write_table && !written[INDEX_BITS])
            written <= written + 1'b1;
    end
    wire complete = !spoilt && idle_pixels != 0 && wide_idle_pixels <= MOST_PIXELS &&
                    written >= {wide_idle_pixels[INDEX_BITS-1:0], 1'b0};

    // The bank of the ticks that are here, and whether their program has a table. The bank changes for the first read
    // of a new program, the other one with its first marker.
    reg reading, next_uses_table, uses_table, load_2, load_3;
    initial begin
        reading = 1'b0;
        next_uses_table = 1'b0;
        uses_table = 1'b0;
        load_2 = 1'b0;
        load_3 = 1'b0;
    end
    always @(posedge clock) begin
        load_2 <= load;
        load_3 <= load_2;
        if (take) next_uses_table <= has_table;
        if (load_2) reading <= bank;
        if (load_3) uses_table <= next_uses_table;
    end

    // The word after the last one that was begun is read ahead; at the opening of a window that is its first one. Clock
    // 1: its address. Clock 2: it is read. Clock 3: it is there for the first tick of the window.
    reg tick_2, tick_3, opens_2, opens_3, imaging_2, imaging_3, counted_3;
    reg [INDEX_BITS-1:0] ahead;
    reg [15:0] left;  // ticks of a pixel after this one
    reg ended;        // none
    initial begin
        tick_2 = 1'b0;
        tick_3 = 1'b0;
        opens_2 = 1'b0;
        opens_3 = 1'b0;
        imaging_2 = 1'b0;
        imaging_3 = 1'b0;
        counted_3 = 1'b0;
        ahead = 0;
        left = 16'd0;
        ended = 1'b0;
        pixel = 1'b0;
    end
    wire starts = opens_3 || ended;
    wire reads_ahead = (tick_2 && opens_2) || (tick_3 && starts);

    // The check reads the idle bank from its first word to the last, and takes each from what its window has left.
    reg loads, reads, fetched, tests, in_backward, wrong;
    reg [INDEX_BITS-1:0] at, pixels_left;
    reg signed [ROOM_BITS-1:0] room;
    initial begin
        loads = 1'b0;
        reads = 1'b0;
        fetched = 1'b0;
        tests = 1'b0;
        in_backward = 1'b0;
        wrong = 1'b0;
        at = 0;
        pixels_left = 0;
        room = 0;
    end
    assign checking = loads || reads || fetched || tests;

    reg [15:0] words_0 [0:(1<<INDEX_BITS)-1];
    reg [15:0] words_1 [0:(1<<INDEX_BITS)-1];
    reg [15:0] word_0, word_1;
    wire [INDEX_BITS-1:0] address_0 = reading ? at : ahead;
    wire [INDEX_BITS-1:0] address_1 = reading ? ahead : at;
    always @(posedge clock) begin
        if (write_table && reading) words_0[table_address] <= write_data[15:0];
        if (write_table && !reading) words_1[table_address] <= write_data[15:0];
        if (reading ? reads : reads_ahead) word_0 <= words_0[address_0];
        if (reading ? reads_ahead : reads) word_1 <= words_1[address_1];
    end
    wire [15:0] word = reading ? word_1 : word_0;
    wire [15:0] checked = reading ? word_0 : word_1;

    wire [15:0] now = starts ? word : left;
    always @(posedge clock) begin
        tick_2 <= tick;
        tick_3 <= tick_2;
        if (tick) begin
            opens_2 <= forward_opens || backward_opens;
            imaging_2 <= imaging;
        end
        if (tick_2) begin
            opens_3 <= opens_2;
            imaging_3 <= imaging_2;
            counted_3 <= counted;
        end
        if (tick_3) begin
            pixel <= uses_table ? imaging_3 && starts : counted_3;
            left <= now - 16'd1;
            ended <= now == 16'd1;
        end
        if (tick && (forward_opens || backward_opens))
            ahead <= forward_opens ? {INDEX_BITS{1'b0}} : wide_pixels[INDEX_BITS-1:0];
        else if (reads_ahead)
            ahead <= ahead + 1'b1;
    end

    wire is_wrong = wrong || room != 0;  // of the window that was read
    wire ends = tests && in_backward;
    always @(posedge clock) begin
        loads <= !discard && ((commit && has_table_now) || (tests && !in_backward));
        reads <= !discard && ((loads && !refused) || (reads && pixels_left != 1));
        fetched <= !discard && reads;
        tests <= !discard && fetched && !reads;
        if (commit) begin
            in_backward <= 1'b0;
            wrong <= 1'b0;
            at <= 0;
        end
        if (loads) begin
            room <= {{ROOM_BITS-1-TICK_BITS{1'b0}}, in_backward ? backward_count : forward_count};
            pixels_left <= wide_idle_pixels[INDEX_BITS-1:0];
        end
        if (reads) begin
            at <= at + 1'b1;
            pixels_left <= pixels_left - 1'b1;
        end
        if (fetched) begin
            room <= room - $signed({{ROOM_BITS-16{1'b0}}, checked});
            if (checked == 16'd0 || room[ROOM_BITS-1]) wrong <= 1'b1;
        end
        if (tests) begin
            wrong <= is_wrong;
            in_backward <= 1'b1;
        end
    end
    assign accepted = (commit && !has_table_now) || (ends && !is_wrong);
    assign refused = (loads && !in_backward && !complete) || (ends && is_wrong);

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (TICK_BITS < 3 || TICK_BITS > 30) begin : guard_0
            dac_pixel_table_TICK_BITS_is_not_3_to_30 stop ();
        end
        if (INDEX_BITS < 2 || INDEX_BITS > 16) begin : guard_1
            dac_pixel_table_INDEX_BITS_is_not_2_to_16 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
