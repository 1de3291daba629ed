"""The Arduino library: its properties by their specification, and Arduino's builder compiles it with a sketch."""

import re
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from building import NAME, Build, run
from formatted import Formatted, check_finds_a_flip, formatted
from sets import LONG_TEST
from short_scans import CUBIC, model_ticks, short
from sketches import own_warnings, run_builder, simulated_output

from tablegen.version import __version__

TICKS = 40
WIDE = {"dac.bits": 20, "x.table.bits": 20, "y.table.bits": 20}
MEGA = "mega:cpu=atmega2560"
# What a header-only build has no objects for.
OBJECTS = f"""
static const dac_program {NAME}_program = DAC_PROGRAM({NAME.upper()}, {NAME});
static const dac_converter {NAME}_x_converter = DAC_CONVERTER({NAME.upper()}_X, 0);
static const dac_converter {NAME}_y_converter = DAC_CONVERTER({NAME.upper()}_Y, 0);
"""
SKETCH = f"""
#include <avr/sleep.h>

static dac_sequencer sequencer;

void setup()
{{
    dac_tick now;
    Serial.begin(115200);
    if (!dac_sequencer_init(&sequencer, &{NAME}_x_converter, &{NAME}_y_converter)
        || dac_sequencer_load(&sequencer, &{NAME}_program) != DAC_LOADED || !dac_sequencer_commit(&sequencer))
        Serial.println("refused");
    dac_sequencer_step(&sequencer, &now);
    dac_sequencer_arm(&sequencer, 0);
    dac_sequencer_trigger(&sequencer);
    for (int i = 0; i < {TICKS}; i++) {{
        dac_sequencer_step(&sequencer, &now);
        Serial.print(now.x);
        Serial.print(' ');
        Serial.println(now.y);
    }}
    Serial.flush();
    cli();
    sleep_mode();
}}

void loop()
{{
}}
"""


def properties(content: bytes) -> dict[str, str]:
    """The pairs of a properties file, in which no key stands twice."""
    pairs = [line.partition("=")[::2] for line in content.decode("ascii").splitlines()]
    assert len(dict(pairs)) == len(pairs)
    return dict(pairs)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("arduino"), "short", "arduino")


def test_it_has_the_fields_of_the_specification(built: Formatted) -> None:
    fields = properties(built.files["library.properties"])
    required = {"name", "version", "author", "maintainer", "sentence", "paragraph", "category", "architectures"}
    assert fields.keys() == required | {"includes"}  # without a url, which only a published library has
    assert all(fields.values())
    assert re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 _.-]{0,62}", fields["name"])
    assert (fields["name"], fields["version"]) == (NAME, __version__)
    assert re.fullmatch(r"\d+\.\d+\.\d+", fields["version"])
    assert fields["category"] == "Signal Input/Output"
    assert fields["architectures"] == "*"
    assert fields["paragraph"] == f"Build {built.manifest['hash']}"


def test_the_build_has_c_and_no_verilog(built: Formatted) -> None:
    assert {name.rpartition(".")[2] for name in built.files} == {"c", "h", "properties", "json"}


@pytest.mark.parametrize("header_only", [False, True])
def test_a_sketch_includes_headers_of_the_build(tmp_path: Path, header_only: bool) -> None:
    built = short(tmp_path, {"emit.formats": ["arduino"], "emit.header_only": header_only})
    included = properties(built.files["library.properties"])["includes"].split(",")
    assert included == [f"{NAME}.h", "dac_sequencer.h" if header_only else f"{NAME}_program.h"]
    assert set(included) < built.files.keys()


def test_a_changed_build_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "arduino"), "arduino", ["library.properties", "tablegen_options.h"])


def library(tmp_path: Path, changes: dict[str, object], folder: str = "scan") -> Build:
    """A build whose folder stands in the libraries folder as it is, beside a sketch that includes what it says."""
    (tmp_path / "libraries").mkdir(exist_ok=True)
    built = short(tmp_path / folder, changes)
    built.folder.rename(tmp_path / "libraries" / folder)
    return built


def compiled(tmp_path: Path, built: Build, *options: str | Path, also: str = "") -> CompletedProcess[str]:
    """Run the builder for a sketch that includes the headers of a build, and plays it."""
    included = properties(built.files["library.properties"])["includes"].split(",")
    text = also + "".join(f"#include <{name}>\n" for name in included)
    text += SKETCH if f"{NAME}_program.h" in included else OBJECTS + SKETCH
    sketch, out = tmp_path / "play" / "play.ino", tmp_path / "compiled"
    sketch.parent.mkdir()
    sketch.write_text(text, "ascii")
    out.mkdir()
    return run_builder(sketch, MEGA, out, "-verbose", "-libraries", tmp_path / "libraries", *options)


def objects(tmp_path: Path) -> set[str]:
    """The sources that were compiled of the library."""
    return {path.stem for path in (tmp_path / "compiled" / "libraries" / "scan").glob("*.o")}


@pytest.mark.rest
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"emit.formats": ["arduino"]}, marks=LONG_TEST),
        {"emit.formats": ["arduino", "verilog"]},
        {"emit.formats": ["arduino"], "emit.header_only": True, **WIDE},
        {"emit.formats": ["arduino"], "dac.shaping": "second", "x.table": CUBIC},
    ],
    ids=["alone", "with Verilog", "header-only, 20 bits", "shaped and cubic"],
)
def test_a_sketch_plays_the_model(tmp_path: Path, changes: dict[str, object]) -> None:
    """Without an option of the compiler, whatever the scan needs."""
    built = library(tmp_path, changes)
    done = compiled(tmp_path, built)
    assert done.returncode == 0, done.stderr
    assert own_warnings(done) == []
    assert f"Using library scan at version {__version__} in folder: {tmp_path}/libraries/scan " in done.stdout
    assert objects(tmp_path) == {name for name in built.files if name.endswith(".c")}
    verilog = [name for name in built.files if name.endswith((".v", ".vh", ".mem"))]
    assert bool(verilog) == ("verilog" in built.plan.formats)
    assert not any(name in done.stdout for name in verilog)
    symbols = run(["avr-nm", "-C", tmp_path / "compiled" / "play.ino.elf"]).stdout
    assert set(re.findall(rf"^[0-9a-f]+ (\w) {NAME}_[xy]_table$", symbols, re.MULTILINE)) <= {"t", "T"}
    assert f"{NAME}_x_table" in symbols
    shown = simulated_output(tmp_path / "compiled" / "play.ino.elf")
    assert "refused" not in shown
    program = built.plan.program
    expected = model_ticks(program, TICKS)[1:]
    assert re.findall(r"^(\d+) (\d+)\b", shown, re.MULTILINE) == [
        (str(program.x.output.word(tick.x)), str(program.y.output.word(tick.y))) for tick in expected
    ]


@pytest.mark.rest
def test_without_a_maintainer_the_builder_refuses_it(tmp_path: Path) -> None:
    """A negative control: the builder reads the properties."""
    built = library(tmp_path, {"emit.formats": ["arduino"]})
    fewer = built.files["library.properties"].replace(b"maintainer=tablegen\n", b"")
    (tmp_path / "libraries" / "scan" / "library.properties").write_bytes(fewer)
    done = compiled(tmp_path, built)
    assert done.returncode != 0
    assert "Missing 'maintainer' from library in" in done.stderr


@pytest.mark.rest
def test_without_its_options_a_wide_scan_does_not_compile(tmp_path: Path) -> None:
    """A negative control: the runtime takes the widths from the library's header."""
    built = library(tmp_path, {"emit.formats": ["arduino"], **WIDE})
    (tmp_path / "libraries" / "scan" / "tablegen_options.h").unlink()
    done = compiled(tmp_path, built)
    assert done.returncode != 0
    assert "compile_with_the_DAC_TABLE_STORAGE_BITS_of_the_table" in done.stderr


@pytest.mark.rest
def test_a_sketch_includes_one_of_two_libraries(tmp_path: Path) -> None:
    """Both have a sequencer: a second one does not link."""
    built = library(tmp_path, {"emit.formats": ["arduino"]})
    library(tmp_path, {"emit.formats": ["arduino"], "name": "other"}, "other")
    one, both = tmp_path / "one", tmp_path / "both"
    for folder in (one, both):
        folder.mkdir()
        (folder / "libraries").symlink_to(tmp_path / "libraries")
    assert compiled(one, built).returncode == 0
    refused = compiled(both, built, also="#include <other_program.h>\n")
    assert refused.returncode != 0
    assert "multiple definition of" in refused.stderr
