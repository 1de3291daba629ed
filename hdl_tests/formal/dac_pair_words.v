// In the place of dac_pair_words for the proofs: its schedule, without its memory. pair_words_properties proves that
// the module has this schedule, and that its words are those that were written; here they are any, and a harness
// assumes of them what it needs.

`default_nettype none

module dac_pair_words (
    input  wire        clock,
    input  wire        write,
    input  wire        write_y,
    input  wire [3:0]  write_address,
    input  wire [31:0] write_data,
    input  wire        start,
    output wire [31:0] word,
    output wire        is_step,
    output wire        is_remainder,
    output wire        is_gain,
    output wire        is_low,
    output wire        is_high,
    output wire        is_min,
    output wire        is_max,
    output wire        is_park,
    output wire        is_max_step
);
    (* anyseq *) wire [31:0] any;
    reg [5:0] stage;
    initial stage = 63;
    always @(posedge clock) stage <= start ? 0 : stage != 63 ? stage + 1 : 63;
    assign word = any;
    assign is_remainder = stage == 3 || stage == 4;
    assign is_step = stage == 6 || stage == 7;
    assign is_gain = stage == 17 || stage == 18;
    assign is_low = stage == 21 || stage == 22;
    assign is_high = stage == 30 || stage == 31;
    assign is_min = stage == 32 || stage == 33;
    assign is_max = stage == 34 || stage == 35;
    assign is_park = stage == 36 || stage == 37;
    assign is_max_step = stage == 38 || stage == 39;
endmodule

`default_nettype wire
