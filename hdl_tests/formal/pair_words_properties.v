// dac_pair_words: after the start of a program each word comes at its stage, first that of x, then that of y, and it is
// what was written to it last. pair_program_properties builds on this schedule.
//
// `watch` picks any word of either axis. Asked of the surroundings, and proven of the sequencer by
// pair_play_properties: nothing is written while a new program reads its words.

`default_nettype none

module pair_words_properties (
    input wire        clock,
    input wire        write,
    input wire        write_y,
    input wire [3:0]  write_address,
    input wire [31:0] write_data,
    input wire        start,
    input wire [4:0]  watch
);
    wire [31:0] word;
    wire is_step, is_remainder, is_gain, is_low, is_high, is_min, is_max, is_park, is_max_step;
    dac_pair_words idle (
        .clock(clock), .write(write), .write_y(write_y), .write_address(write_address), .write_data(write_data),
        .start(start), .word(word), .is_step(is_step), .is_remainder(is_remainder), .is_gain(is_gain),
        .is_low(is_low), .is_high(is_high), .is_min(is_min), .is_max(is_max), .is_park(is_park),
        .is_max_step(is_max_step)
    );

    reg [5:0] stage;  // clocks since the start
    reg watching, known, of_y, reads;
    reg [3:0] number;
    reg [31:0] written;
    initial begin
        stage = 63;
        watching = 0;
        known = 0;
        reads = 0;
    end
    always @* if (write) assume (stage > 38);
    always @* if (start) assume (stage > 38);
    always @(posedge clock) begin
        stage <= start ? 0 : stage != 63 ? stage + 1 : 63;
        watching <= 1;
        if (!watching) {of_y, number} <= watch;
        if (watching && write && write_y == of_y && write_address == number) begin
            known <= 1;
            written <= write_data;
        end
    end

    // The stage at which the word of x is there.
    reg [5:0] at;
    always @* case (number)
        4'd0: at = 6;
        4'd1: at = 3;
        4'd2: at = 1;
        4'd3: at = 17;
        4'd4: at = 21;
        4'd5: at = 30;
        4'd6: at = 32;
        4'd7: at = 34;
        4'd8: at = 38;
        4'd9: at = 36;
        default: at = 62;
    endcase

    wire [31:0]
        idle__words__0, idle__words__1, idle__words__2, idle__words__3, idle__words__4, idle__words__5,
        idle__words__6, idle__words__7, idle__words__8, idle__words__9, idle__words__10, idle__words__11,
        idle__words__12, idle__words__13, idle__words__14, idle__words__15, idle__words__16, idle__words__17,
        idle__words__18, idle__words__19, idle__words__20, idle__words__21, idle__words__22, idle__words__23,
        idle__words__24, idle__words__25, idle__words__26, idle__words__27, idle__words__28, idle__words__29,
        idle__words__30, idle__words__31;
    wire [32*32-1:0] words = {
        idle__words__31, idle__words__30, idle__words__29, idle__words__28, idle__words__27, idle__words__26,
        idle__words__25, idle__words__24, idle__words__23, idle__words__22, idle__words__21, idle__words__20,
        idle__words__19, idle__words__18, idle__words__17, idle__words__16, idle__words__15, idle__words__14,
        idle__words__13, idle__words__12, idle__words__11, idle__words__10, idle__words__9, idle__words__8,
        idle__words__7, idle__words__6, idle__words__5, idle__words__4, idle__words__3, idle__words__2,
        idle__words__1, idle__words__0
    };

    // The properties.
    always @* begin
        if (known) assert (words[32*{of_y, number} +: 32] == written);
        assert (is_remainder == (stage == 3 || stage == 4));
        assert (is_step == (stage == 6 || stage == 7));
        assert (is_gain == (stage == 17 || stage == 18));
        assert (is_low == (stage == 21 || stage == 22));
        assert (is_high == (stage == 30 || stage == 31));
        assert (is_min == (stage == 32 || stage == 33));
        assert (is_max == (stage == 34 || stage == 35));
        assert (is_park == (stage == 36 || stage == 37));
        assert (is_max_step == (stage == 38 || stage == 39));
        if (watching && known && number < 10 && stage == at + of_y) assert (word == written);
        cover (known && number == 0 && of_y && stage == at + 1);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive: the stage of the module.
    wire [5:0] idle__stage;
    always @* begin
        assert (idle__stage == stage);
        if (known) assert (watching);
    end
`endif
endmodule

`default_nettype wire
