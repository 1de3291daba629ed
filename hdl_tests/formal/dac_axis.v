// In the place of dac_axis for the proofs: its ports, and of its inside only which program each stage of the pipeline
// uses.
//
// A program is a colour. The host writes it to a register and to the table; registers at three stages and the bank of
// the table hand their colours to the sample that passes. The code is the four colours a sample has met.

`default_nettype none

module dac_axis #(
    parameter INTERPOLATED = 1,
    parameter INDEX_BITS = 11,
    parameter WORD_BITS = 16,
    parameter DAC_BITS = 16,
    parameter PERIOD_BITS = 31,
    parameter PLAIN_MULTIPLIER = 0,
    parameter SHAPING = 0,
    parameter SPLINE = 0,
    parameter [63:0] POWER_UP_CODE = 0,
    parameter LATENCY = (SPLINE ? 43 : PLAIN_MULTIPLIER ? 10 : 15) + (PLAIN_MULTIPLIER ? 12 : 19) + (SHAPING != 0 ? 1 : 0)
) (
    input  wire                  clock,
    input  wire                  write,
    input  wire [3:0]            write_address,
    input  wire [31:0]           write_data,
    input  wire                  table_write,
    input  wire [INDEX_BITS-1:0] table_address,
    input  wire [WORD_BITS-1:0]  table_data,
    input  wire                  take,
    input  wire [LATENCY-4:0]    ticks,
    input  wire [LATENCY-4:0]    loads,
    input  wire [LATENCY-4:0]    runnings,
    input  wire                  begins,
    input  wire                  bank,
    input  wire                  restart,
    input  wire                  advance,
    output wire [DAC_BITS-1:0]   code,
    output wire                  reached,
    output wire                  clamped
);
    localparam READ_AT = 3, MIDDLE = LATENCY / 2, LAST = LATENCY - 4;

    reg idle;
    reg [1:0] words;  // a word in each bank of the table
    reg [READ_AT-1:0] banks;
    reg first, middle, last;
    reg [LAST+3:0] first_met, word_met, middle_met, last_met;  // shift registers, that follow the sample
    initial begin  // at power-up everything is of one program, of colour 0
        idle = 0;
        words = 0;
        banks = 0;
        first = 0;
        middle = 0;
        last = 0;
        first_met = 0;
        word_met = 0;
        middle_met = 0;
        last_met = 0;
    end
    always @(posedge clock) begin
        if (write && write_address == 4'd0) idle <= write_data[0];
        if (table_write) words[!bank] <= table_data[0];
        banks <= {banks[READ_AT-2:0], bank};
        if (loads[0]) first <= idle;
        if (loads[MIDDLE]) middle <= idle;
        if (loads[LAST]) last <= idle;
    end

    // Colours join the sample; each is there a clock after its register has changed with the load of the same tick.
    always @(posedge clock) begin
        first_met <= {first_met[LAST+2:0], first};
        word_met <= {word_met[LAST+2:0], words[banks[READ_AT-1]]};
        middle_met <= {middle_met[LAST+2:0], middle};
        last_met <= {last_met[LAST+2:0], last};
    end
    localparam AT_CODE = LATENCY - 2;
    assign code = {first_met[AT_CODE], word_met[AT_CODE - READ_AT + 1], middle_met[AT_CODE - MIDDLE],
                   last_met[AT_CODE - LAST]};
    assign reached = restart;
    assign clamped = advance;

`ifndef PROPERTIES_ALONE
    // Every sample under way reads the bank that it was made for: none is that which is written.
    always @* if (table_write) assert (banks == {READ_AT{bank}});
    always @* assert (!(write || table_write) || !(take || loads != 0));
`endif
endmodule

`default_nettype wire
