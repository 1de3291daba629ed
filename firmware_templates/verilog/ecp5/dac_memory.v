// dac_memory of the ECP5: block RAMs DP16KD whose output register is used, in the place of one of the address.
//
// `word` is that of the `address` of two clocks ago, as there. A block has 1024 words of 18 bits, 2048 of 9, 4096 of 4,
// 8192 of 2 or 16384 of 1: as many stand side by side as a word has bits. A memory of more words is left to the tool.

`default_nettype none

module dac_memory #(
    parameter BITS = 16,
    parameter ADDRESS_BITS = 11
) (
    input  wire                    clock,
    input  wire                    write,
    input  wire [ADDRESS_BITS-1:0] write_address,
    input  wire [BITS-1:0]         write_data,
    input  wire [ADDRESS_BITS-1:0] address,
    output wire [BITS-1:0]         word
);
    localparam WIDTH = // of a block
        ADDRESS_BITS < 11 ? 18 : ADDRESS_BITS == 11 ? 9 : ADDRESS_BITS == 12 ? 4 : ADDRESS_BITS == 13 ? 2 : 1;
    localparam BLOCKS = (BITS + WIDTH - 1) / WIDTH;

    generate
        if (ADDRESS_BITS > 14) begin : inferred
            reg [BITS-1:0] words [0:(1<<ADDRESS_BITS)-1];
            reg [ADDRESS_BITS-1:0] row;
            reg [BITS-1:0] read;
            always @(posedge clock) begin
                if (write) words[write_address] <= write_data;
                row <= address;
                read <= words[row];
            end
            assign word = read;
        end else begin : blocks
            // A word of 18 bits has the enables of its bytes in the lowest bits of the address.
            localparam LOW = ADDRESS_BITS < 11 ? 4 : 14 - ADDRESS_BITS;
            wire [31:0] to = ({{32-ADDRESS_BITS{1'b0}}, write_address} << LOW) | (WIDTH == 18 ? 32'd3 : 32'd0);
            wire [31:0] from = {{32-ADDRESS_BITS{1'b0}}, address} << LOW;
            wire unused_bits = &{to, from};
            genvar i;
            for (i = 0; i < BLOCKS; i = i + 1) begin : block
                localparam [31:0] HERE = BITS - i * WIDTH < WIDTH ? BITS - i * WIDTH : WIDTH;  // bits of the word
                wire [31:0] wide = {{32-HERE{1'b0}}, write_data[i*WIDTH +: HERE]};
                wire [17:0] in = wide[17:0];
                wire [17:0] out;
                assign word[i*WIDTH +: HERE] = out[HERE-1:0];
                wire unused = &{wide, out};
                DP16KD #(
                    .DATA_WIDTH_A(WIDTH), .DATA_WIDTH_B(WIDTH), .REGMODE_A("NOREG"), .REGMODE_B("OUTREG"),
                    .WRITEMODE_A("READBEFOREWRITE"), .WRITEMODE_B("READBEFOREWRITE"), .CLKAMUX("CLKA"),
                    .CLKBMUX("CLKB"), .GSR("DISABLED")
                ) ram (
                    .DIA17(in[17]), .DIA16(in[16]), .DIA15(in[15]), .DIA14(in[14]), .DIA13(in[13]), .DIA12(in[12]),
                    .DIA11(in[11]), .DIA10(in[10]), .DIA9(in[9]), .DIA8(in[8]), .DIA7(in[7]), .DIA6(in[6]),
                    .DIA5(in[5]), .DIA4(in[4]), .DIA3(in[3]), .DIA2(in[2]), .DIA1(in[1]), .DIA0(in[0]),
                    .ADA13(to[13]), .ADA12(to[12]), .ADA11(to[11]), .ADA10(to[10]), .ADA9(to[9]), .ADA8(to[8]),
                    .ADA7(to[7]), .ADA6(to[6]), .ADA5(to[5]), .ADA4(to[4]), .ADA3(to[3]), .ADA2(to[2]),
                    .ADA1(to[1]), .ADA0(to[0]), .CEA(1'b1), .OCEA(1'b1), .CLKA(clock), .WEA(write), .RSTA(1'b0),
                    .CSA2(1'b0), .CSA1(1'b0), .CSA0(1'b0), .ADB13(from[13]), .ADB12(from[12]), .ADB11(from[11]),
                    .ADB10(from[10]), .ADB9(from[9]), .ADB8(from[8]), .ADB7(from[7]), .ADB6(from[6]),
                    .ADB5(from[5]), .ADB4(from[4]), .ADB3(from[3]), .ADB2(from[2]), .ADB1(from[1]), .ADB0(from[0]),
                    .DIB17(1'b0), .DIB16(1'b0), .DIB15(1'b0), .DIB14(1'b0), .DIB13(1'b0), .DIB12(1'b0),
                    .DIB11(1'b0), .DIB10(1'b0), .DIB9(1'b0), .DIB8(1'b0), .DIB7(1'b0), .DIB6(1'b0), .DIB5(1'b0),
                    .DIB4(1'b0), .DIB3(1'b0), .DIB2(1'b0), .DIB1(1'b0), .DIB0(1'b0), .CEB(1'b1), .OCEB(1'b1),
                    .CLKB(clock), .WEB(1'b0), .RSTB(1'b0), .CSB2(1'b0), .CSB1(1'b0), .CSB0(1'b0), .DOB17(out[17]),
                    .DOB16(out[16]), .DOB15(out[15]), .DOB14(out[14]), .DOB13(out[13]), .DOB12(out[12]),
                    .DOB11(out[11]), .DOB10(out[10]), .DOB9(out[9]), .DOB8(out[8]), .DOB7(out[7]), .DOB6(out[6]),
                    .DOB5(out[5]), .DOB4(out[4]), .DOB3(out[3]), .DOB2(out[2]), .DOB1(out[1]), .DOB0(out[0])
                );
            end
        end
    endgenerate

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (BITS < 1) begin : guard_0
            dac_memory_BITS_is_less_than_1 stop ();
        end
        if (ADDRESS_BITS < 1) begin : guard_1
            dac_memory_ADDRESS_BITS_is_less_than_1 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
