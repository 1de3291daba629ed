// The processor of the program loader: 32-bit words in 8-bit steps, one accumulator, and two pointers.
//
// It is made to be small: a memory of bytes, an adder of 8 bits, and a program of 16-bit instructions in block RAM
// (dac_loader_program.v; its source is firmware_templates/loader/).
//
//   0ooo ssmm vvvvvvvv   a = a o operand, 5 clocks; o: load, add, subtract, compare, and, exclusive or, store,
//                        increment (of memory; carry where it has come to 0). s + 1 bytes of memory; what is missing
//                        of 4 is 0. m: 0 the number v (s = 1: a itself), 1 at v (from 224 on: inputs), 2 at p, which
//                        goes on by s + 1, 3 the same, with the sign of the last byte
//   1000 00tt tttttttt   jump to t, 2 clocks; 1001: if zero, 1010: if not, 1011: if carry, 1100: if not; 1101: call
//   1110 cccc cccccccc   by bits of c: 0 return, 1 p = a, 2 p = q, 3 q = p (2 and 3: exchange), 4 a step of CRC-32 (8
//                        clocks), 5 write a to the sequencer at p, p = p + 1, 6 region = a, 7 requests a, 8 send a
//   1111 vvvv vvvvvvvv   p = v
//
// Zero is that of the accumulator after the last o (of a - operand after a comparison), carry that of the last add,
// subtract, compare (1 where there was nothing to borrow) or increment.

`default_nettype none

module dac_loader_core #(
    parameter ADDRESS_BITS = 11,  // of the memory
    parameter TARGET_BITS = 10    // of the program
) (
    input  wire                    clock,
    input  wire                    reset,
    output wire [ADDRESS_BITS-1:0] read_address,   // its byte is there a clock later
    output wire                    reads_input,
    input  wire [7:0]              read_data,
    output wire                    write,
    output reg  [ADDRESS_BITS-1:0] write_address,
    output wire [7:0]              write_data,
    output reg  [31:0]             a,
    output reg  [ADDRESS_BITS-1:0] p,
    output wire                    program_write,  // to the sequencer, of a
    output reg  [2:0]              program_region,
    output wire                    request,        // of a, for one clock
    output wire                    send
);
    localparam [2:0] LOAD = 3'd0, ADD = 3'd1, SUBTRACT = 3'd2, COMPARE = 3'd3, AND = 3'd4, EXCLUSIVE_OR = 3'd5;
    localparam [2:0] STORE = 3'd6, INCREMENT = 3'd7;
    localparam [2:0] JUMP_IF_ZERO = 3'd1, JUMP_IF_NOT_ZERO = 3'd2, JUMP_IF_CARRY = 3'd3, JUMP_IF_NOT_CARRY = 3'd4;
    localparam [2:0] CALL = 3'd5, CONTROL = 3'd6, SET_P = 3'd7;
    localparam [2:0] FIRST = 3'd0, LAST_BYTE = 3'd4, FETCH = 3'd7;
    localparam [31:0] POLYNOMIAL = 32'hedb88320;

    reg [2:0] step;
    reg [TARGET_BITS-1:0] pc, return_1, return_2, return_3;
    reg [ADDRESS_BITS-1:0] q;
    reg zero, carry, sign;
    wire [15:0] instruction;
    initial begin
        step = FETCH;
        pc = 0;
        {return_1, return_2, return_3} = 0;
        a = 32'd0;
        p = 0;
        q = 0;
        write_address = 0;
        program_region = 3'd0;
        {zero, carry, sign} = 3'd0;
    end

    wire computes = !instruction[15];
    wire [2:0] operation = instruction[14:12];
    wire [1:0] size = instruction[11:10];
    wire [1:0] mode = instruction[9:8];
    wire [7:0] value = instruction[7:0];
    wire controls = !computes && operation == CONTROL;
    wire crc = controls && instruction[4];
    wire first = step == FIRST;
    wire fetches = step == FETCH || (computes && step == LAST_BYTE);
    wire control = first && controls;

    dac_loader_program #(.TARGET_BITS(TARGET_BITS)) program_memory (
        .clock(clock), .enable(fetches), .address(pc), .instruction(instruction)
    );

    // Where to go on.
    wire jumps = (operation == 3'd0) || (operation == JUMP_IF_ZERO && zero) ||
                 (operation == JUMP_IF_NOT_ZERO && !zero) || (operation == JUMP_IF_CARRY && carry) ||
                 (operation == JUMP_IF_NOT_CARRY && !carry) || operation == CALL;
    wire calls = first && !computes && operation == CALL;
    wire returns = control && instruction[0];
    always @(posedge clock) begin
        if (reset)
            step <= FETCH;
        else
            step <= fetches ? FIRST : computes || crc ? step + 3'd1 : FETCH;
        if (reset)
            pc <= 0;
        else if (fetches)
            pc <= pc + 1;
        else if (returns)
            pc <= return_1;
        else if (first && !computes && jumps)
            pc <= instruction[TARGET_BITS-1:0];
        if (calls || returns) begin
            return_1 <= calls ? pc : return_2;
            return_2 <= calls ? return_1 : return_3;
            return_3 <= return_2;
        end
    end

    // The byte of this step was asked for in the one before.
    wire [1:0] at = step[1:0];
    wire asks = computes && !step[2] && at <= size;  // a byte is asked for
    reg loaded;                                        // it has come
    wire by_pointer = mode[1];
    wire [1:0] low = value[1:0] + at;
    assign read_address = by_pointer ? p : {{ADDRESS_BITS-8{1'b0}}, value[7:2], low};
    assign reads_input = !by_pointer && value[7:5] == 3'd7;
    initial loaded = 1'b0;
    always @(posedge clock) begin
        loaded <= asks;
        write_address <= read_address;
        if (loaded) sign <= read_data[7];
    end

    wire steps = computes && !first && step != FETCH;  // the last only after a reset
    wire begins = step == 3'd1;
    wire itself = mode == 2'd0 && size[0];
    wire fill = operation == INCREMENT || (mode == 2'd3 && sign);
    wire [7:0] from_memory = loaded ? read_data : {8{fill}};
    wire [7:0] number = itself ? a[7:0] : begins ? value : 8'd0;
    wire [7:0] operand = mode == 2'd0 ? number : from_memory;

    wire subtracts = operation == SUBTRACT || operation == COMPARE;
    wire carry_in = begins ? operation != ADD : carry;  // an increment adds 1
    wire [7:0] left = operation == INCREMENT ? 8'd0 : a[7:0];
    wire [8:0] sum = {1'b0, left} + {1'b0, operand ^ {8{subtracts}}} + {8'd0, carry_in};
    reg [7:0] result;
    always @* begin
        case (operation)
            LOAD: result = operand;
            AND: result = a[7:0] & operand;
            EXCLUSIVE_OR: result = a[7:0] ^ operand;
            STORE, INCREMENT: result = a[7:0];
            default: result = sum[7:0];
        endcase
    end

    wire adds = operation == ADD || subtracts || operation == INCREMENT;
    always @(posedge clock) begin
        if (steps) begin
            a <= {operation == COMPARE ? a[7:0] : result, a[31:8]};
            zero <= result == 8'd0 && (begins || zero);
            if (adds) carry <= sum[8];
        end else if (crc)
            a <= {1'b0, a[31:1]} ^ (a[0] ? POLYNOMIAL : 32'd0);
    end

    assign write = steps && loaded && (operation == STORE || operation == INCREMENT);
    assign write_data = operation == STORE ? a[7:0] : sum[7:0];

    // Pointers.
    wire sets_p = first && !computes && operation == SET_P;
    wire [ADDRESS_BITS+11:0] number_wide = {{ADDRESS_BITS{1'b0}}, instruction[11:0]};
    wire unused = &{number_wide, instruction[11:9], sum};
    always @(posedge clock) begin
        if (sets_p)
            p <= number_wide[ADDRESS_BITS-1:0];
        else if (control && instruction[1])
            p <= a[ADDRESS_BITS-1:0];
        else if (control && instruction[2])
            p <= q;
        else if ((by_pointer && asks) || program_write)
            p <= p + 1;
        if (control && instruction[3]) q <= p;
        if (control && instruction[6]) program_region <= a[2:0];
    end

    assign program_write = control && instruction[5];
    assign request = control && instruction[7];
    assign send = control && instruction[8];

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (ADDRESS_BITS < 11 || ADDRESS_BITS > 16) begin : guard_0
            dac_loader_core_ADDRESS_BITS_is_not_11_to_16 stop ();
        end
        if (TARGET_BITS != 10) begin : guard_1
            dac_loader_core_TARGET_BITS_is_not_10 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
