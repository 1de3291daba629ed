"""``adc_pixels`` on every clock equal to its integer model, with mutants; received by the sink of cocotbext-axi."""

import re
import subprocess
from itertools import product
from pathlib import Path

import pytest
from adc_bench import PIXELS, Shape, beat_of, compare, noise_clocks, play, scan_clocks
from building import REPOSITORY, run_clean, tool
from sets import LONG_TEST, long, one_of
from spi_bench import Difference
from test_lint import ADC, CROSSINGS
from test_marker_delay import MUTANTS as DELAY_MUTANTS

from tablegen.device.adc_pixels import PixelInputs

PAGE = REPOSITORY / "docs" / "pixels.md"
CLOCKS = 6_000
SHAPES = {
    "as it comes": Shape(),
    "two channels": Shape(channels=2, sample_bits=18, count_bits=14, depth_bits=1),
    "short counts": Shape(sample_bits=12, count_bits=3, depth_bits=2),
    "unsigned": Shape(channels=2, sample_bits=16, signed=0, depth_bits=3),
    "unsigned short": Shape(sample_bits=8, signed=0, count_bits=4, depth_bits=2),
    "widest sample": Shape(sample_bits=30, count_bits=2, depth_bits=1),
}
STIMULI = {"scan": scan_clocks, "noise": noise_clocks}
BY_TURNS = [  # each shape with one of them, the next shape with the other one
    pytest.param(name, stimulus, marks=LONG_TEST if index // 2 % 2 != index % 2 else ())
    for index, (name, stimulus) in enumerate(product(SHAPES, STIMULI))
]


@pytest.mark.common
@pytest.mark.parametrize(("name", "stimulus"), BY_TURNS)
def test_every_clock_is_that_of_the_model(name: str, stimulus: str, tmp_path: Path) -> None:
    shape = SHAPES[name]
    clocks = STIMULI[stimulus](shape, 1, CLOCKS)
    wanted = compare(shape, clocks, play(tmp_path, "icarus", shape, clocks)[0])
    words = {id(one.word): one.word for one in wanted if one.word is not None}.values()
    assert len(words) > 100
    for flag in range(6):
        bits = {word.flags >> flag & 1 for word in words}
        assert bits == ({0} if flag == 4 and shape.count_bits > 7 else {0, 1}), flag
    assert max(one.lost_words for one in wanted) > 0


@pytest.mark.rest
@pytest.mark.parametrize("name", long(["short counts"], ["two channels", "short counts"]))
def test_verilator_has_the_same_clocks(name: str, tmp_path: Path) -> None:
    shape = SHAPES[name]
    clocks = scan_clocks(shape, 2, 10 * CLOCKS) + noise_clocks(shape, 3, 10 * CLOCKS)
    compare(shape, clocks, play(tmp_path, "verilator", shape, clocks)[0])


@pytest.mark.common
def test_a_sink_of_axi_gets_every_word(tmp_path: Path) -> None:
    """In frames that end at TLAST, at other pauses than those of the stimulus; the FIFO is deep enough for them."""
    shape = Shape(channels=2, depth_bits=8)
    clocks = [inputs._replace(reset=False) for inputs in scan_clocks(shape, 4, CLOCKS)]
    seen, frames = play(tmp_path, "icarus", shape, clocks, sink=0.6)
    wanted = compare(shape, clocks, seen)
    assert wanted[-1].lost_words == 0
    beats = [beat_of(outputs) for outputs, one in zip(wanted, seen, strict=True) if outputs.word and one.ready]
    packets: list[list[int]] = [[]]
    for beat in beats:
        assert beat is not None
        packets[-1] += beat[2].to_bytes(16, "little")
        if beat[0]:
            packets.append([])
    assert len(frames) > 50
    assert frames == packets[: len(frames)]
    assert len(packets) - len(frames) <= 2


def test_the_page_shows_what_is_simulated(tmp_path: Path) -> None:
    """The diagram of docs/pixels.md: its inputs are played, its outputs are those of the module."""
    shown = PAGE.read_text("utf-8").partition("<!-- simulated -->")[2].partition("<!-- /simulated -->")[0]
    rows = dict(line.split() for line in shown.splitlines() if line)
    high = {name: [level == "#" for level in row] for name, row in rows.items()}
    clocks = [
        PixelInputs(
            samples=None if rows["sample"][k] == "_" else (int(rows["sample"][k]),),
            **{name: high[name][k] for name in ("pixel", "line", "frame", "valid")},
        )
        for k in range(len(rows["sample"]))
    ]
    shape = Shape()
    seen, _ = play(tmp_path, "icarus", shape, clocks)
    compare(shape, clocks, seen)
    beats = [one.beat for one in seen[1:]]
    drawn = {
        "tvalid": ["_" if beat is None else "#" for beat in beats],
        "tlast": ["#" if beat is not None and beat[0] else "_" for beat in beats],
        "first": ["#" if beat is not None and beat[1] & 4 else "_" for beat in beats],
        "sum": ["_" if beat is None else f"{beat[2] & 0xFFFFFFFF:x}" for beat in beats],
        "count": ["_" if beat is None else f"{beat[2] >> 32 & 0xFFFF:x}" for beat in beats],
    }
    assert {name: "".join(levels) for name, levels in drawn.items()} == {name: rows[name] for name in drawn}


def test_the_instances_of_the_page_elaborate(tmp_path: Path) -> None:
    blocks = re.findall(r"```verilog\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    inputs = (
        "clock, reset, strobe, playing, valid_marker, backward_marker, frame_marker, line_marker, pixel_marker, "
        "adc_strobe, tready, frame_pin, line_pin, pixel_pin, input [3:0] faults, input [9:0] latency, "
        "input signed [15:0] adc_a, adc_b"
    )
    outputs = (
        "[127:0] tdata, output [5:0] tuser, output tlast, tvalid, output [15:0] lost_words, output frame, line, pixel"
    )
    top = tmp_path / "top.v"
    top.write_text(f"module top (input {inputs}, output {outputs});\n{''.join(blocks)}endmodule\n", "ascii")
    sources = [top, *ADC.glob("*.v"), *CROSSINGS.glob("*.v")]
    run_clean(["iverilog", "-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s", "top", *sources])


def test_the_page_counts_the_mutants() -> None:
    page = PAGE.read_text("utf-8")
    assert f"with {len(MUTANTS)} mutants" in page
    assert f"with {len(DELAY_MUTANTS)} mutants" in page


def netlist(folder: Path, shape: Shape) -> list[Path]:
    """Return the cells of an iCE40 for a module of these parameters, behind its ports."""
    values = " ".join(f"-chparam {name} {value}" for name, value in shape.parameters.items())
    cells, library, front = folder / "cells.v", folder / "library.v", folder / "adc_pixels.v"
    script = (
        f"read_verilog -defer {ADC}/adc_*.v; hierarchy -check -top adc_pixels {values}; synth_ice40; "
        f"rename -top adc_pixels_cells; write_verilog -noattr {cells}"
    )
    subprocess.run([tool("yosys"), "-q", "-p", script], check=True)
    share = Path(tool("yosys")).resolve().parents[1] / "share" / "yosys"
    text = (share / "ice40" / "cells_sim.v").read_text("utf-8")
    library.write_text("`define NO_ICE40_DEFAULT_ASSIGNMENTS\n" + text, "utf-8")  # Verilog 2005 has none
    head = PIXELS.read_text("utf-8").partition("\n);\n")[0].replace("output reg ", "output wire")
    ports = re.findall(r"^ +(?:in|out)put +wire +(?:\[\S+\] +)?(\w+)", head, re.MULTILINE)
    assert len(ports) == 17
    connected = ", ".join(f".{port}({port})" for port in ports)
    front.write_text(f"{head}\n);\n    adc_pixels_cells cells ({connected});\nendmodule\n", "utf-8")
    return [front, cells, library]


@pytest.mark.rest
def test_the_cells_of_an_ice40_have_the_same_clocks(tmp_path: Path) -> None:
    """With the FIFO in block RAM."""
    shape = SHAPES["unsigned"]
    clocks = scan_clocks(shape, 7, CLOCKS // 6) + noise_clocks(shape, 8, CLOCKS // 6)
    sources = netlist(tmp_path, shape)
    assert "SB_RAM40_4K" in sources[1].read_text("utf-8")
    compare(shape, clocks, play(tmp_path / "bench", "icarus", shape, clocks, sources=sources)[0])


# A piece of the text and what takes its place, of each module.
MUTANTS: dict[str, tuple[str, str, str]] = {
    "sample of the pulse in the old pixel": ("adc_pixels", "if (begins) sum <= term;", "if (begins) sum <= 0;"),
    "count begins at 0": ("adc_pixels", "{{(COUNT_BITS - 1){1'b0}}, sample}", "{COUNT_BITS{1'b0}}"),
    "sum goes on": ("adc_pixels", "else if (!counted) sum", "else sum"),
    "no sign": ("adc_pixels", "SIGNED != 0 && value[SAMPLE_BITS-1]", "1'b0"),
    "sign of the lane": ("adc_pixels", "SIGNED != 0 && stored[SUM_BITS*i+SUM_BITS-1]", "1'b0"),
    "sample without its strobe": ("adc_pixels", "term = sample ? {", "term = 1'b1 ? {"),
    "first channel twice": ("adc_pixels", "samples[i*SAMPLE_BITS +: SAMPLE_BITS]", "samples[SAMPLE_BITS-1:0]"),
    "full count wraps": ("adc_pixels", "if (counted) overfull <= 1'b1;\n            else count", "count"),
    "overfull stays": ("adc_pixels", "            overfull <= 1'b0;\n", ""),
    "line ends no pixel": ("adc_pixels", "sweep_ends = line || frame", "sweep_ends = frame"),
    "frame ends no pixel": ("adc_pixels", "sweep_ends = line || frame", "sweep_ends = line"),
    "direction ends no pixel": ("adc_pixels", "frame || backward != was_backward", "frame"),
    "park ends no pixel": ("adc_pixels", "was_backward || !playing;", "was_backward;"),
    "pulse without a scan": ("adc_pixels", "begins = pixel && playing", "begins = pixel"),
    "window ends no pixel": ("adc_pixels", "(begins || sweep_ends || window_ends)", "(begins || sweep_ends)"),
    "fault ends the pixel": ("adc_pixels", "complete && !valid && !fault;", "complete && !valid;"),
    "valid of its end alone": ("adc_pixels", "(begins || complete) && valid", "valid"),
    "valid of its begin alone": ("adc_pixels", "complete <= (begins ||", "if (begins) complete <= (begins ||"),
    "valid in a fault": ("adc_pixels", "&& valid && !fault;", "&& valid;"),
    "valid though parked": ("adc_pixels", "complete && playing && count", "complete && count"),
    "valid without a sample": ("adc_pixels", "playing && count != 0", "playing"),
    "lines of all frames": ("adc_pixels", "frame ? 16'd0 : line &&", "line &&"),
    "line after frame counts": ("adc_pixels", "line && !line_is_0", "line"),
    "pixel does not fix the line": ("adc_pixels", "!line && !begins);", "!line);"),
    "columns of a line": ("adc_pixels", "sweep_ends ? 16'd0 : next_column", "line || frame ? 16'd0 : next_column"),
    "direction of the end": ("adc_pixels", "first_lost, is_backward,", "first_lost, backward,"),
    "frame of the pulse alone": ("adc_pixels", "frame || frame_waits;", "frame;"),
    "frame never ends": ("adc_pixels", "(frame || frame_waits) && !begins", "frame || frame_waits"),
    "last though it goes on": ("adc_pixels", "sweep_ends || !begins,", "sweep_ends || begins,"),
    "last of a window": ("adc_pixels", "sweep_ends || !begins,", "sweep_ends,"),
    "loss is not marked": ("adc_pixels", "lost <= full;", "lost <= 1'b0;"),
    "loss is marked for ever": ("adc_pixels", "lost <= full;", "lost <= lost || full;"),
    "lost frame is not marked": ("adc_pixels", "first_lost <= full && (is_first || first_lost)", "first_lost <= 1'b0"),
    "one lost frame": ("adc_pixels", "full && (is_first || first_lost)", "full && is_first"),
    "loss is not counted": ("adc_pixels", "lost_words + 16'd1", "lost_words"),
    "reset keeps the pixel": ("adc_pixels", "open <= !reset && ", "open <= "),
    "reset keeps the line": ("adc_pixels", "line_number <= reset ? 16'd0 : line_now", "line_number <= line_now"),
    "reset keeps the column": ("adc_pixels", "next_column <= reset ? 16'd0 : begins", "next_column <= begins"),
    "reset keeps the frame": ("adc_pixels", "frame_waits <= !reset && ", "frame_waits <= "),
    "reset keeps the loss": ("adc_pixels", "            lost <= 1'b0;\n            first", "            first"),
    "pixel that ended ends again": ("adc_pixels", "(open && !ends)", "open"),
    "deeper than it is": ("adc_fifo", "writes = write && !full", "writes = write"),
    "a word less": ("adc_fifo", "full = stored[DEPTH_BITS]", "full = &stored[DEPTH_BITS-1:0]"),
    "word is replaced": ("adc_fifo", "stored != 0 && (!out_valid || out_ready)", "stored != 0"),
    "word comes twice": ("adc_fifo", "else if (out_ready) out_valid", "else if (0) out_valid"),
    "word is dropped": ("adc_fifo", "else if (out_ready) out_valid", "else out_valid"),
    "pause after each word": ("adc_fifo", "(!out_valid || out_ready)", "!out_valid"),
    "reset leaves a word": ("adc_fifo", "stored <= 0;\n            out_valid <= 1'b0;", "stored <= 0;"),
}  # fmt: skip


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(6, MUTANTS))
def test_a_mutant_is_found(name: str, tmp_path: Path) -> None:
    module, old, new = MUTANTS[name]
    sources = []
    for path in (PIXELS, ADC / "adc_fifo.v"):
        text = path.read_text("utf-8")
        if path.stem == module:
            assert text.count(old) == 1, f"{old} is {text.count(old)} times in {module}"
            text = text.replace(old, new)
        sources.append(tmp_path / path.name)
        sources[-1].write_text(text, "utf-8")
    for number, shape in enumerate((SHAPES["short counts"], SHAPES["two channels"])):
        clocks = scan_clocks(shape, 5, CLOCKS) + noise_clocks(shape, 6, CLOCKS)
        seen, _ = play(tmp_path / str(number), "icarus", shape, clocks, sources=sources)
        try:
            compare(shape, clocks, seen)
        except Difference:
            return
    pytest.fail("not found")
