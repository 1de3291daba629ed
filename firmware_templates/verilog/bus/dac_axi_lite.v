// AXI4-Lite slave of 32 bits in front of the host port of dac_sequencer: registers, tables and Fourier words, by
// dac_bus. docs/registers.md is the map.
//
// Every access is answered, with OKAY, or with SLVERR if it failed; what fails has no effect. Write address and write
// data may come in any order. Writes and reads take turns; a response that waits for its ready holds only its own
// direction. A beat that is valid stays as it is until it is ready, and no valid waits for a ready.
//
// reset is synchronous, and high where ARESETn of AXI is low. It drops accesses that are under way: one that has not
// been answered has happened or not. It does not reach the sequencer, whose idle program keeps its words.

`default_nettype none

module dac_axi_lite #(
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
    input  wire [ADDRESS_BITS-1:0] s_axi_awaddr,
    input  wire [2:0]              s_axi_awprot,     // ignored
    input  wire                    s_axi_awvalid,
    output wire                    s_axi_awready,
    input  wire [31:0]             s_axi_wdata,
    input  wire [3:0]              s_axi_wstrb,
    input  wire                    s_axi_wvalid,
    output wire                    s_axi_wready,
    output reg  [1:0]              s_axi_bresp,
    output reg                     s_axi_bvalid,
    input  wire                    s_axi_bready,
    input  wire [ADDRESS_BITS-1:0] s_axi_araddr,
    input  wire [2:0]              s_axi_arprot,     // ignored
    input  wire                    s_axi_arvalid,
    output wire                    s_axi_arready,
    output reg  [31:0]             s_axi_rdata,
    output reg  [1:0]              s_axi_rresp,
    output reg                     s_axi_rvalid,
    input  wire                    s_axi_rready,
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
    localparam [1:0] OKAY = 2'b00, SLVERR = 2'b10;

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason. An unknown
    // module is the one complaint of Verilog-2005 that every tool takes for an error.
    generate
        if (ADDRESS_BITS < 20 || ADDRESS_BITS > 64) begin : guard_0
            dac_axi_lite_ADDRESS_BITS_is_not_20_to_64 stop ();
        end
    endgenerate

    // One beat of each channel is kept until its access starts.
    reg aw_kept, w_kept, ar_kept;
    reg [ADDRESS_BITS-1:0] aw_address, ar_address;
    reg [31:0] w_data;
    reg [3:0] w_bytes;
    assign s_axi_awready = !aw_kept && !reset;
    assign s_axi_wready = !w_kept && !reset;
    assign s_axi_arready = !ar_kept && !reset;

    reg works, writes;  // an access is under way; it, or the last one, is a write
    wire done, failed;
    wire [31:0] read_data;
    wire may_write = aw_kept && w_kept && !s_axi_bvalid;
    wire may_read = ar_kept && !s_axi_rvalid;
    wire start_write = !works && may_write && !(writes && may_read);
    wire start_read = !works && may_read && !start_write;
    wire start = start_write || start_read;
    wire [ADDRESS_BITS-1:0] address = start_write ? aw_address : ar_address;
    wire [ADDRESS_BITS:0] above = {1'b0, address} >> 20;
    wire outside = above != 0;

    initial begin
        aw_kept = 1'b0;
        w_kept = 1'b0;
        ar_kept = 1'b0;
        works = 1'b0;
        writes = 1'b0;
        s_axi_bresp = OKAY;
        s_axi_bvalid = 1'b0;
        s_axi_rdata = 32'd0;
        s_axi_rresp = OKAY;
        s_axi_rvalid = 1'b0;
    end

    always @(posedge clock) begin
        if (s_axi_awvalid && s_axi_awready) aw_address <= s_axi_awaddr;
        if (s_axi_wvalid && s_axi_wready) begin
            w_data <= s_axi_wdata;
            w_bytes <= s_axi_wstrb;
        end
        if (s_axi_arvalid && s_axi_arready) ar_address <= s_axi_araddr;
        if (done && writes) s_axi_bresp <= failed ? SLVERR : OKAY;
        if (done && !writes) begin
            s_axi_rresp <= failed ? SLVERR : OKAY;
            s_axi_rdata <= read_data;
        end
        if (reset) begin
            aw_kept <= 1'b0;
            w_kept <= 1'b0;
            ar_kept <= 1'b0;
            works <= 1'b0;
            writes <= 1'b0;
            s_axi_bvalid <= 1'b0;
            s_axi_rvalid <= 1'b0;
        end else begin
            aw_kept <= aw_kept ? !start_write : s_axi_awvalid;
            w_kept <= w_kept ? !start_write : s_axi_wvalid;
            ar_kept <= ar_kept ? !start_read : s_axi_arvalid;
            works <= start || (works && !done);
            if (start) writes <= start_write;
            s_axi_bvalid <= s_axi_bvalid ? !s_axi_bready : done && writes;
            s_axi_rvalid <= s_axi_rvalid ? !s_axi_rready : done && !writes;
        end
    end
    wire unused = &{s_axi_awprot, s_axi_arprot};

    // An address above the map becomes one that is no multiple of 4, which fails.
    dac_bus #(
        .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS),
        .COUNT_BITS(COUNT_BITS), .FOURIER(FOURIER), .HARMONICS(HARMONICS), .SHAPING(SHAPING),
        .COMMIT_MODES(COMMIT_MODES), .PIXEL_INDEX_BITS(PIXEL_INDEX_BITS), .SLOW_PART(SLOW_PART),
        .SLOW_INDEX_BITS(SLOW_INDEX_BITS)
    ) registers (
        .clock(clock), .reset(reset), .request(start), .request_write(start_write),
        .request_address(address[19:0] | {18'd0, {2{outside}}}), .request_data(w_data), .request_bytes(w_bytes),
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
