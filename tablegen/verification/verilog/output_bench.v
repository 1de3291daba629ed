// Bench of what stands beside the sequencer in an emitted build: dac_coding, dac_spi, dac_axi_stream and dac_boot, with
// the options that a build's own converters do not use. Each is held, on every clock, against what its header says of it.
//
// Words, strobes and pauses are random, the same in every run, on a clock of their own that stops after CLOCKS. RESULTS
// gets a line for each: its name, what came of it, what was lost or refused on purpose, and clocks that were wrong.

`timescale 1ns / 1ps
`default_nettype none

module output_bench #(
    parameter RESULTS = "",
    parameter PROGRAM_FILE = "",  // 48 words of 32 bits
    parameter X_FILE = "",        // 9 words of 16 bits: a table, or Fourier words of 4 harmonics
    parameter Y_FILE = "",        // and others
    parameter CLOCKS = 1500
);
    reg clock = 0;
    initial repeat (CLOCKS) begin
        #5 clock = 1;
        #5 clock = 0;
    end

    reg [63:0] random = 64'h9e3779b97f4a7c15;
    always @(negedge clock) random <= {random[62:0], random[63] ^ random[62] ^ random[60] ^ random[59]};

    wire [31:0] coded [0:3], coding_errors [0:3];
    check_coding #(.BITS(16), .WORD_BITS(16), .TWOS_COMPLEMENT(1)) whole (
        .clock(clock), .code(random[15:0]), .done(coded[0]), .errors(coding_errors[0])
    );
    check_coding #(.BITS(12), .WORD_BITS(16)) right (
        .clock(clock), .code(random[11:0]), .done(coded[1]), .errors(coding_errors[1])
    );
    check_coding #(.BITS(18), .WORD_BITS(24), .LEFT_ALIGNED(1)) left (
        .clock(clock), .code(random[17:0]), .done(coded[2]), .errors(coding_errors[2])
    );
    check_coding #(.BITS(20), .WORD_BITS(32), .TWOS_COMPLEMENT(1), .LEFT_ALIGNED(1)) signed_left (
        .clock(clock), .code(random[19:0]), .done(coded[3]), .errors(coding_errors[3])
    );

    wire [31:0] sent [0:7], missed [0:7], spi_errors [0:7];
    check_spi #(.SEED(1)) spi_0 (.clock(clock), .sent(sent[0]), .lost(missed[0]), .errors(spi_errors[0]));
    check_spi #(
        .SEED(2), .WORD_BITS(6), .FRAME_BITS(9), .DATA_LSB(2), .X_PREFIX(32'h101), .Y_PREFIX(32'h0fe), .CPHA(1),
        .HALF_PERIOD(2), .GAP(1), .LDAC_CLOCKS(1), .LDAC_DELAY(1)
    ) spi_1 (.clock(clock), .sent(sent[1]), .lost(missed[1]), .errors(spi_errors[1]));
    check_spi #(
        .SEED(3), .WORD_BITS(5), .FRAME_BITS(8), .DATA_LSB(1), .X_PREFIX(32'h41), .Y_PREFIX(32'hc0), .TOPOLOGY(1),
        .CPOL(1), .GAP(3), .LDAC_CLOCKS(0), .LDAC_HELD(1)
    ) spi_2 (.clock(clock), .sent(sent[2]), .lost(missed[2]), .errors(spi_errors[2]));
    check_spi #(
        .SEED(4), .WORD_BITS(8), .FRAME_BITS(8), .TOPOLOGY(1), .Y_FIRST(1), .CPHA(1), .GAP(9), .LDAC_CLOCKS(2),
        .LDAC_DELAY(3)
    ) spi_3 (.clock(clock), .sent(sent[3]), .lost(missed[3]), .errors(spi_errors[3]));
    check_spi #(
        .SEED(5), .WORD_BITS(7), .FRAME_BITS(10), .X_PREFIX(32'h380), .Y_PREFIX(32'h080), .TOPOLOGY(2), .GAP(2),
        .LDAC_CLOCKS(3), .LDAC_DELAY(2)
    ) spi_4 (.clock(clock), .sent(sent[4]), .lost(missed[4]), .errors(spi_errors[4]));
    check_spi #(
        .SEED(6), .WORD_BITS(4), .FRAME_BITS(4), .TOPOLOGY(2), .Y_FIRST(1), .CPOL(1), .CPHA(1), .HALF_PERIOD(4),
        .GAP(5), .LDAC_CLOCKS(0)
    ) spi_5 (.clock(clock), .sent(sent[5]), .lost(missed[5]), .errors(spi_errors[5]));
    check_spi #(
        .SEED(7), .WORD_BITS(9), .FRAME_BITS(12), .X_PREFIX(32'ha00), .Y_PREFIX(32'h400), .TOPOLOGY(3), .CPHA(1),
        .LDAC_DELAY(4)
    ) spi_6 (.clock(clock), .sent(sent[6]), .lost(missed[6]), .errors(spi_errors[6]));
    check_spi #(
        .SEED(8), .WORD_BITS(6), .FRAME_BITS(6), .TOPOLOGY(3), .Y_FIRST(1), .CPOL(1), .GAP(1)
    ) spi_7 (.clock(clock), .sent(sent[7]), .lost(missed[7]), .errors(spi_errors[7]));

    wire [31:0] beats [0:1], dropped [0:1], axi_errors [0:1];
    check_axi_stream #(.WORD_BITS(16), .MARKER_BITS(5)) axi_whole (
        .clock(clock), .random(random), .beats(beats[0]), .lost(dropped[0]), .errors(axi_errors[0])
    );
    check_axi_stream #(.WORD_BITS(18), .MARKER_BITS(3)) axi_padded (
        .clock(clock), .random(~random), .beats(beats[1]), .lost(dropped[1]), .errors(axi_errors[1])
    );

    wire [31:0] written [0:4], boot_errors [0:4];
    wire [4:0] incomplete;
    check_boot #(.PROGRAM_FILE(PROGRAM_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE)) boot (
        .clock(clock), .random(random), .words(written[0]), .missing(incomplete[0]), .errors(boot_errors[0])
    );
    check_boot #(.PROGRAM_FILE(PROGRAM_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE), .FOURIER(1)) boot_fourier (
        .clock(clock), .random(~random), .words(written[1]), .missing(incomplete[1]), .errors(boot_errors[1])
    );
    check_boot #(.PROGRAM_FILE(X_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE), .LACKS_PROGRAM(1)) no_program (
        .clock(clock), .random(random), .words(written[2]), .missing(incomplete[2]), .errors(boot_errors[2])
    );
    check_boot #(.PROGRAM_FILE(PROGRAM_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE), .X_WORDS(10)) short_x (
        .clock(clock), .random(random), .words(written[3]), .missing(incomplete[3]), .errors(boot_errors[3])
    );
    check_boot #(.PROGRAM_FILE(PROGRAM_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE), .Y_WORDS(10)) short_y (
        .clock(clock), .random(random), .words(written[4]), .missing(incomplete[4]), .errors(boot_errors[4])
    );

    integer results;
    initial begin
        results = $fopen(RESULTS, "w");
        #(10 * CLOCKS + 10);
        $fwrite(results, "coding %0d 0 %0d\n", coded[0] + coded[1] + coded[2] + coded[3],
                coding_errors[0] + coding_errors[1] + coding_errors[2] + coding_errors[3]);
        $fwrite(results, "spi %0d %0d %0d\n",
                sent[0] + sent[1] + sent[2] + sent[3] + sent[4] + sent[5] + sent[6] + sent[7],
                missed[0] + missed[1] + missed[2] + missed[3] + missed[4] + missed[5] + missed[6] + missed[7],
                spi_errors[0] + spi_errors[1] + spi_errors[2] + spi_errors[3] + spi_errors[4] + spi_errors[5] +
                    spi_errors[6] + spi_errors[7]);
        $fwrite(results, "axi_stream %0d %0d %0d\n", beats[0] + beats[1], dropped[0] + dropped[1],
                axi_errors[0] + axi_errors[1]);
        $fwrite(results, "boot %0d %0d %0d\n", written[0] + written[1] + written[2] + written[3] + written[4],
                32'd0 + incomplete[0] + incomplete[1] + incomplete[2] + incomplete[3] + incomplete[4],
                boot_errors[0] + boot_errors[1] + boot_errors[2] + boot_errors[3] + boot_errors[4]);
        $fclose(results);
    end
endmodule

// The word of a code by arithmetic: two's complement is the code less half of the range, alignment a power of two.
module check_coding #(
    parameter BITS = 16, parameter WORD_BITS = 16, parameter TWOS_COMPLEMENT = 0, parameter LEFT_ALIGNED = 0
) (
    input wire clock,
    input wire [BITS-1:0] code,
    output reg [31:0] done,
    output reg [31:0] errors
);
    wire [WORD_BITS-1:0] word;
    dac_coding #(
        .BITS(BITS), .WORD_BITS(WORD_BITS), .TWOS_COMPLEMENT(TWOS_COMPLEMENT), .LEFT_ALIGNED(LEFT_ALIGNED)
    ) coding (.code(code), .word(word));
    wire [BITS-1:0] half = TWOS_COMPLEMENT ? {1'b1, {BITS-1{1'b0}}} : {BITS{1'b0}};
    wire [BITS-1:0] coded = code - half;
    wire [63:0] aligned = LEFT_ALIGNED ? {{64-BITS{1'b0}}, coded} << (WORD_BITS - BITS) : {{64-BITS{1'b0}}, coded};
    initial begin
        done = 0;
        errors = 0;
    end
    always @(posedge clock) begin
        done <= done + 1;
        if (word !== aligned[WORD_BITS-1:0]) errors <= errors + 1;
    end
endmodule

// dac_spi with random strobes: the pins of every clock follow from the clocks since a sample was sent.
module check_spi #(
    parameter SEED = 1, parameter WORD_BITS = 16, parameter FRAME_BITS = 16, parameter DATA_LSB = 0,
    parameter [31:0] X_PREFIX = 0, parameter [31:0] Y_PREFIX = 0, parameter TOPOLOGY = 0, parameter Y_FIRST = 0,
    parameter CPOL = 0, parameter CPHA = 0, parameter HALF_PERIOD = 1, parameter GAP = 4, parameter LDAC_CLOCKS = 4,
    parameter LDAC_DELAY = 2, parameter LDAC_HELD = 0
) (
    input wire clock,
    output reg [31:0] sent,
    output reg [31:0] lost,
    output reg [31:0] errors
);
    localparam BITS = TOPOLOGY == 3 ? 2 * FRAME_BITS : FRAME_BITS;
    localparam FRAME = (2 * BITS + 1) * HALF_PERIOD;
    localparam PULSE = LDAC_CLOCKS ? LDAC_DELAY + LDAC_CLOCKS + 1 : 0;
    localparam REST = GAP > PULSE ? GAP : PULSE;
    localparam SECOND = TOPOLOGY == 1 || TOPOLOGY == 2 ? FRAME + GAP : 0;  // where the last frame begins
    localparam TICK = SECOND + FRAME + REST;

    reg reset = 0, strobe = 0, waiting = 0;
    reg [WORD_BITS-1:0] x = 0, y = 0, x_waiting = 0, y_waiting = 0;
    reg [63:0] frames;  // the bits of both, the first one in the highest of each half
    reg [31:0] random = 32'h12345678 ^ SEED;
    integer at = -1;  // clocks since a sample was sent; below 0 at rest
    integer until_strobe = 3;
    integer at_in_frame, half, bit_number;
    reg starts, was_free, misses, in_frame, in_second, pulsed, x_low, y_low, active;

    wire sclk, cs_x_n, cs_y_n, mosi_x, mosi_y, ldac_n, busy, missed;
    dac_spi #(
        .WORD_BITS(WORD_BITS), .FRAME_BITS(FRAME_BITS), .DATA_LSB(DATA_LSB), .X_PREFIX(X_PREFIX), .Y_PREFIX(Y_PREFIX),
        .TOPOLOGY(TOPOLOGY), .Y_FIRST(Y_FIRST), .CPOL(CPOL), .CPHA(CPHA), .HALF_PERIOD(HALF_PERIOD), .GAP(GAP),
        .LDAC_CLOCKS(LDAC_CLOCKS), .LDAC_DELAY(LDAC_DELAY), .LDAC_HELD(LDAC_HELD)
    ) spi (
        .clock(clock), .reset(reset), .strobe(strobe), .x_word(x), .y_word(y), .sclk(sclk), .cs_x_n(cs_x_n),
        .cs_y_n(cs_y_n), .mosi_x(mosi_x), .mosi_y(mosi_y), .ldac_n(ldac_n), .busy(busy), .missed(missed)
    );

    function [FRAME_BITS-1:0] framed(input [31:0] prefix, input [WORD_BITS-1:0] word);
        integer i;
        for (i = 0; i < FRAME_BITS; i = i + 1)
            framed[i] = i >= DATA_LSB && i < DATA_LSB + WORD_BITS ? word[i - DATA_LSB] : prefix[i];
    endfunction
    wire [FRAME_BITS-1:0] x_frame = framed(X_PREFIX, strobe ? x : x_waiting);
    wire [FRAME_BITS-1:0] y_frame = framed(Y_PREFIX, strobe ? y : y_waiting);
    reg [FRAME_BITS-1:0] first, second;
    wire [BITS-1:0] on_x = TOPOLOGY == 3 ? {first, second} : in_second ? second : first;

    initial begin
        sent = 0;
        lost = 0;
        errors = 0;
        first = 0;
        second = 0;
        in_second = 0;
    end

    always @(negedge clock) begin
        // What the clock has made of its inputs.
        was_free = at < 0 || at == TICK - 1;
        starts = was_free && (strobe || waiting) && !reset;
        misses = strobe && waiting && !reset;
        if (starts) begin
            first = Y_FIRST && TOPOLOGY != 0 ? y_frame : x_frame;
            second = Y_FIRST && TOPOLOGY != 0 ? x_frame : y_frame;
            at = 0;
            sent = sent + 1;
        end else if (at >= 0)
            at = at == TICK - 1 ? -1 : at + 1;
        waiting = !reset && !was_free && (strobe || waiting);
        if (strobe) begin
            x_waiting = x;
            y_waiting = y;
        end
        if (misses) lost = lost + 1;

        in_second = SECOND != 0 && at >= SECOND;
        at_in_frame = in_second ? at - SECOND : at;
        in_frame = at >= 0 && at_in_frame < FRAME;
        half = at_in_frame / HALF_PERIOD;
        active = in_frame && half % 2 == 1;
        x_low = in_frame && (TOPOLOGY != 2 || in_second == (Y_FIRST != 0));
        y_low = in_frame && (TOPOLOGY == 0 || (TOPOLOGY == 2 && in_second == (Y_FIRST == 0)));
        pulsed = at >= SECOND + FRAME + LDAC_DELAY && at < SECOND + FRAME + LDAC_DELAY + LDAC_CLOCKS;
        bit_number = CPHA ? (half == 0 ? 0 : (half - 1) / 2) : half / 2;
        #1;  // pins have changed
        if (sclk !== (active ^ (CPOL != 0)) || cs_x_n !== !x_low || cs_y_n !== !y_low || busy !== (at >= 0) ||
            missed !== misses || ldac_n !== (LDAC_CLOCKS ? !pulsed : LDAC_HELD != 0) ||
            (in_frame && bit_number < BITS && mosi_x !== on_x[BITS-1-bit_number]) ||
            (in_frame && bit_number < BITS && TOPOLOGY == 0 && mosi_y !== second[FRAME_BITS-1-bit_number]) ||
            (TOPOLOGY != 0 && mosi_y !== 1'b0))
            errors = errors + 1;

        // Inputs of the next clock: strobes as close as they are sent, closer, or with pauses.
        random = {random[30:0], random[31] ^ random[21] ^ random[1] ^ random[0]};
        strobe = until_strobe == 0;
        until_strobe = until_strobe != 0 ? until_strobe - 1 : random[0] ? TICK - 1 : random[9:1] % (2 * TICK);
        reset = random[17:12] == 6'd0;
        x = random[31:8] ^ random[23:0];
        y = random[27:4];
    end
endmodule

// dac_axi_stream with a sink that pauses: a beat stays until it is taken, and a sample that finds one waiting is lost.
module check_axi_stream #(
    parameter WORD_BITS = 16, parameter MARKER_BITS = 5
) (
    input wire clock,
    input wire [63:0] random,
    output reg [31:0] beats,
    output reg [31:0] lost,
    output reg [31:0] errors
);
    localparam LANE_BITS = (WORD_BITS + 7) / 8 * 8;
    reg reset = 0, strobe = 0, ready = 0, holds = 0, misses = 0;
    reg [WORD_BITS-1:0] x = 0, y = 0, x_held = 0, y_held = 0;
    reg [MARKER_BITS-1:0] markers = 0, markers_held = 0;
    wire [2*LANE_BITS-1:0] data;
    wire [MARKER_BITS-1:0] user;
    wire valid, missed;
    dac_axi_stream #(.WORD_BITS(WORD_BITS), .MARKER_BITS(MARKER_BITS)) axi (
        .clock(clock), .reset(reset), .strobe(strobe), .x_word(x), .y_word(y), .markers(markers), .m_axis_tdata(data),
        .m_axis_tuser(user), .m_axis_tvalid(valid), .m_axis_tready(ready), .missed(missed)
    );
    wire [LANE_BITS-1:0] x_lane = x_held, y_lane = y_held;

    initial begin
        beats = 0;
        lost = 0;
        errors = 0;
    end
    always @(negedge clock) begin
        misses = strobe && holds && !ready && !reset;
        if (misses) lost = lost + 1;
        if (holds && ready) beats = beats + 1;
        if (strobe && (!holds || ready)) begin
            x_held = x;
            y_held = y;
            markers_held = markers;
        end
        holds = !reset && (strobe || (holds && !ready));
        #1;
        if (valid !== holds || missed !== misses ||
            (holds && (data !== {y_lane, x_lane} || user !== markers_held)))
            errors = errors + 1;
        strobe = random[0] || random[9];
        ready = random[3] || random[20];
        reset = random[44:39] == 6'd0;
        x = random[63:32];
        y = random[55:20];
        markers = random[17:10];
    end
endmodule

// dac_boot with a device that makes it wait, and a reset in between: every word in its place, then a commit, then the
// host. A file may have fewer words than there should be, as a table in the place of the program; then there is no
// commit.
module check_boot #(
    parameter PROGRAM_FILE = "", parameter X_FILE = "", parameter Y_FILE = "", parameter FOURIER = 0, parameter X_WORDS = 9,
    parameter Y_WORDS = 9, parameter LACKS_PROGRAM = 0
) (
    input wire clock,
    input wire [63:0] random,
    output reg [31:0] words,
    output wire missing,
    output reg [31:0] errors
);
    localparam FILE_WORDS = 9, LACKS_WORDS = LACKS_PROGRAM || X_WORDS > FILE_WORDS || Y_WORDS > FILE_WORDS;
    localparam PROGRAM_WORDS = 48, WORD_BITS = FOURIER ? 32 : 16, HARMONICS = 4, CLOCKS = 400;
    localparam RESET_AT = 80;  // clock: the tables are being written
    localparam START_CLOCKS = 9;
    reg [31:0] program_words [0:PROGRAM_WORDS-1];
    reg [15:0] x_words [0:FILE_WORDS-1], y_words [0:FILE_WORDS-1];
    reg reset = 0, writable = 0, host_write = 0, host_commit = 0, has_ended = 0;
    reg [2:0] host_region = 0;
    reg [15:0] host_address = 0;
    reg [31:0] host_data = 0, due;
    reg [15:0] table_word;
    integer at = 0, clocks = 0, place;
    reg committed = 0;

    initial begin
        words = 0;
        errors = 0;
        $readmemh(PROGRAM_FILE, program_words);
        $readmemh(X_FILE, x_words);
        $readmemh(Y_FILE, y_words);
    end

    wire write, commit, booting;
    wire [2:0] region;
    wire [15:0] address;
    wire [31:0] data;
    dac_boot #(
        .PROGRAM_FILE(PROGRAM_FILE), .X_FILE(X_FILE), .Y_FILE(Y_FILE), .FOURIER(FOURIER), .X_WORDS(X_WORDS),
        .Y_WORDS(Y_WORDS), .X_WORD_BITS(WORD_BITS), .Y_WORD_BITS(WORD_BITS), .X_HARMONICS(HARMONICS),
        .Y_HARMONICS(HARMONICS), .START_CLOCKS(START_CLOCKS)
    ) boot (
        .clock(clock), .reset(reset), .host_write(host_write), .host_region(host_region),
        .host_address(host_address), .host_data(host_data), .host_commit(host_commit), .writable(writable),
        .write(write), .write_region(region), .write_address(address), .write_data(data), .commit(commit),
        .starting(), .booting(booting), .missing(missing)
    );

    wire is_program = at < PROGRAM_WORDS, is_x = at < PROGRAM_WORDS + X_WORDS;
    always @(negedge clock) begin
        // Outputs as the next clock finds them, with inputs that have changed for it.
        reset = clocks == RESET_AT;
        writable = random[1] || random[30];
        host_write = random[5];
        host_commit = random[8];
        host_region = random[13:11];
        host_address = random[47:32];
        host_data = random[63:32] ^ random[31:0];
        #1;
        place = is_program ? at : is_x ? at - PROGRAM_WORDS : at - PROGRAM_WORDS - X_WORDS;
        table_word = is_x ? x_words[place] : y_words[place];
        due = is_program ? program_words[place] : {FOURIER ? 16'd0 : {16{table_word[15]}}, table_word};
        if (FOURIER && (at == 26 || at == 42)) due = HARMONICS;
        if (!booting) begin
            has_ended = 1;
            if (write !== host_write || commit !== host_commit || region !== host_region || address !== host_address ||
                data !== host_data || (LACKS_WORDS ? !missing : missing || !committed))
                errors = errors + 1;
        end else begin
            if ((write || commit) && clocks < START_CLOCKS) errors = errors + 1;
            if (has_ended && clocks > RESET_AT + 2) errors = errors + 1;
            if (write) begin
                if (!writable || region !== (is_program ? 3'd0 : (is_x ? 3'd1 : 3'd2) + (FOURIER ? 3'd2 : 3'd0)) ||
                    address !== place || at >= PROGRAM_WORDS + X_WORDS + Y_WORDS ||
                    (place < (is_program ? (LACKS_PROGRAM ? 0 : PROGRAM_WORDS) : FILE_WORDS) && data !== due))
                    errors = errors + 1;
                at = at + 1;
                words = words + 1;
            end
            if (commit) begin
                if (!writable || committed || LACKS_WORDS || at != PROGRAM_WORDS + X_WORDS + Y_WORDS)
                    errors = errors + 1;
                committed = 1;
            end
        end
        if (reset) begin
            at = 0;
            committed = 0;
        end
        clocks = clocks + 1;
        if (clocks == CLOCKS && booting) errors = errors + 1;
    end
endmodule

`default_nettype wire
