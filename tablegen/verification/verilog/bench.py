"""The bench of ``tablegen verify`` for Verilog: the stream bench by the constants of a header, and a converter.

The header is compiled into it as a user would include it: its constants set up the sequencer, the coding of codes and
the serial output, and are written down, so that what the simulator reads is compared, not the text.
"""

from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np

from tablegen.emit.constants import verilog_constants
from tablegen.emit.content import Content
from tablegen.verification.play.stream import Words, read_capture
from tablegen.verification.verilog.outputs import Output
from tablegen.verification.verilog.top_play import instances

TOP = "verify_bench"
WORDS, WIRES, STATES, CONSTANTS = "words.hex", "wires.hex", "states.hex", "constants.txt"  # in the folder of a bench
OUTPUTS = "outputs.txt"
BOOT = {"BOOT_PROGRAM": "boot_program.hex", "BOOT_X": "boot_x.hex", "BOOT_Y": "boot_y.hex"}
OUTPUT_BENCH = Path(str(files("tablegen.verification.verilog"))) / "output_bench.v"
SPACING_CLOCKS = 200  # a strobe so long after the one before it is sent on the wires
COUNT_BITS = 8  # of a fault counter: few enough that it ends at its largest number
WIRE_WORDS = 2  # 64-bit words of a sample on the wires: its number, then both words

_MODULE = """\
// The bench of tablegen verify: what a build emitted sets up the sequencer and its outputs.
`timescale 1ns / 1ps
`default_nettype none

module verify_bench #(
    parameter SCRIPT = "", parameter CAPTURE = "", parameter STATES = "", parameter WORDS = "", parameter WIRES = "",
    parameter CONSTANTS = "", parameter OUTPUTS = "", parameter BOOT_PROGRAM = "", parameter BOOT_X = "",
    parameter BOOT_Y = "", parameter CONVERTERS = 1, parameter COUNT_BITS = 16, parameter PLAIN_MULTIPLIER = 0,
    parameter LOW_AREA = 0, parameter ALTERNATE = 0, parameter FOURIER = 0, parameter HARMONICS = 64,
    parameter SINE_FILE = "", parameter SHAPING = 0, parameter X_POWER_UP_CODE = 0, parameter Y_POWER_UP_CODE = 0
);
`include "{header}"
    // Both words come over wires of the same length, the narrower one behind zeros.
    localparam WORD_BITS = {X}_DAC_WORD_BITS > {Y}_DAC_WORD_BITS ? {X}_DAC_WORD_BITS : {Y}_DAC_WORD_BITS;

    stream_bench #(
        .SCRIPT(SCRIPT), .CAPTURE(CAPTURE), .STATES(STATES), .DAC_BITS({X}_DAC_BITS),
        .X_INTERPOLATED({X}_INTERPOLATED), .X_INDEX_BITS({x_index_bits}), .X_WORD_BITS({X}_TABLE_BITS),
        .Y_INTERPOLATED({Y}_INTERPOLATED), .Y_INDEX_BITS({y_index_bits}), .Y_WORD_BITS({Y}_TABLE_BITS),
        .COUNT_BITS(COUNT_BITS), .PLAIN_MULTIPLIER(PLAIN_MULTIPLIER), .LOW_AREA(LOW_AREA), .ALTERNATE(ALTERNATE),
        .FOURIER(FOURIER), .HARMONICS(HARMONICS), .SINE_FILE(SINE_FILE), .SHAPING(SHAPING),
        .X_POWER_UP_CODE(X_POWER_UP_CODE), .Y_POWER_UP_CODE(Y_POWER_UP_CODE),
        .PIXEL_INDEX_BITS({pixel_index_bits})
    ) bench ();

    // For the cocotb side of the bench.
    wire [{last_top}:0] tops_finished;
    wire finished = bench.finished && &tops_finished;
    wire [127:0] fault_counts = bench.fault_counts;
    wire [31:0] strobes = bench.strobes, ticks = bench.ticks, jitter = bench.jitter, latency = bench.latency;
    wire refused = bench.refused;

{tops}

    integer constants;
    initial begin
        constants = $fopen(CONSTANTS, "w");
{constants}
        $fclose(constants);
    end

    generate
        if (CONVERTERS) begin : converters
            wire clock = bench.clock, strobe = bench.strobe;
            wire [{X}_DAC_WORD_BITS-1:0] x_own;
            wire [{Y}_DAC_WORD_BITS-1:0] y_own;
            wire [WORD_BITS-1:0] x_word = x_own, y_word = y_own;
            dac_coding #(
                .BITS({X}_DAC_BITS), .WORD_BITS({X}_DAC_WORD_BITS), .TWOS_COMPLEMENT({X}_DAC_TWOS_COMPLEMENT),
                .LEFT_ALIGNED({X}_DAC_LEFT_ALIGNED)
            ) x_coding (.code(bench.x_code), .word(x_own));
            dac_coding #(
                .BITS({Y}_DAC_BITS), .WORD_BITS({Y}_DAC_WORD_BITS), .TWOS_COMPLEMENT({Y}_DAC_TWOS_COMPLEMENT),
                .LEFT_ALIGNED({Y}_DAC_LEFT_ALIGNED)
            ) y_coding (.code(bench.y_code), .word(y_own));

            // Strobes that come late enough are sent to two serial converters.
            integer words, wires, last = -{spacing} - 1;  // the clock of the last strobe
            reg [31:0] number = 0, sent_number = 0, x_shift = 0, y_shift = 0;
            reg sends = 0;
            wire sclk, cs_n, unused_cs, mosi_x, mosi_y, ldac_n, busy, missed;
            dac_spi #(.WORD_BITS(WORD_BITS), .FRAME_BITS(WORD_BITS)) spi (
                .clock(clock), .reset(1'b0), .strobe(sends), .x_word(x_word), .y_word(y_word), .sclk(sclk),
                .cs_x_n(cs_n), .cs_y_n(unused_cs), .mosi_x(mosi_x), .mosi_y(mosi_y), .ldac_n(ldac_n), .busy(busy),
                .missed(missed)
            );

            wire [31:0] x_wide = x_word, y_wide = y_word;
            initial begin
                words = $fopen(WORDS, "w");
                wires = $fopen(WIRES, "w");
            end
            always @(negedge clock)
                if (strobe) begin
                    $fwrite(words, "%08x%08x\\n", y_wide, x_wide);
                    if ($time / 10 - last > {spacing}) begin
                        sends = 1;
                        sent_number = number;
                    end else
                        sends = 0;
                    last = $time / 10;
                    number = number + 1;
                end else
                    sends = 0;
            always @(posedge sclk)
                if (!cs_n) begin
                    x_shift <= {{x_shift[30:0], mosi_x}};
                    y_shift <= {{y_shift[30:0], mosi_y}};
                end
            always @(negedge cs_n) begin
                x_shift <= 0;
                y_shift <= 0;
            end
            always @(negedge ldac_n)
                if (cs_n) $fwrite(wires, "%016x\\n%08x%08x\\n", {{32'd0, sent_number}}, y_shift, x_shift);
            always @(posedge missed) $fwrite(wires, "ffffffffffffffff\\nffffffffffffffff\\n");
            always @(posedge bench.finished) begin
                $fclose(words);
                $fclose(wires);
            end

            // What stands beside the sequencer, with the options that this build does not use.
            output_bench #(.RESULTS(OUTPUTS), .PROGRAM_FILE(BOOT_PROGRAM), .X_FILE(BOOT_X), .Y_FILE(BOOT_Y)) outputs ();
        end
    endgenerate
endmodule

`default_nettype wire
"""


def expected_constants(content: Content) -> dict[str, str]:
    """Return the constants of the header as the bench writes them."""
    numbers = {name: str(value) for name, value in verilog_constants(content).items()}
    return {"HASH": content.hash, **numbers}


def bench_text(content: Content, index_bits: tuple[int, int], outputs: Sequence[Output] = ()) -> str:
    """Return the bench module for the header of a build; ``index_bits`` are those of the memories of x and y.

    The modules of ``outputs`` play beside the session.
    """
    name = content.name.upper()
    return _MODULE.format(
        header=f"{content.name}.vh",
        X=f"{name}_X",
        Y=f"{name}_Y",
        x_index_bits=index_bits[0],
        y_index_bits=index_bits[1],
        spacing=SPACING_CLOCKS,
        pixel_index_bits=f"{name}_PIXEL_INDEX_BITS",
        last_top=max(len(outputs) - 1, 0),
        tops="\n".join(instances(outputs)) or "    assign tops_finished = 1'b1;",
        constants=written_constants(content.name, expected_constants(content)),
    )


def written_constants(name: str, constants: Mapping[str, str]) -> str:
    """Return the Verilog that writes constants of the header of a build down, each on a line."""
    formats = {key: "%h" if key == "HASH" else "%0d" for key in constants}
    return "\n".join(f'        $fwrite(constants, "{how}\\n", {name.upper()}_{key});' for key, how in formats.items())


def bench_parameters(script: str, capture: str, converters: bool) -> dict[str, int | str]:
    """Return the files of the bench, in the folder of its run; words and wires only with ``converters``.

    Their names are relative to the folder in which the model runs, so that the same model serves every folder.
    """
    names = {
        "SCRIPT": script,
        "CAPTURE": capture,
        "STATES": STATES,
        "WORDS": WORDS,
        "WIRES": WIRES,
        "CONSTANTS": CONSTANTS,
    }
    names |= {"OUTPUTS": OUTPUTS, **BOOT}
    paths: dict[str, int | str] = {key: f"../{name}" for key, name in names.items()}
    return {**paths, "CONVERTERS": int(converters), "COUNT_BITS": COUNT_BITS}


def write_boot_files(folder: Path) -> None:
    """Write the files that a ``dac_boot`` loads in the bench of the outputs: 48 words of 32 bits, and twice 9 of 16."""
    random = np.random.default_rng(1)
    for name, (count, bits) in zip(BOOT.values(), ((48, 32), (9, 16), (9, 16)), strict=True):
        words = random.integers(0, 1 << bits, count)
        (folder / name).write_text("".join(f"{word:0{bits // 4}x}\n" for word in words), "ascii")


def read_outputs(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Read the outputs of each module beside the sequencer: samples, deliberate losses, and wrong clocks."""
    lines = (folder / OUTPUTS).read_text("ascii", "replace").splitlines()
    rows = [line.split() for line in lines]
    return {
        row[0]: (int(row[1]), int(row[2]), int(row[3])) for row in rows if " ".join(row[1:]).replace(" ", "").isdigit()
    }


def different_constants(folder: Path, name: str, constants: Mapping[str, str]) -> list[str]:
    """List the constants that the simulator reads in the header of a build otherwise than the manifest has them."""
    readings = (folder / CONSTANTS).read_text("ascii", "replace").split()
    if len(readings) != len(constants):
        return [f"{name}.vh: {len(readings)} of its constants were read, there are {len(constants)}"]
    return [
        f"{name}.vh: {name.upper()}_{key} is {value} to the simulator, it is {right} in the manifest"
        for (key, right), value in zip(constants.items(), readings, strict=True)
        if value != right
    ]


def read_wires(folder: Path) -> Mapping[int, int]:
    """Return both words of every sample that came over the wires, x in the lower half, by the number of the sample."""
    words: Words = read_capture(folder / WIRES)
    return dict(zip(map(int, words[::WIRE_WORDS]), map(int, words[1::WIRE_WORDS]), strict=False))
