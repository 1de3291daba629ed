// The program words of both axes, of the idle program: the host writes them, and a new program reads each word in the
// clocks in which its first sample is about to meet it, first that of x, then that of y.

`default_nettype none

module dac_pair_words (
    input  wire        clock,
    input  wire        write,
    input  wire        write_y,   // a word of y
    input  wire [3:0]  write_address,
    input  wire [31:0] write_data,
    input  wire        start,     // on the next clock `stage` is 0
    output reg  [31:0] word,
    output wire        is_step,   // `word` is that of x, and a clock later that of y
    output wire        is_remainder,
    output wire        is_gain,
    output wire        is_low,
    output wire        is_high,
    output wire        is_min,
    output wire        is_max,
    output wire        is_park,
    output wire        is_max_step
);
    localparam [3:0] PHASE_STEP = 4'd0, PHASE_REMAINDER = 4'd1, PHASE_PERIOD = 4'd2, GAIN = 4'd3;
    localparam [3:0] OFFSET_LOW = 4'd4, OFFSET_HIGH = 4'd5, CODE_MIN = 4'd6, CODE_MAX = 4'd7, MAX_STEP = 4'd8;
    localparam [3:0] PARK_CODE = 4'd9, NONE = 4'd15;

    reg [31:0] words [0:31];
    reg [5:0] stage;  // clocks since the first sample of x has begun; stops at 63
    reg [3:0] address, was;
    reg of_y;

    initial begin
        stage = 6'd63;
        was = NONE;
    end

    // What is read at which stage; dac_pair takes it one clock later, or two.
    always @* begin
        case (stage)
            6'd0: {of_y, address} = {1'b0, PHASE_PERIOD};
            6'd1: {of_y, address} = {1'b1, PHASE_PERIOD};
            6'd2: {of_y, address} = {1'b0, PHASE_REMAINDER};
            6'd3: {of_y, address} = {1'b1, PHASE_REMAINDER};
            6'd5: {of_y, address} = {1'b0, PHASE_STEP};
            6'd6: {of_y, address} = {1'b1, PHASE_STEP};
            6'd16: {of_y, address} = {1'b0, GAIN};
            6'd17: {of_y, address} = {1'b1, GAIN};
            6'd20: {of_y, address} = {1'b0, OFFSET_LOW};
            6'd21: {of_y, address} = {1'b1, OFFSET_LOW};
            6'd29: {of_y, address} = {1'b0, OFFSET_HIGH};
            6'd30: {of_y, address} = {1'b1, OFFSET_HIGH};
            6'd31: {of_y, address} = {1'b0, CODE_MIN};
            6'd32: {of_y, address} = {1'b1, CODE_MIN};
            6'd33: {of_y, address} = {1'b0, CODE_MAX};
            6'd34: {of_y, address} = {1'b1, CODE_MAX};
            6'd35: {of_y, address} = {1'b0, PARK_CODE};
            6'd36: {of_y, address} = {1'b1, PARK_CODE};
            6'd37: {of_y, address} = {1'b0, MAX_STEP};
            6'd38: {of_y, address} = {1'b1, MAX_STEP};
            default: {of_y, address} = {1'b0, NONE};
        endcase
    end

    always @(posedge clock) begin
        if (start)
            stage <= 6'd0;
        else if (stage != 6'd63)
            stage <= stage + 1;
        // Nothing is written while a program is taken: said here, it saves the logic for a word that is written and
        // read at once.
        if (write)
            words[{write_y, write_address}] <= write_data;
        else
            word <= words[{of_y, address}];
        was <= address;
    end

    assign is_step = was == PHASE_STEP;
    assign is_remainder = was == PHASE_REMAINDER;
    assign is_gain = was == GAIN;
    assign is_low = was == OFFSET_LOW;
    assign is_high = was == OFFSET_HIGH;
    assign is_min = was == CODE_MIN;
    assign is_max = was == CODE_MAX;
    assign is_park = was == PARK_CODE;
    assign is_max_step = was == MAX_STEP;
endmodule

`default_nettype wire
