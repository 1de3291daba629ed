// Wishbone B4 slave, classic cycles, of 32 bits in front of the host port of dac_sequencer: registers, tables and
// Fourier words by dac_bus. docs/registers.md is the map.
//
// Every cycle is terminated for one clock, by ack, or by err if the access failed; what fails has no effect. ack comes
// two clocks after the strobe, or eight after that of a request to the sequencer. The select lines of a read are
// ignored. The address is that of a byte without its two lowest bits. A master that gives a cycle up is not answered:
// its access has happened or not.
//
// reset is synchronous. It drops the access that is under way, and does not reach the sequencer.

`default_nettype none

module dac_wishbone #(
    parameter ADDRESS_BITS = 20,     // of addresses of bytes; what is above bit 19 has to be 0
    parameter DAC_BITS = 16,         // from here on those of the sequencer
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter Y_WORD_BITS = 16,
    parameter COUNT_BITS = 16,
    parameter FOURIER = 0,
    parameter HARMONICS = 64,
    parameter SHAPING = 0,
    parameter COMMIT_MODES = 0,
    parameter PIXEL_INDEX_BITS = 0,  // 14 or less
    parameter SLOW_PART = 0,         // then X_INDEX_BITS, Y_INDEX_BITS and SLOW_INDEX_BITS are 13 or less
    parameter SLOW_INDEX_BITS = 7
) (
    input  wire                    clock,
    input  wire                    reset,
    input  wire                    wb_cyc_i,
    input  wire                    wb_stb_i,
    input  wire                    wb_we_i,
    input  wire [ADDRESS_BITS-1:2] wb_adr_i,
    input  wire [3:0]              wb_sel_i,
    input  wire [31:0]             wb_dat_i,
    output wire [31:0]             wb_dat_o,
    output wire                    wb_ack_o,
    output wire                    wb_err_o,
    output wire                    irq,              // interrupt
    // the host port of the sequencer, or of NAME_top
    output wire                    write,
    output wire [2:0]              write_region,
    output wire [15:0]             write_address,
    output wire [31:0]             write_data,
    input  wire                    writable,
    input  wire                    refused,
    output wire                    commit,
    output wire [1:0]              commit_mode,
    output wire                    withdraw,
    input  wire                    committed,
    input  wire                    can_keep,         // 0 without COMMIT_MODES
    input  wire                    booting,          // 0 without dac_boot
    input  wire                    missing,          // 0 without dac_boot
    output wire                    arm,
    output wire [15:0]             arm_frames,
    output wire                    trigger,
    output wire                    park,
    output wire                    clear_faults,
    input  wire                    armed,
    input  wire                    running,
    input  wire                    busy,
    input  wire                    playing,
    input  wire                    parked,
    input  wire [3:0]              faults,
    input  wire [4*COUNT_BITS-1:0] fault_counts
);
    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (ADDRESS_BITS < 20 || ADDRESS_BITS > 64) begin : guard_0
            dac_wishbone_ADDRESS_BITS_is_not_20_to_64 stop ();
        end
    endgenerate

    wire cycle = wb_cyc_i && wb_stb_i;
    reg works, waits;  // an access is under way; its master still waits for it
    wire done, failed;
    wire [31:0] read_data;
    wire start = cycle && !works && !reset;
    wire [ADDRESS_BITS:0] above = {1'b0, wb_adr_i, 2'b00} >> 20;
    wire outside = above != 0;

    initial begin
        works = 1'b0;
        waits = 1'b0;
    end
    always @(posedge clock) begin
        works <= !reset && (start || (works && !done));
        waits <= !reset && cycle && (start || waits) && !done;
    end
    assign wb_ack_o = done && waits && cycle && !failed;
    assign wb_err_o = done && waits && cycle && failed;
    assign wb_dat_o = read_data;

    // An address above the map becomes one that is no multiple of 4, which fails.
    dac_bus #(
        .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS),
        .COUNT_BITS(COUNT_BITS), .FOURIER(FOURIER), .HARMONICS(HARMONICS), .SHAPING(SHAPING),
        .COMMIT_MODES(COMMIT_MODES), .PIXEL_INDEX_BITS(PIXEL_INDEX_BITS), .SLOW_PART(SLOW_PART),
        .SLOW_INDEX_BITS(SLOW_INDEX_BITS)
    ) registers (
        .clock(clock), .reset(reset), .request(start), .request_write(wb_we_i),
        .request_address({wb_adr_i[19:2], {2{outside}}}), .request_data(wb_dat_i), .request_bytes(wb_sel_i),
        .done(done), .failed(failed), .read_data(read_data), .irq(irq),
        .write(write), .write_region(write_region), .write_address(write_address),
        .write_data(write_data), .writable(writable), .refused(refused), .commit(commit), .commit_mode(commit_mode),
        .withdraw(withdraw), .committed(committed), .can_keep(can_keep), .booting(booting),
        .missing(missing), .arm(arm), .arm_frames(arm_frames),
        .trigger(trigger), .park(park), .clear_faults(clear_faults), .armed(armed), .running(running), .busy(busy),
        .playing(playing), .parked(parked), .faults(faults), .fault_counts(fault_counts)
    );
endmodule

`default_nettype wire
