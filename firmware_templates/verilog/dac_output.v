// From sample to target: clamp(round((gain sample + offset) / 2^GAIN_Q), code_min, code_max), ties up; the park code
// where no scan plays. Never a wrap. With SHAPING, dac_shaper does the rounding.
//
// The limits cost no comparison of two words. With code_min taken off the offset, the sign says what is below it;
// with that taken off the span of the limits, the sign says what is above code_max; and that off code_max is the
// code. To subtract, a value is kept inverted: -x is the inverse of x, and 1.
//
// GAIN_Q is 16 + SAMPLE_BITS - DAC_BITS: a gain of 2^16 makes a full-scale table a full-scale output. One sample a
// clock, the target LATENCY clocks after it. The registers of the program are in here: loads[i] is high in the clock
// before a new program's first sample has been here for i clocks, and each register changes just before that sample
// meets it.

`default_nettype none

module dac_output #(
    parameter SAMPLE_BITS = 20,
    parameter DAC_BITS = 16,
    parameter PLAIN_MULTIPLIER = 0,
    parameter SHAPING = 0,
    parameter [63:0] POWER_UP_CODE = 0,
    parameter LATENCY = (PLAIN_MULTIPLIER ? 8 : 15) + (SHAPING != 0 ? 1 : 0)  // derived: do not set it
) (
    input  wire                          clock,
    input  wire                          write,
    input  wire [3:0]                    write_address,
    input  wire [31:0]                   write_data,
    input  wire [LATENCY+1:0]            loads,
    input  wire                          begins,    // with loads[LATENCY-6]: a scan or a program begins
    input  wire                          tick,      // belongs to the sample of LATENCY - 5 clocks ago
    input  wire signed [SAMPLE_BITS-1:0] sample,
    input  wire                          running,   // a scan plays; belongs to the sample of LATENCY - 2 clocks ago
    output reg  [DAC_BITS-1:0]           target,
    output reg  [DAC_BITS-1:0]           max_step,    // one clock after its target
    output reg  [DAC_BITS-1:0]           step_inverse,
    output reg                           clamped    // with its target: a limit has changed it
);
    localparam [3:0] GAIN = 4'd3, OFFSET_LOW = 4'd4, OFFSET_HIGH = 4'd5;
    localparam [3:0] CODE_MIN = 4'd6, CODE_MAX = 4'd7, MAX_STEP = 4'd8, PARK_CODE = 4'd9, SHAPING_WORD = 4'd11;

    localparam GAIN_Q = 16 + SAMPLE_BITS - DAC_BITS;
    localparam REMAINDER_BITS = 28 - DAC_BITS;
    // Shaping needs a multiplicand that has place for all fraction bits of the offset.
    localparam A_BITS = SHAPING != 0 && !PLAIN_MULTIPLIER && GAIN_Q > SAMPLE_BITS ? GAIN_Q : SAMPLE_BITS;
    // Bits of the offset that are added in the product.
    localparam LOW_BITS = SHAPING != 0 || GAIN_Q < SAMPLE_BITS ? GAIN_Q : SAMPLE_BITS;
    localparam DROP = SHAPING != 0 ? GAIN_Q - REMAINDER_BITS : LOW_BITS;
    // |gain sample| <= 2^(SAMPLE_BITS + 16), and the offset is below that; what is fed back comes on top.
    localparam SUM_BITS = SAMPLE_BITS + (SHAPING != 0 ? 19 : 18);
    localparam HIGH_BITS = SUM_BITS - LOW_BITS;
    localparam PRODUCT_BITS = SUM_BITS - DROP;
    localparam CODE_BITS = DAC_BITS + (SHAPING != 0 ? 3 : 2);

    wire unused = &write_data;
    // Registers of the idle program.
    reg [DAC_BITS:0] minus_min;
    reg [DAC_BITS-1:0] idle_max, idle_park_inverse, idle_step;
    always @(posedge clock) begin
        if (write && write_address == CODE_MIN) minus_min <= -{1'b0, write_data[DAC_BITS-1:0]};
        if (write && write_address == CODE_MAX) idle_max <= write_data[DAC_BITS-1:0];
        if (write && write_address == PARK_CODE) idle_park_inverse <= ~write_data[DAC_BITS-1:0];
        if (write && write_address == MAX_STEP) idle_step <= write_data[DAC_BITS-1:0];
    end

    wire signed [PRODUCT_BITS-1:0] product;
    wire [LOW_BITS-1:0] low;
    wire [HIGH_BITS-1:0] high;

    // The offset - code_min + a half, which turns the floor into a rounding.
    dac_offset #(
        .BITS(SUM_BITS), .LOW_BITS(LOW_BITS), .GAIN_Q(GAIN_Q), .CODE_BITS(DAC_BITS), .HALF(SHAPING != 0 ? 0 : 1)
    ) offset (
        .clock(clock),
        .write_low(write && write_address == OFFSET_LOW), .write_high(write && write_address == OFFSET_HIGH),
        .data(write_data[25:0]), .minus_min(minus_min),
        .load_low(loads[PLAIN_MULTIPLIER ? 1 : 0]), .load_high(loads[LATENCY-(SHAPING != 0 ? 6 : 5)]),
        .low(low), .high(high)
    );

    generate
        if (PLAIN_MULTIPLIER) begin : plain
            wire signed [17:0] gain;
            dac_register #(.BITS(18)) gain_word (
                .clock(clock), .write(write && write_address == GAIN), .data(write_data[17:0]), .load(loads[0]),
                .value(gain)
            );
            dac_multiply_plain #(
                .A_BITS(SAMPLE_BITS), .B_BITS(18), .DROP(DROP), .LOW_BITS(LOW_BITS), .RESULT_BITS(PRODUCT_BITS)
            ) multiply (.clock(clock), .a(sample), .b(gain), .low(low), .result(product));
        end else begin : digits
            wire [19:0] recoded = {{2{write_data[17]}}, write_data[17:0]} + {10{2'b01}};
            wire [19:0] gain;
            wire signed [A_BITS-1:0] multiplicand =
                {{A_BITS-SAMPLE_BITS+1{sample[SAMPLE_BITS-1]}}, sample[SAMPLE_BITS-2:0]};
            genvar i;
            for (i = 0; i < 10; i = i + 1) begin : digit
                dac_register #(.BITS(2), .POWER_UP(1)) word (
                    .clock(clock), .write(write && write_address == GAIN), .data(recoded[2*i +: 2]), .load(loads[i]),
                    .value(gain[2*i +: 2])
                );
            end
            dac_multiply_digits #(
                .A_BITS(A_BITS), .DIGITS(10), .DROP(DROP), .LOW_BITS(LOW_BITS), .RESULT_BITS(PRODUCT_BITS)
            ) multiply (.clock(clock), .a(multiplicand), .low(low), .digits(gain), .result(product));
        end
    endgenerate

    // Registers of the playing program.
    reg [CODE_BITS-1:0] span;       // code_max - code_min
    reg [CODE_BITS-1:0] park_room;  // code_max - park_code
    reg [DAC_BITS-1:0] code_max;
    always @(posedge clock) begin
        if (loads[LATENCY-3])
            span <= {{CODE_BITS-DAC_BITS{1'b0}}, idle_max} + {{CODE_BITS-DAC_BITS-1{minus_min[DAC_BITS]}}, minus_min};
        if (loads[LATENCY-2])
            park_room <= {{CODE_BITS-DAC_BITS{1'b0}}, idle_max} + {{CODE_BITS-DAC_BITS{1'b1}}, idle_park_inverse} + 1;
        if (loads[LATENCY-1]) code_max <= idle_max;
        if (loads[LATENCY+1]) begin
            max_step <= idle_step;
            step_inverse <= ~idle_step;
        end
    end

    wire [CODE_BITS-1:0] rounded;
    generate
        if (SHAPING != 0) begin : shaped
            reg [9:0] idle_shaping;
            reg [CODE_BITS-1:0] floor;
            wire signed [2:0] more;
            wire carry;
            initial idle_shaping = 10'd0;
            always @(posedge clock) begin
                if (write && write_address == SHAPING_WORD) idle_shaping <= {write_data[15:8], write_data[1:0]};
                floor <= product[PRODUCT_BITS-1:REMAINDER_BITS] + high;
            end
            dac_shaper #(.BITS(REMAINDER_BITS), .SHAPING(SHAPING)) shaper (
                .clock(clock), .load(loads[LATENCY-6]), .word({idle_shaping[9:2], 6'd0, idle_shaping[1:0]}),
                .begins(begins), .tick(tick), .fraction(product[REMAINDER_BITS-1:0]), .more(more),
                .carry(carry)
            );
            wire [CODE_BITS:0] with_carry = {floor, 1'b1} + {{CODE_BITS-3{more[2]}}, more, carry};
            wire unused_carry = with_carry[0];
            assign rounded = with_carry[CODE_BITS:1];
        end else begin : unshaped
            wire signed [HIGH_BITS-1:0] sum = product + $signed(high);
            wire signed [HIGH_BITS-1:0] code = sum >>> (GAIN_Q - LOW_BITS);
            wire unused_inputs = &{code, begins, tick, SHAPING_WORD};
            assign rounded = code[CODE_BITS-1:0];
        end
    endgenerate

    reg [CODE_BITS-1:0] over_min, held_inverse, room;
    reg [DAC_BITS-1:0] room_inverse;
    reg is_low, was_low, clamps;
    wire [CODE_BITS-1:0] room_left = running ? room : park_room;
    wire unused_room = &room_left;

    initial begin
        // Nothing moves before the first program: the park code is the code at power-up, and the step is 0.
        park_room = -POWER_UP_CODE[CODE_BITS-1:0];
        code_max = 0;
        room_inverse = POWER_UP_CODE[DAC_BITS-1:0] - 1;
        target = POWER_UP_CODE[DAC_BITS-1:0];
        max_step = 0;
        step_inverse = {DAC_BITS{1'b1}};
        clamped = 1'b0;
    end

    always @(posedge clock) begin
        over_min <= rounded;

        held_inverse <= over_min[CODE_BITS-1] ? {CODE_BITS{1'b1}} : ~over_min;
        is_low <= over_min[CODE_BITS-1];

        room <= span + held_inverse + 1;
        was_low <= is_low;

        room_inverse <= running && room[CODE_BITS-1] ? {DAC_BITS{1'b1}} : ~room_left[DAC_BITS-1:0];
        clamps <= running && (was_low || room[CODE_BITS-1]);

        target <= code_max + room_inverse + 1;
        clamped <= clamps;
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (SAMPLE_BITS < 12 || SAMPLE_BITS > 25) begin : guard_0
            dac_output_SAMPLE_BITS_is_not_12_to_25 stop ();
        end
        if (DAC_BITS < 2 || DAC_BITS > 24) begin : guard_1
            dac_output_DAC_BITS_is_not_2_to_24 stop ();
        end
        if (PLAIN_MULTIPLIER < 0 || PLAIN_MULTIPLIER > 1) begin : guard_2
            dac_output_PLAIN_MULTIPLIER_is_not_0_to_1 stop ();
        end
        if (SHAPING < 0 || SHAPING > 3) begin : guard_3
            dac_output_SHAPING_is_not_0_to_3 stop ();
        end
        if (POWER_UP_CODE >> DAC_BITS != 64'd0) begin : guard_4
            dac_output_POWER_UP_CODE_has_more_than_DAC_BITS stop ();
        end
        if (LATENCY != (PLAIN_MULTIPLIER != 0 ? 8 : 15) + (SHAPING != 0 ? 1 : 0)) begin : guard_5
            dac_output_LATENCY_follows_from_PLAIN_MULTIPLIER_and_SHAPING stop ();
        end
    endgenerate
endmodule

`default_nettype wire
