// From sample to target: clamp(round((gain sample + offset) / 2^GAIN_Q), code_min, code_max), ties up; the park code
// where no scan plays. Never a wrap.
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
    parameter [63:0] POWER_UP_CODE = 0,
    parameter LATENCY = PLAIN_MULTIPLIER ? 8 : 15  // derived: do not set it
) (
    input  wire                          clock,
    input  wire                          write,
    input  wire [3:0]                    write_address,
    input  wire [31:0]                   write_data,
    input  wire [LATENCY+1:0]            loads,
    input  wire signed [SAMPLE_BITS-1:0] sample,
    input  wire                          running,   // a scan plays; belongs to the sample of LATENCY - 2 clocks ago
    output reg  [DAC_BITS-1:0]           target,
    output reg  [DAC_BITS-1:0]           max_step,    // one clock after its target
    output reg  [DAC_BITS-1:0]           step_inverse,
    output reg                           clamped    // with its target: a limit has changed it
);
    localparam [3:0] GAIN = 4'd3, OFFSET_LOW = 4'd4, OFFSET_HIGH = 4'd5;
    localparam [3:0] CODE_MIN = 4'd6, CODE_MAX = 4'd7, MAX_STEP = 4'd8, PARK_CODE = 4'd9;

    localparam GAIN_Q = 16 + SAMPLE_BITS - DAC_BITS;
    localparam LOW_BITS = GAIN_Q < SAMPLE_BITS ? GAIN_Q : SAMPLE_BITS;  // bits of the offset added in the product
    localparam SUM_BITS = SAMPLE_BITS + 18;  // |gain sample| <= 2^(SAMPLE_BITS + 16), and the offset is below that
    localparam HIGH_BITS = SUM_BITS - LOW_BITS;
    localparam CODE_BITS = DAC_BITS + 2;
    localparam CODE_SHIFT = GAIN_Q - LOW_BITS;

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

    wire signed [HIGH_BITS-1:0] product;
    wire [LOW_BITS-1:0] low;
    wire [HIGH_BITS-1:0] high;

    // The offset - code_min + a half, which turns the floor into a rounding.
    dac_offset #(.BITS(SUM_BITS), .LOW_BITS(LOW_BITS), .GAIN_Q(GAIN_Q), .CODE_BITS(DAC_BITS)) offset (
        .clock(clock),
        .write_low(write && write_address == OFFSET_LOW), .write_high(write && write_address == OFFSET_HIGH),
        .data(write_data[25:0]), .minus_min(minus_min),
        .load_low(loads[PLAIN_MULTIPLIER ? 1 : 0]), .load_high(loads[LATENCY-5]),
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
                .A_BITS(SAMPLE_BITS), .B_BITS(18), .DROP(LOW_BITS), .RESULT_BITS(HIGH_BITS)
            ) multiply (.clock(clock), .a(sample), .b(gain), .low(low), .result(product));
        end else begin : digits
            wire [19:0] recoded = {{2{write_data[17]}}, write_data[17:0]} + {10{2'b01}};
            wire [19:0] gain;
            genvar i;
            for (i = 0; i < 10; i = i + 1) begin : digit
                dac_register #(.BITS(2), .POWER_UP(1)) word (
                    .clock(clock), .write(write && write_address == GAIN), .data(recoded[2*i +: 2]), .load(loads[i]),
                    .value(gain[2*i +: 2])
                );
            end
            dac_multiply_digits #(
                .A_BITS(SAMPLE_BITS), .DIGITS(10), .DROP(LOW_BITS), .RESULT_BITS(HIGH_BITS)
            ) multiply (.clock(clock), .a(sample), .low(low), .digits(gain), .result(product));
        end
    endgenerate

    // Registers of the playing program.
    reg [CODE_BITS-1:0] span;       // code_max - code_min
    reg [CODE_BITS-1:0] park_room;  // code_max - park_code
    reg [DAC_BITS-1:0] code_max;
    always @(posedge clock) begin
        if (loads[LATENCY-3]) span <= {2'b00, idle_max} + {minus_min[DAC_BITS], minus_min};
        if (loads[LATENCY-2]) park_room <= {2'b00, idle_max} + {2'b11, idle_park_inverse} + 1;
        if (loads[LATENCY-1]) code_max <= idle_max;
        if (loads[LATENCY+1]) begin
            max_step <= idle_step;
            step_inverse <= ~idle_step;
        end
    end

    wire signed [HIGH_BITS-1:0] sum = product + $signed(high);
    wire signed [HIGH_BITS-1:0] rounded = sum >>> CODE_SHIFT;
    reg [CODE_BITS-1:0] over_min, held_inverse, room;
    reg [DAC_BITS-1:0] room_inverse;
    reg is_low, was_low, clamps;
    wire [CODE_BITS-1:0] room_left = running ? room : park_room;
    wire unused_sum = &{rounded, room_left};

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
        over_min <= rounded[CODE_BITS-1:0];

        held_inverse <= over_min[CODE_BITS-1] ? {CODE_BITS{1'b1}} : ~over_min;
        is_low <= over_min[CODE_BITS-1];

        room <= span + held_inverse + 1;
        was_low <= is_low;

        room_inverse <= running && room[CODE_BITS-1] ? {DAC_BITS{1'b1}} : ~room_left[DAC_BITS-1:0];
        clamps <= running && (was_low || room[CODE_BITS-1]);

        target <= code_max + room_inverse + 1;
        clamped <= clamps;
    end
endmodule

`default_nettype wire
