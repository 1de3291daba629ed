// Loads a program from the memory files of a build at power-up; afterwards passes the writes of the host through.
//
// With FOURIER = 0 X_FILE and Y_FILE are the tables, <name>_x.mem and <name>_y.mem; with FOURIER = 1 the Fourier
// words, <name>_x_fourier.mem and <name>_y_fourier.mem, from which a sequencer with FOURIER = 1 computes its tables;
// they take less memory. PROGRAM_FILE is <name>_program.mem either way. The boot ends with a commit; arm and trigger
// are left to the host. In simulation a file that is missing or has too few words is not committed: the boot ends
// without, and `missing` is high. In synthesis, where the macro SYNTHESIS has to be defined, this is not seen: some
// tools would let the mark of an unfilled memory win over the file. A name that is empty stops the elaboration of both.
//
// It reads nothing for START_CLOCKS after power-up: block RAMs of iCE40 parts read as 0 for some microseconds after the
// configuration. 4096 clocks are 41 us at 100 MHz.

`default_nettype none

module dac_boot #(
    parameter PROGRAM_FILE = "",
    parameter X_FILE = "",
    parameter Y_FILE = "",
    parameter FOURIER = 0,
    parameter X_WORDS = 2048,     // number of words in X_FILE
    parameter Y_WORDS = 2048,
    parameter X_WORD_BITS = 16,   // bits of a word in X_FILE; 32 with FOURIER
    parameter Y_WORD_BITS = 16,
    parameter X_HARMONICS = 0,    // with FOURIER: number of harmonics in X_FILE
    parameter Y_HARMONICS = 0,
    parameter START_CLOCKS = 4096 // clocks after power-up before the first read
) (
    input  wire        clock,
    input  wire        reset,           // starts the boot again
    input  wire        host_write,
    input  wire [2:0]  host_region,
    input  wire [15:0] host_address,
    input  wire [31:0] host_data,
    input  wire        host_commit,
    input  wire        writable,        // from the sequencer; the boot waits while it is low
    output wire        write,
    output wire [2:0]  write_region,
    output wire [15:0] write_address,
    output wire [31:0] write_data,
    output wire        commit,
    output wire        starting,        // the START_CLOCKS; a loader that reads block RAMs is held in reset by it
    output reg         booting,         // the boot is running; host writes are lost
    output reg         missing          // a file has not all of its words: there was no commit
);
    localparam PROGRAM_WORDS = 48;
    localparam [31:0] LAST_PROGRAM = PROGRAM_WORDS - 1, LAST_X = X_WORDS - 1, LAST_Y = Y_WORDS - 1;
    localparam [5:0] X_HARMONICS_AT = 6'd26, Y_HARMONICS_AT = 6'd42;
    localparam [31:0] X_H = X_HARMONICS, Y_H = Y_HARMONICS;
    localparam [1:0] PROGRAM = 2'd0, X = 2'd1, COMMIT = 2'd3;  // 2 is Y
    localparam X_ADDRESS_BITS = X_WORDS > 1 ? $clog2(X_WORDS) : 1;
    localparam Y_ADDRESS_BITS = Y_WORDS > 1 ? $clog2(Y_WORDS) : 1;
    localparam START_BITS = START_CLOCKS > 0 ? $clog2(START_CLOCKS + 1) : 1;
    localparam [31:0] START = START_CLOCKS;

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (FOURIER < 0 || FOURIER > 1) begin : guard_0
            dac_boot_FOURIER_is_not_0_to_1 stop ();
        end
        if (X_WORDS < 1 || X_WORDS > 65536) begin : guard_1
            dac_boot_X_WORDS_is_not_1_to_65536 stop ();
        end
        if (FOURIER == 0 && (X_WORD_BITS < 8 || X_WORD_BITS > 24)) begin : guard_2
            dac_boot_X_WORD_BITS_of_a_table_is_not_8_to_24 stop ();
        end
        if (FOURIER != 0 && X_WORD_BITS != 32) begin : guard_3
            dac_boot_X_WORD_BITS_of_Fourier_words_is_not_32 stop ();
        end
        if (FOURIER != 0 && (X_HARMONICS < 1 || X_HARMONICS > 512)) begin : guard_4
            dac_boot_X_HARMONICS_is_not_1_to_512 stop ();
        end
        if (FOURIER != 0 && X_WORDS != 2 * X_HARMONICS + 1) begin : guard_5
            dac_boot_X_WORDS_is_not_two_X_HARMONICS_and_one stop ();
        end
        if (Y_WORDS < 1 || Y_WORDS > 65536) begin : guard_6
            dac_boot_Y_WORDS_is_not_1_to_65536 stop ();
        end
        if (FOURIER == 0 && (Y_WORD_BITS < 8 || Y_WORD_BITS > 24)) begin : guard_7
            dac_boot_Y_WORD_BITS_of_a_table_is_not_8_to_24 stop ();
        end
        if (FOURIER != 0 && Y_WORD_BITS != 32) begin : guard_8
            dac_boot_Y_WORD_BITS_of_Fourier_words_is_not_32 stop ();
        end
        if (FOURIER != 0 && (Y_HARMONICS < 1 || Y_HARMONICS > 512)) begin : guard_9
            dac_boot_Y_HARMONICS_is_not_1_to_512 stop ();
        end
        if (FOURIER != 0 && Y_WORDS != 2 * Y_HARMONICS + 1) begin : guard_10
            dac_boot_Y_WORDS_is_not_two_Y_HARMONICS_and_one stop ();
        end
        if (START_CLOCKS < 0 || START_CLOCKS > 16777216) begin : guard_11
            dac_boot_START_CLOCKS_is_not_0_to_16777216 stop ();
        end
        if (PROGRAM_FILE == "") begin : guard_12
            dac_boot_PROGRAM_FILE_is_not_set stop ();
        end
        if (X_FILE == "") begin : guard_13
            dac_boot_X_FILE_is_not_set stop ();
        end
        if (Y_FILE == "") begin : guard_14
            dac_boot_Y_FILE_is_not_set stop ();
        end
    endgenerate

    // The bit above a word is 1 in the last word of a memory that no file has filled. Where one has, it is 0
    // throughout, and a synthesiser takes it away. In a synthesis only memories without a name have it: yosys gives an
    // assignment precedence over $readmemh, whatever their order, and it stops where a file is missing.
    reg [32:0] program_words [0:PROGRAM_WORDS-1];
    reg [X_WORD_BITS:0] x_words [0:X_WORDS-1];
    reg [Y_WORD_BITS:0] y_words [0:Y_WORDS-1];
`ifdef SYNTHESIS
    localparam SYNTHESISED = 1;
`else
    localparam SYNTHESISED = 0;
`endif
    initial begin
        if (PROGRAM_FILE == "" || !SYNTHESISED) program_words[PROGRAM_WORDS-1] = {1'b1, 32'd0};
        if (X_FILE == "" || !SYNTHESISED) x_words[X_WORDS-1] = {1'b1, {X_WORD_BITS{1'b0}}};
        if (Y_FILE == "" || !SYNTHESISED) y_words[Y_WORDS-1] = {1'b1, {Y_WORD_BITS{1'b0}}};
        if (PROGRAM_FILE != "") $readmemh(PROGRAM_FILE, program_words);
        if (X_FILE != "") $readmemh(X_FILE, x_words);
        if (Y_FILE != "") $readmemh(Y_FILE, y_words);
    end

    // A word is read on one clock and written on the next; both wait while the sequencer accepts no write.
    reg [START_BITS-1:0] waited;
    wire started = waited == START[START_BITS-1:0];
    reg [1:0] reads, writes;
    reg [16:0] read_at;
    reg [15:0] write_at;
    reg reading, writing;
    reg [32:0] program_word;
    reg [X_WORD_BITS:0] x_word;
    reg [Y_WORD_BITS:0] y_word;
    wire now = writing && writable;
    wire unfilled = writes == PROGRAM ? program_word[32] : writes == X ? x_word[X_WORD_BITS] : y_word[Y_WORD_BITS];
    wire last = {15'd0, read_at} == (reads == PROGRAM ? LAST_PROGRAM : reads == X ? LAST_X : LAST_Y);

    initial begin
        waited = 0;
        reads = PROGRAM;
        writes = PROGRAM;
        read_at = 17'd0;
        write_at = 16'd0;
        reading = 1'b1;
        writing = 1'b0;
        booting = 1'b1;
        missing = 1'b0;
    end

    always @(posedge clock) begin
        if (!started) waited <= waited + 1'b1;
        if (writable) begin
            program_word <= program_words[read_at[5:0]];
            x_word <= x_words[read_at[X_ADDRESS_BITS-1:0]];
            y_word <= y_words[read_at[Y_ADDRESS_BITS-1:0]];
            writing <= reading && started;
            writes <= reads;
            write_at <= read_at[15:0];
        end
        if (reset) begin
            reads <= PROGRAM;
            read_at <= 17'd0;
            reading <= 1'b1;
            writing <= 1'b0;
            booting <= 1'b1;
        end else if (reading && started && writable) begin
            read_at <= last ? 17'd0 : read_at + 1;
            if (last) reads <= reads + 1;
            if (reads == COMMIT) reading <= 1'b0;
        end else if (!reading && !writing)
            booting <= 1'b0;
        missing <= !reset && (missing || (now && writes != COMMIT && unfilled));
    end

    wire [X_WORD_BITS+31:0] x_wide = {{32{x_word[X_WORD_BITS-1]}}, x_word[X_WORD_BITS-1:0]};
    wire [Y_WORD_BITS+31:0] y_wide = {{32{y_word[Y_WORD_BITS-1]}}, y_word[Y_WORD_BITS-1:0]};
    wire [31:0] program_data = FOURIER != 0 && write_at[5:0] == X_HARMONICS_AT ? X_H :
                               FOURIER != 0 && write_at[5:0] == Y_HARMONICS_AT ? Y_H : program_word[31:0];
    wire unused = &{START, read_at, x_wide, y_wide};

    assign starting = !started;
    assign write = booting ? now && writes != COMMIT : host_write;
    assign write_region = !booting ? host_region : writes == PROGRAM ? 3'd0 : {1'b0, writes} + (FOURIER ? 3'd2 : 3'd0);
    assign write_address = booting ? write_at : host_address;
    assign write_data = !booting ? host_data :
                        writes == PROGRAM ? program_data : writes == X ? x_wide[31:0] : y_wide[31:0];
    assign commit = booting ? now && writes == COMMIT && !missing : host_commit;
endmodule

`default_nettype wire
