// The writes of the sequencer with a renderer, pipelined or in low area: none meets a program that plays, waits or is
// on its way, and none of the host's meets a rendering.
//
// The host may do anything on any clock. The axes and the renderer are those beside this file.

`default_nettype none

module writes_properties #(
    parameter LOW_AREA = 1
) (
    input wire        clock,
    input wire        reset,
    input wire        write,
    input wire [2:0]  write_region,
    input wire [15:0] write_address,
    input wire [31:0] write_data,
    input wire        commit,
    input wire        withdraw,
    input wire        arm,
    input wire [15:0] arm_frames,
    input wire        trigger,
    input wire        park,
    input wire        clear_faults,
    input wire        tick,
    input wire        underrun
);
    wire writable, refused, committed, armed, running, busy, strobe, swapped_marker;
    wire line_marker, frame_marker, pixel_marker, backward_marker, valid_marker, playing, parked;
    wire [7:0] x_code, y_code;
    wire [3:0] faults;
    wire [4*2-1:0] fault_counts;

    dac_sequencer #(
        .DAC_BITS(8), .X_INDEX_BITS(3), .X_WORD_BITS(8), .Y_INDEX_BITS(3), .Y_WORD_BITS(8), .TICK_BITS(4),
        .LINE_BITS(2), .PERIOD_BITS(8), .COUNT_BITS(2), .PLAIN_MULTIPLIER(1), .LOW_AREA(LOW_AREA), .FOURIER(1)
    ) uut (
        .clock(clock), .reset(reset), .write(write), .write_region(write_region), .write_address(write_address),
        .write_data(write_data), .writable(writable), .refused(refused), .commit(commit), .withdraw(withdraw),
        .committed(committed), .arm(arm), .arm_frames(arm_frames), .trigger(trigger), .park(park),
        .clear_faults(clear_faults), .armed(armed), .running(running), .tick(tick), .underrun(underrun), .busy(busy),
        .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(line_marker), .frame_marker(frame_marker),
        .pixel_marker(pixel_marker), .backward_marker(backward_marker), .valid_marker(valid_marker),
        .swapped_marker(swapped_marker), .playing(playing), .parked(parked), .faults(faults),
        .fault_counts(fault_counts)
    );

    wire uut__take, uut__bank, uut__host_write, uut__host_commit, uut__rendering, uut__rendered;
    wire uut__x_table_write, uut__y_table_write, uut__x_write, uut__y_write, uut__scan_write, uut__banks__draining;
    wire table_write = uut__x_table_write || uut__y_table_write;
    wire register_write = uut__x_write || uut__y_write || uut__scan_write;
    always @* begin
        if (table_write || register_write) assert (!committed && !uut__banks__draining && !uut__take);
        if (uut__host_write) assert (!uut__rendering);
        if (uut__take) assert (tick && !busy && committed);
    end

    // Not vacuous: programs are taken while others play; with a renderer, words come from it.
    reg played;
    initial played = 0;
    always @(posedge clock) played <= played || (strobe && playing);
    always @* cover (played && uut__take && running);
    always @* cover (table_write && uut__rendering);

    // What makes it inductive.
    always @* begin
        assert (!committed || !uut__banks__draining);
        if (uut__rendering || uut__host_commit || uut__host_write) assert (!committed && !uut__banks__draining);
        if (uut__host_commit) assert (!uut__rendering);
        assert (!uut__rendered || uut__rendering);
        assert (!register_write || uut__host_write);
    end
    // The renderer works only between a commit of the host and that of the banks.
    wire uut__fourier__render__busy, uut__fourier__render__start, uut__fourier__render__write;
    always @* begin
        if (uut__fourier__render__busy || uut__fourier__render__start) assert (uut__rendering && !uut__rendered);
        if (uut__fourier__render__write) assert (uut__fourier__render__busy);
        if (uut__fourier__render__start) assert (!uut__fourier__render__busy);
    end
    // In the pipeline the load of a program is the one that the banks wait for.
    reg [22:0] loads;
    initial loads = 0;
    always @(posedge clock) loads <= {loads[21:0], uut__take};
    always @* if (!LOW_AREA) begin
        assert (uut__banks__draining == (loads != 0));
        assert ((loads & (loads - 1)) == 0);
    end
endmodule

`default_nettype wire
