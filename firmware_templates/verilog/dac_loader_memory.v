// The memory of the program loader: bytes, one read and one written a clock. It begins with the constants of a device.

`default_nettype none

module dac_loader_memory #(
    parameter ADDRESS_BITS = 11,
    parameter [8*64-1:0] NUMBERS = 0,   // 64 bytes from 0x30 on, the lowest first
    parameter [8*128-1:0] DEVICE = 0    // 128 bytes from 0x100 on
) (
    input  wire                    clock,
    input  wire [ADDRESS_BITS-1:0] read_address,
    output reg  [7:0]              read_data,
    input  wire                    write,
    input  wire [ADDRESS_BITS-1:0] write_address,
    input  wire [7:0]              write_data
);
    localparam NUMBERS_AT = 'h30, DEVICE_AT = 'h100;

    reg [7:0] bytes [0:(1<<ADDRESS_BITS)-1];
    integer i;
    initial begin
        for (i = 0; i < 1 << ADDRESS_BITS; i = i + 1) bytes[i] = 8'd0;
        for (i = 0; i < 64; i = i + 1) bytes[NUMBERS_AT+i] = NUMBERS[8*i +: 8];
        for (i = 0; i < 128; i = i + 1) bytes[DEVICE_AT+i] = DEVICE[8*i +: 8];
    end

    always @(posedge clock) begin
        if (write) bytes[write_address] <= write_data;
        read_data <= bytes[read_address];
    end

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (ADDRESS_BITS < 11 || ADDRESS_BITS > 16) begin : guard_0
            dac_loader_memory_ADDRESS_BITS_is_not_11_to_16 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
