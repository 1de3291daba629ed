"""The crate of Rust: packed by Cargo, compiled from the package with the C files in it, and played from Rust."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from building import NAME, Build, tool
from formatted import Formatted, check_finds_a_flip, formatted
from packed_library import TICKS, plays_the_model, run_offline
from sets import LONG_TEST
from short_scans import CUBIC, short

from tablegen.version import __version__

CRATE = f"tablegen_{NAME}"
OWN = ("Cargo.toml", "lib.rs", "build.rs")
# Plays some ticks one by one, and the same ones again as a block.
MAIN = f"""
use {CRATE}::{{markers, start, Memory, Player, Requests, Word}};

fn begin(requests: &mut Requests, player: &mut Player) {{
    requests.load().unwrap();
    assert!(requests.writable() && requests.commit());
    assert_eq!(player.step().markers & markers::SWAPPED, markers::SWAPPED);
    assert!(requests.arm(0) && requests.trigger());
}}

fn main() {{
    let mut memory = Memory::new();
    let (mut requests, mut player) = start(&mut memory, [0, 0]).unwrap();
    begin(&mut requests, &mut player);
    let ticks: Vec<_> = (0..{TICKS}).map(|_| player.step()).collect();
    for tick in &ticks {{
        println!("{{}} {{}}", tick.x, tick.y);
    }}
    assert_eq!(requests.status().swaps, 1);
    assert_eq!(ticks[0].markers & markers::FRAME, markers::FRAME);

    let mut other = Memory::new();
    let (mut requests, mut player) = start(&mut other, [0, 0]).unwrap();
    begin(&mut requests, &mut player);
    let (mut words, mut bits) = ([0 as Word; 2 * {TICKS}], [0; {TICKS}]);
    std::thread::scope(|scope| {{
        scope.spawn(|| player.fill(&mut words, Some(&mut bits)));
        while requests.status().markers & markers::PLAYING == 0 {{}}
    }});
    for (at, tick) in ticks.iter().enumerate() {{
        assert_eq!([tick.x, tick.y, tick.markers.into()], [words[2 * at], words[2 * at + 1], bits[at].into()]);
    }}
    assert!({CRATE}::start(&mut other, [1 << 30, 0]).is_none());
}}
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("cargo"), "short", "cargo")


def test_it_names_the_c_files_of_the_build(built: Formatted) -> None:
    package = tomllib.loads(built.files["Cargo.toml"].decode("ascii"))["package"]
    assert (package["name"], package["version"]) == (CRATE, __version__)
    c_files = {name for name in built.files if name.endswith((".c", ".h"))}
    assert c_files == set(built.files) - {*OWN, "manifest.json"}
    assert set(package["include"]) == {f"/{name}" for name in (*OWN, *c_files)}
    words = built.files["build.rs"].decode("ascii").split()
    assert {f'"{name}",' for name in c_files} == {word for word in words if word.endswith(('.c",', '.h",'))}


def test_its_constants_are_those_of_the_header(built: Formatted) -> None:
    lines = built.files["lib.rs"].decode("ascii").splitlines()
    manifest = built.manifest
    assert f'pub const HASH: &str = "{manifest["hash"]}";' in lines
    assert f"pub const LINE_TICKS: i32 = {manifest['sequence']['line_ticks']};" in lines
    assert f"pub const X_OFFSET_WORD: i64 = {manifest['axes']['x']['output']['offset_word']};" in lines


def test_a_changed_build_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "cargo"), "cargo", OWN)


def cargo(folder: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run Cargo, with nothing of the user and of no registry; a warning is an error."""
    own = folder.parent / "own"
    settings = {"CARGO_HOME": str(own), "RUSTFLAGS": "-D warnings", "CARGO_TARGET_DIR": str(own / "made")}
    return run_offline([tool("cargo"), *arguments, "--offline"], folder, **settings)


def project(tmp_path: Path, main: str, **crates: Path) -> Path:
    """A program of Rust that depends on crates in folders."""
    folder = tmp_path / "play"
    (folder / "src").mkdir(parents=True)
    (folder / "src" / "main.rs").write_text(main, "ascii")
    depends = "".join(f'{name} = {{ path = "{place}" }}\n' for name, place in crates.items())
    (folder / "Cargo.toml").write_text(
        f'[package]\nname = "play"\nversion = "1.0.0"\nedition = "2021"\n[dependencies]\n{depends}', "ascii"
    )
    return folder


def packed(tmp_path: Path, built: Build) -> Path:
    """Pack a crate, which Cargo compiles from its package, and return the folder of what was in it."""
    done = cargo(built.folder, "package", "--allow-dirty")
    assert done.returncode == 0, done.stderr
    place = built.folder.parent / "own" / "made" / "package" / f"{CRATE}-{__version__}"
    names = {path.name for path in place.iterdir()} - {"Cargo.toml.orig", "Cargo.lock", "target"}
    assert names == {name for name in built.files if name in OWN or name.endswith((".c", ".h"))}
    shutil.copytree(place, tmp_path / "packed")
    return tmp_path / "packed"


@pytest.mark.rest
@pytest.mark.parametrize(
    "changes",
    [
        {},
        pytest.param({"emit.header_only": True}, marks=LONG_TEST),
        pytest.param({"dac.bits": 18, "x.table.bits": 18, "y.table.bits": 18}, marks=LONG_TEST),
        {"dac.shaping": "second", "x.table": CUBIC},
    ],
    ids=["16 bits", "header-only", "18 bits", "shaped and cubic"],
)
def test_what_cargo_packs_plays_the_model(tmp_path: Path, changes: dict[str, object]) -> None:
    """Step by step and as a block in another thread."""
    built = short(tmp_path / "built", {"emit.formats": ["cargo", "verilog"], **changes})
    done = cargo(project(tmp_path, MAIN, **{CRATE: packed(tmp_path, built)}), "build")
    assert done.returncode == 0, done.stderr
    assert plays_the_model(tmp_path / "own" / "made" / "debug" / "play", built.plan.program)


@pytest.fixture
def crate(tmp_path: Path) -> Path:
    """The folder of a build with the crate."""
    return short(tmp_path / "built", {"emit.formats": ["cargo"]}).folder


def refused(tmp_path: Path, main: str, **crates: Path) -> str:
    """Compile a program that does not compile, and return what Cargo says of it."""
    done = cargo(project(tmp_path, main, **crates), "build")
    assert done.returncode != 0
    return done.stderr


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("ascii")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), "ascii")


@pytest.mark.rest
def test_another_offset_plays_otherwise(tmp_path: Path, crate: Path) -> None:
    """A negative control: the crate plays the C files that stand in its folder; x is a code higher."""
    built = short(tmp_path / "other", {"emit.formats": ["c"]})
    output = built.plan.program.x.output
    word, higher = output.offset_word, output.offset_word + (1 << output.gain_q)
    edit(crate / f"{NAME}.h", f"_X_OFFSET_WORD INT64_C({word})", f"_X_OFFSET_WORD INT64_C({higher})")
    done = cargo(project(tmp_path, MAIN, **{CRATE: crate}), "build")
    assert done.returncode == 0, done.stderr
    assert not plays_the_model(tmp_path / "own" / "made" / "debug" / "play", built.plan.program)


@pytest.mark.rest
def test_a_source_that_the_crate_lacks_is_missed(tmp_path: Path, crate: Path) -> None:
    edit(crate / "build.rs", '    "dac_sequencer.c",\n', "")
    told = refused(tmp_path, MAIN, **{CRATE: crate})
    assert re.search("undefined (reference to `|symbol: )dac_sequencer_init", told), told  # of ld, or of lld


@pytest.mark.rest
def test_a_sequencer_that_does_not_fit_is_not_compiled(tmp_path: Path, crate: Path) -> None:
    edit(crate / "build.rs", "sizeof(dac_sequencer) <= 768", "sizeof(dac_sequencer) <= 512")
    assert f"{NAME}_bridge_room" in refused(tmp_path, MAIN, **{CRATE: crate})


@pytest.mark.rest
def test_cargo_refuses_the_crates_of_two_scans(tmp_path: Path, crate: Path) -> None:
    """Both have a sequencer."""
    other = short(tmp_path / "second", {"emit.formats": ["cargo"], "name": "other"}).folder
    told = refused(tmp_path, MAIN, **{CRATE: crate, "tablegen_other": other})
    assert "links to the native library `dac_sequencer`" in told


@pytest.mark.rest
@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("drop(memory);", "E0505"),
        pytest.param("let (_, _) = start(&mut memory, [0, 0]).unwrap();", "E0499", marks=LONG_TEST),
        pytest.param("let _second = Player { ..player };", "E0451", marks=LONG_TEST),
    ],
    ids=["moved", "started twice", "a second player"],
)
def test_rust_refuses_a_sequencer_that_goes_or_is_shared(tmp_path: Path, crate: Path, line: str, code: str) -> None:
    before, after = MAIN.split("    let ticks: Vec<_>")
    main = f"{before}    {line}\n    let ticks: Vec<_>{after}"
    assert f"error[{code}]" in refused(tmp_path, main, **{CRATE: crate})
