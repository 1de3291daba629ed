// Picks a program out of a memory of many, by its number, and writes it into a dac_sequencer.
//
// The memory has words of 32 bits and the format of <library>_library_tables.mem or ..._fourier.mem; it may be a block
// RAM, or a flash behind a controller of yours. `memory_read` is high for a clock with an address; `memory_ready` is
// high for a clock, one or more clocks later, with the word. Every record has a CRC. A record with a wrong one, or a
// number that there is not, is not committed: `failed` is high until the next `pick`, and the idle bank is emptied by
// `withdraw`. The same where the sequencer refuses the commit: `busy` is high until `committed` is, or `writable`
// without it. What plays goes on either way; a commit is taken as every commit is.
//
// A word takes 35 clocks and the time of the memory.

`default_nettype none

module dac_library #(
    parameter PROGRAMS = 1,        // number of programs in the memory
    parameter ADDRESS_BITS = 24    // of the memory's address
) (
    input  wire                    clock,
    input  wire                    reset,          // ends what is going on; nothing is committed
    input  wire                    pick,           // one clock; ignored while busy
    input  wire [15:0]             number,         // with pick: 0 .. PROGRAMS - 1
    output wire                    busy,
    output reg                     failed,
    output reg                     memory_read,
    output reg  [ADDRESS_BITS-1:0] memory_address,
    input  wire                    memory_ready,
    input  wire [31:0]             memory_data,
    input  wire                    writable,       // from the sequencer; a pick waits while it is low
    input  wire                    committed,      // from the sequencer
    output wire                    write,
    output reg  [2:0]              write_region,
    output reg  [15:0]             write_address,
    output reg  [31:0]             write_data,
    output reg                     commit,
    output reg                     withdraw
);
    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (PROGRAMS < 1 || PROGRAMS > 65536) begin : guard_0
            dac_library_PROGRAMS_is_not_1_to_65536 stop ();
        end
        if (ADDRESS_BITS < 6 || ADDRESS_BITS > 32) begin : guard_1
            dac_library_ADDRESS_BITS_is_not_6_to_32 stop ();
        end
    endgenerate

    localparam [31:0] LAST_PROGRAM = PROGRAMS - 1, POLYNOMIAL = 32'hEDB88320;
    localparam [2:0] START = 3'd0, X_COUNT = 3'd1, Y_COUNT = 3'd2, PROGRAM = 3'd3, X = 3'd4, Y = 3'd5, PIXELS = 3'd6;
    localparam [2:0] CHECK = 3'd7;
    localparam [2:0] IDLE = 3'd0, WAIT = 3'd1, READ = 3'd2, WRITE = 3'd3, SUM = 3'd4, STEP = 3'd5;
    localparam [2:0] ANSWER = 3'd6;

    reg [2:0] state, part;     // what is being done, with a word of which part of the record
    reg [16:0] left;           // words of the part, with this one
    reg [16:0] x_left, y_left;
    reg [13:0] pixels;         // of a sweep, whose ticks are behind the words of y
    reg x_fourier, y_fourier;
    reg [31:0] word, crc;
    reg [4:0] bit_number;

    initial begin
        state = IDLE;
        failed = 1'b0;
        memory_read = 1'b0;
        memory_address = {ADDRESS_BITS{1'b0}};
        commit = 1'b0;
        withdraw = 1'b0;
    end

    wire [31:0] wanted = {16'd0, number};
    wire written = part == PROGRAM || part == X || part == Y || part == PIXELS;
    wire last = left == 17'd1;
    wire no_pixels = pixels == 14'd0;
    assign busy = state != IDLE;
    assign write = state == WRITE && written && writable;

    always @(posedge clock) begin
        memory_read <= 1'b0;
        commit <= 1'b0;
        withdraw <= 1'b0;
        case (state)
            IDLE:
                if (pick) begin
                    failed <= wanted > LAST_PROGRAM;
                    if (wanted <= LAST_PROGRAM) state <= WAIT;
                    memory_address <= wanted[ADDRESS_BITS-1:0];
                    part <= START;
                    left <= 17'd1;
                    crc <= 32'hFFFFFFFF;
                end
            WAIT:
                if (writable) begin
                    memory_read <= 1'b1;
                    state <= READ;
                end
            READ:
                if (memory_ready) begin
                    word <= memory_data;
                    write_data <= memory_data;
                    bit_number <= 5'd0;
                    state <= WRITE;
                end
            WRITE:
                if (!written || writable) state <= part == START || part == CHECK ? STEP : SUM;
            SUM: begin
                crc <= {1'b0, crc[31:1]} ^ (crc[0] ^ word[0] ? POLYNOMIAL : 32'd0);
                word <= {word[0], word[31:1]};
                bit_number <= bit_number + 5'd1;
                if (bit_number == 5'd31) state <= STEP;
            end
            ANSWER: // from the clock after the commit; the sequencer keeps writable low until it has an answer
                if (!commit && (committed || writable)) begin
                    state <= IDLE;
                    failed <= !committed;
                    withdraw <= !committed;
                end
            default: begin // STEP: the word is done, and turned round to where it was
                memory_read <= part != CHECK;
                state <= part != CHECK ? READ : word == ~crc ? ANSWER : IDLE;
                memory_address <= part == START ? word[ADDRESS_BITS-1:0] : memory_address + 1'b1;
                write_address <= write_address + 16'd1;
                left <= left - 17'd1;
                if (last) begin
                    part <= part == Y && no_pixels ? CHECK : part + 3'd1;
                    write_address <= 16'd0;
                    left <= part == Y_COUNT ? 17'd48 : part == PROGRAM ? x_left : part == X ? y_left :
                            part == Y && !no_pixels ? {2'd0, pixels, 1'b0} : 17'd1;
                end
                if (part == X_COUNT) {x_fourier, x_left} <= {word[31], word[16:0]};
                if (part == Y_COUNT) {y_fourier, pixels, y_left} <= word;
                if (last) write_region <= part == PROGRAM ? (x_fourier ? 3'd3 : 3'd1) :
                                          part == X ? (y_fourier ? 3'd4 : 3'd2) : part == Y ? 3'd7 : 3'd0;
                if (part == CHECK) begin
                    commit <= word == ~crc;
                    withdraw <= word != ~crc;
                    failed <= word != ~crc;
                end
            end
        endcase
        if (reset) begin
            state <= IDLE;
            failed <= 1'b0;
            memory_read <= 1'b0;
            commit <= 1'b0;
            withdraw <= state != IDLE;
        end
    end
endmodule

`default_nettype wire
