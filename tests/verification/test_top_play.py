"""``NAME_top.v`` in ``tablegen verify``: played as it is, it passes; with a fault in it, its play finds the fault.

The same of the modules around it, which send its samples to converters.

The bench of the top is simulated alone, by Icarus without cocotb: nothing but what it plays can find an edit here.
"""

import shutil
import subprocess
from pathlib import Path

import pytest
from building import NAME, Build
from editing import run
from kept_plays import own_program_alone
from sets import common, quick
from short_scans import CUBIC, DIRECT, short
from verifying import edit, failed, make_right

from tablegen.emit.stored import stored_content
from tablegen.manifest.read import read_build
from tablegen.verification.verilog.outputs import OUTPUTS, Output
from tablegen.verification.verilog.top_play import TopPlay, instances

TOP = f"{NAME}_top.v"
TICKS = 400
SCANS: dict[str, dict[str, object]] = {
    "Fourier": {},
    "direct": {"x.table": DIRECT, "y.table": DIRECT},
    "cubic": {"x.table": CUBIC, "y.table": CUBIC},
    "18 bits": {"dac.bits": 18, "dac.word_bits": 20, "dac.align": "left"},
    "shaped": {"dac.shaping": "second"},
    "y at rest": {"y": {"motion": "off", "offset_v": 50.0}},
}
SWAPPED = (".x_code(x_code), .y_code(y_code),", ".x_code(y_code), .y_code(x_code),")
MARKERS = (".line_marker(line_marker),", ".line_marker(frame_marker),")
CODING = ("(0), .LEFT_ALIGNED(0)\n    ) x_coding", "(1), .LEFT_ALIGNED(0)\n    ) x_coding")
HARMONICS = (".Y_WORDS(11), .Y_WORD_BITS(32), .Y_HARMONICS(5)", ".Y_WORDS(9), .Y_WORD_BITS(32), .Y_HARMONICS(4)")
EDITS = {
    "an axis swapped at the codes": SWAPPED,
    "the word of x from y": ("(.code(x_code), .word(x_word))", "(.code(y_code), .word(x_word))"),
    "the coding of a converter": CODING,
    "the width of a table word": (".X_INDEX_BITS(5), .X_WORD_BITS(16)", ".X_INDEX_BITS(5), .X_WORD_BITS(15)"),
    "the words of a table": (".X_INDEX_BITS(5)", ".X_INDEX_BITS(4)"),
    "more words than a table has": (".Y_INDEX_BITS(5)", ".Y_INDEX_BITS(6)"),
    "the degree of a table": (".Y_INTERPOLATED(1)", ".Y_INTERPOLATED(0)"),
    "the bits of a converter": (".DAC_BITS(16),", ".DAC_BITS(15),"),
    "a file of the boot": (f'.X_FILE("{NAME}_x_fourier.mem")', f'.X_FILE("{NAME}_y_fourier.mem")'),
    "a file that there is not": (f'.Y_FILE("{NAME}_y_fourier.mem")', '.Y_FILE("another.mem")'),
    "the harmonics of the boot": HARMONICS,
    "the file of the sine": (f'.SINE_FILE("{NAME}_sine.mem")', '.SINE_FILE("another_sine.mem")'),
    "no renderer": (".FOURIER(ALTERNATE != 0 ? 0 : 1),", ".FOURIER(0),"),
    "too few harmonics rendered": (": 1), .HARMONICS(HARMONICS)", ": 1), .HARMONICS(3)"),
    "a counter that is too narrow": (".TICK_BITS(TICK_BITS)", ".TICK_BITS(6)"),
    "a marker swapped": MARKERS,
    "a trigger that is lost": (".trigger(trigger)", ".trigger(1'b0)"),
}  # fmt: skip


SPI_EDITS = {
    "the words of the axes": (".x_word(x_wide), .y_word(y_wide)", ".x_word(y_wide), .y_word(x_wide)"),
    "the pins of the axes": (".mosi_x(mosi_x), .mosi_y(mosi_y)", ".mosi_x(mosi_y), .mosi_y(mosi_x)"),
    "a frame that is a bit longer": ("parameter FRAME_BITS = 16", "parameter FRAME_BITS = 17"),
    "codes in the place of words": ("x_wide = x_word", "x_wide = ~x_code"),
    "an output that nothing strobes": (".strobe(strobe), .x_word", ".strobe(1'b0), .x_word"),
}
STREAM_EDITS = {
    "the words of the axes": (".x_word(x_wide), .y_word(y_wide)", ".x_word(y_wide), .y_word(x_wide)"),
    "markers in another order": ("{valid_marker, backward_marker", "{backward_marker, valid_marker"),
    "a word that is too narrow": ("#(.WORD_BITS(16)", "#(.WORD_BITS(15)"),
    "an output that nothing strobes": (".strobe(strobe), .x_word", ".strobe(1'b0), .x_word"),
}
OUTPUT_EDITS: dict[str, tuple[Output, tuple[str, str]]] = {
    **{f"spi: {breaks}": ("spi", edits) for breaks, edits in SPI_EDITS.items()},
    **{f"axi-stream: {breaks}": ("axi_stream", edits) for breaks, edits in STREAM_EDITS.items()},
}
WRAPPED = ("Fourier", "cubic", "18 bits")
WIDER_Y = {"y.dac": {"word_bits": 20}}  # in the scanner file
ALONE = "module alone;\n    wire [0:0] tops_finished;\n{}\nendmodule\n"


def judge(folder: Path, work: Path, output: Output = "top") -> str | None:
    """What the play of a module of a build finds fault with."""
    content = stored_content(read_build(folder))
    play = TopPlay.of(content, TICKS, output=output)
    work.mkdir()
    sources = play.prepare(folder, work, work / "run")
    (work / "alone.v").write_text(ALONE.format("\n".join(instances([output]))), "ascii")
    line = ["iverilog", "-g2005", "-s", "alone", "-o", "model.vvp", "alone.v"]
    if output != "top":
        line.append(str(folder / TOP))
    runtime = sorted(map(str, folder.glob("dac_*.v")))
    subprocess.run([*line, *map(str, sources), *runtime], cwd=work, check=True, capture_output=True)
    subprocess.run(["vvp", "-n", "../model.vvp"], cwd=work / "run", check=True, capture_output=True)
    return play.check(work).failure


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Build:
    return short(tmp_path_factory.mktemp("top"), {"emit.formats": ["c", "verilog", *OUTPUTS]})


@pytest.mark.parametrize("name", quick(("Fourier",), SCANS))
def test_the_top_of_a_build_plays_the_model(name: str, tmp_path: Path) -> None:
    assert judge(short(tmp_path, SCANS[name]).folder, tmp_path / "work") is None


@pytest.mark.rest
@pytest.mark.parametrize("breaks", quick(("the width of a table word",), EDITS))
def test_an_edit_of_the_top_is_found_by_its_play(breaks: str, built: Build, tmp_path: Path) -> None:
    folder = shutil.copytree(built.folder, tmp_path / "build")
    edit(folder / TOP, *EDITS[breaks])
    failure = judge(folder, tmp_path / "work")
    assert failure is not None
    assert failure.startswith(f"{TOP}: ")


@pytest.mark.common
@pytest.mark.parametrize("name", common(("Fourier",), WRAPPED))
def test_the_modules_around_it_play_the_model(name: str, tmp_path: Path) -> None:
    built = short(tmp_path, {**SCANS[name], "emit.formats": ["verilog", *OUTPUTS]}, WIDER_Y if name == "cubic" else {})
    for output in OUTPUTS.values():
        assert judge(built.folder, tmp_path / output, output) is None


@pytest.mark.rest
@pytest.mark.parametrize("breaks", OUTPUT_EDITS)
def test_an_edit_of_a_module_around_it_is_found(breaks: str, built: Build, tmp_path: Path) -> None:
    output, edits = OUTPUT_EDITS[breaks]
    folder = shutil.copytree(built.folder, tmp_path / "build")
    edit(folder / f"{NAME}_{output}.v", *edits)
    failure = judge(folder, tmp_path / "work", output)
    assert failure is not None
    assert failure.startswith(f"{NAME}_{output}.v: ")


@pytest.mark.common
def test_the_command_plays_it(built: Build, tmp_path: Path) -> None:
    """As it is, and with a fault, a manifest that was made right and no installed file to be compared with."""
    folder = shutil.copytree(built.folder, tmp_path / "build")
    edit(folder / TOP, *SWAPPED)
    make_right(folder, "9.9.9")
    options = ("--axis", "blocks", "--ticks", "1000")
    with own_program_alone():
        outcome = run("verify", built.folder, *options)
    assert (outcome.status, outcome.err) == (0, "")
    assert f"{TOP};" not in outcome.out
    played = {line.split("  ")[0] for line in outcome.out.splitlines() if " words booted" in line}
    assert played == {"top", *OUTPUTS}
    with own_program_alone():
        outcome = run("verify", folder, "--other-version", *options)
    assert failed(outcome) == {(subject, "integer model") for subject in ("top", *OUTPUTS)}
    assert f"{TOP}: tick " in outcome.err
