// Bench of dac_sequencer: plays a script of writes and requests, one a clock, and captures what leaves with every
// strobe.
//
// The script is a text file of 64-bit words in hexadecimal (tablegen/verification/play/stream.py writes it), the capture
// a text file of 64-bit words: faults, flags, y code, x code. STATES, if given, gets four words for every state that the
// script asks for: flags and faults, the four counts, and the outputs that the device holds. `finished` rises at the
// end of the script, after the last
// sample.

`timescale 1ns / 1ps
`default_nettype none

module stream_bench #(
    parameter SCRIPT = "",
    parameter CAPTURE = "",
    parameter STATES = "",
    parameter DAC_BITS = 16,
    parameter X_INTERPOLATED = 1,
    parameter X_INDEX_BITS = 11,
    parameter X_WORD_BITS = 16,
    parameter Y_INTERPOLATED = 1,
    parameter Y_INDEX_BITS = 11,
    parameter Y_WORD_BITS = 16,
    parameter TICK_BITS = 24,
    parameter LINE_BITS = 16,
    parameter PERIOD_BITS = 31,
    parameter COUNT_BITS = 32,
    parameter PLAIN_MULTIPLIER = 0,
    parameter LOW_AREA = 0,
    parameter ALTERNATE = 0,
    parameter COMMIT_MODES = 0,
    parameter FOURIER = 0,
    parameter HARMONICS = 64,
    parameter SINE_FILE = "",
    parameter SHAPING = 0,
    parameter SLOW_PART = 0,
    parameter SLOW_INDEX_BITS = 7,
    parameter PIXEL_INDEX_BITS = 0,
    parameter X_POWER_UP_CODE = 0,
    parameter Y_POWER_UP_CODE = 0
);
    localparam END = 4'd0, WAIT = 4'd1, WRITE = 4'd2, REQUEST = 4'd3, PERIOD = 4'd4, STATE = 4'd6, EXTRA = 4'd7;

    reg clock = 0;
    reg [63:0] command;
    reg [31:0] wait_left = 0, period = 0, until_tick = 0;
    reg write = 0;
    reg [7:0] requests = 0;  // underrun, clear_faults, park, trigger, arm, withdraw, commit, reset
    reg tick = 0;
    reg extra = 0;  // a tick that is to be lost
    integer script, capture, states, fields;

    reg finished = 0;
    integer strobes = 0, ticks = 0;
    integer first_tick = -1, latency = -1;
    integer jitter = 0;  // how often strobes began or ended other than `latency` clocks after ticks did
    integer edges [0:255];  // clocks at which ticks began and ended to come with every clock
    reg [7:0] ticked_edges = 0, strobed_edges = 0;
    reg ticked = 0, strobed = 0;
    reg [31:0] alike;  // clocks with the same inputs

    wire writable, refused, committed, can_keep, armed, running, busy, strobe, playing, parked;
    wire line_marker, frame_marker, pixel_marker, backward_marker, valid_marker, swapped_marker;
    wire [DAC_BITS-1:0] x_code, y_code;
    wire [3:0] faults;
    wire [4*COUNT_BITS-1:0] counts;
    wire [31:0] slews = counts[0 +: COUNT_BITS], clamps = counts[COUNT_BITS +: COUNT_BITS];
    wire [31:0] overruns = counts[2*COUNT_BITS +: COUNT_BITS], underruns = counts[3*COUNT_BITS +: COUNT_BITS];
    wire [127:0] fault_counts = {underruns, overruns, clamps, slews};

    dac_sequencer #(
        .DAC_BITS(DAC_BITS), .X_INTERPOLATED(X_INTERPOLATED), .X_INDEX_BITS(X_INDEX_BITS), .X_WORD_BITS(X_WORD_BITS),
        .Y_INTERPOLATED(Y_INTERPOLATED), .Y_INDEX_BITS(Y_INDEX_BITS), .Y_WORD_BITS(Y_WORD_BITS), .TICK_BITS(TICK_BITS),
        .LINE_BITS(LINE_BITS), .PERIOD_BITS(PERIOD_BITS), .COUNT_BITS(COUNT_BITS), .PLAIN_MULTIPLIER(PLAIN_MULTIPLIER),
        .LOW_AREA(LOW_AREA), .ALTERNATE(ALTERNATE), .COMMIT_MODES(COMMIT_MODES), .FOURIER(FOURIER),
        .HARMONICS(HARMONICS), .SINE_FILE(SINE_FILE), .SHAPING(SHAPING), .SLOW_PART(SLOW_PART),
        .SLOW_INDEX_BITS(SLOW_INDEX_BITS), .PIXEL_INDEX_BITS(PIXEL_INDEX_BITS),
        .X_POWER_UP_CODE(X_POWER_UP_CODE), .Y_POWER_UP_CODE(Y_POWER_UP_CODE)
    ) sequencer (
        .clock(clock), .reset(requests[0]),
        .write(write), .write_region(command[50:48]), .write_address(command[47:32]), .write_data(command[31:0]),
        .writable(writable), .refused(refused), .commit(requests[1]), .commit_mode(command[55:54]),
        .withdraw(requests[2]), .committed(committed), .can_keep(can_keep),
        .arm(requests[3]), .arm_frames(command[15:0]), .trigger(requests[4]), .park(requests[5]),
        .clear_faults(requests[6]), .armed(armed), .running(running), .tick(tick || extra),
        .underrun(requests[7]), .busy(busy), .strobe(strobe), .x_code(x_code), .y_code(y_code), .line_marker(line_marker), .frame_marker(frame_marker),
        .pixel_marker(pixel_marker), .backward_marker(backward_marker), .valid_marker(valid_marker),
        .swapped_marker(swapped_marker), .playing(playing), .parked(parked), .faults(faults), .fault_counts(counts)
    );

    wire [23:0] x_wide = x_code, y_wide = y_code;
    wire [63:0] sample = {4'd0, faults, parked, playing, swapped_marker, valid_marker, backward_marker, pixel_marker,
                          frame_marker, line_marker, y_wide, x_wide};

    always @(strobe)
        if (strobe !== strobed) begin
            if (latency < 0) latency = $time / 10 + 1 - first_tick;
            if (edges[strobed_edges] !== $time / 10 + 1 - latency) jitter = jitter + 1;
            strobed_edges = strobed_edges + 1;
            strobed = strobe;
        end

    initial begin
        script = $fopen(SCRIPT, "r");
        capture = $fopen(CAPTURE, "w");
        if (script == 0 || capture == 0) begin
            $display("ERROR: cannot open %0s or %0s", SCRIPT, CAPTURE);
            $finish;
        end
        if (STATES != "") states = $fopen(STATES, "w");
        while (!finished) begin
            // What the inputs are for the next clock; they change while it is low.
            write = 0;
            requests = 0;
            extra = 0;
            tick = period != 0 && until_tick == 0;
            if (period != 0) until_tick = until_tick == 0 ? period - 1 : until_tick - 1;
            alike = 1;
            if (wait_left != 0) begin
                // As many clocks at once as have the same inputs: this loop takes longer than they do.
                if (period <= 1)
                    alike = wait_left;
                else if (!tick) begin
                    alike = until_tick < wait_left ? until_tick + 1 : wait_left;
                    until_tick = until_tick - (alike - 1);
                end
                wait_left = wait_left - alike;
            end else begin
                fields = $fscanf(script, "%h", command);
                if (fields != 1) command = 0;
                case (command[63:60])
                    WAIT: wait_left = command[31:0] - 1;
                    WRITE: begin
                        write = 1;
                        requests[1] = command[52];
                    end
                    REQUEST: requests = command[23:16];
                    PERIOD: begin
                        period = command[31:0];
                        until_tick = 0;
                    end
                    STATE: if (STATES != "")
                        $fwrite(states, "%016x\n%016x\n%016x\n%016x\n",
                                {52'd0, faults, 2'd0, busy, running, armed, committed, refused, writable},
                                {clamps, slews}, {underruns, overruns}, sample);
                    EXTRA: extra = 1;
                    default: begin
                        finished = 1;
                        tick = 0;
                    end
                endcase
            end
            if (tick) begin
                if (first_tick < 0) first_tick = $time / 10;
                ticks = ticks + alike;
            end
            if (tick != ticked) begin
                edges[ticked_edges] = $time / 10;
                ticked_edges = ticked_edges + 1;
                ticked = tick;
            end
            repeat (alike) begin
                #5 clock = 1;
                #5 clock = 0;
                if (strobe) begin
                    $fwrite(capture, "%016x\n", sample);
                    strobes = strobes + 1;
                end
            end
        end
        $fclose(capture);
        if (STATES != "") $fclose(states);
        $fclose(script);
    end
endmodule

`default_nettype wire
