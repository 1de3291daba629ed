// Whether the idle table of an axis is whole: 2^INDEX_BITS words, of a direct one as many as its period has, or the
// Fourier words of its harmonics, whichever of them the program has. Words are counted, in any order.

`default_nettype none

module dac_whole_table #(
    parameter INTERPOLATED = 1,
    parameter INDEX_BITS = 11,
    parameter HARMONICS = 0
) (
    input  wire        clock,
    input  wire        take,
    input  wire        write_program,
    input  wire        write_table,
    input  wire        write_fourier,
    input  wire [3:0]  address,
    input  wire [31:0] data,
    output wire        whole
);
    localparam [3:0] PERIOD_WORD = 4'd2, HARMONICS_WORD = 4'd10;
    localparam RENDERS = HARMONICS != 0 ? 1 : 0;
    // Bits of the most Fourier words less one, 2 HARMONICS.
    localparam FOURIER_BITS = HARMONICS > 511 ? 11 : HARMONICS > 255 ? 10 : HARMONICS > 127 ? 9 : HARMONICS > 63 ? 8 :
                              HARMONICS > 31 ? 7 : HARMONICS > 15 ? 6 : 5;
    localparam BITS = RENDERS && FOURIER_BITS > INDEX_BITS ? FOURIER_BITS : INDEX_BITS;
    localparam [BITS:0] LENGTH = {{BITS{1'b0}}, 1'b1} << INDEX_BITS;

    wire [BITS:0] needed;
    wire [BITS:0] length;
    generate
        if (INTERPOLATED != 0) begin : fixed
            assign length = LENGTH;
        end else begin : direct
            reg [INDEX_BITS:0] period;
            initial period = 0;
            always @(posedge clock)
                if (write_program && address == PERIOD_WORD) period <= data[INDEX_BITS:0];
            wire [BITS+32:0] wide = {{BITS+32-INDEX_BITS{1'b0}}, period};
            wire unused = &wide[BITS+32:BITS+1];
            assign length = wide[BITS:0];
        end
        if (RENDERS) begin : renders
            reg [9:0] harmonics;
            initial harmonics = 0;
            always @(posedge clock)
                if (write_program && address == HARMONICS_WORD) harmonics <= data[9:0];
            wire [BITS+32:0] wide = {{BITS+22{1'b0}}, harmonics, 1'b1};
            wire unused = &wide[BITS+32:BITS+1];
            assign needed = harmonics != 0 ? wide[BITS:0] : length;
        end else begin : plays
            assign needed = length;
            wire unused = write_fourier;
        end
    endgenerate

    // Counts no further than any program needs: 2^BITS.
    reg [BITS:0] count;
    initial count = 0;
    wire counts = write_table || (RENDERS && write_fourier);
    always @(posedge clock)
        if (take) count <= 0;
        else if (counts && !count[BITS]) count <= count + 1;
    assign whole = count >= needed;
    wire unused_bits = &{write_program, address, data};

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (INTERPOLATED != 0 && INTERPOLATED != 1 && INTERPOLATED != 3) begin : guard_0
            dac_whole_table_INTERPOLATED_is_not_0_1_or_3 stop ();
        end
        if (INDEX_BITS < 2 || INDEX_BITS > 16) begin : guard_1
            dac_whole_table_INDEX_BITS_is_not_2_to_16 stop ();
        end
        if (HARMONICS < 0 || HARMONICS > 512) begin : guard_2
            dac_whole_table_HARMONICS_is_not_0_to_512 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
