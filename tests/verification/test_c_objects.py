"""Objects of C that are kept: what makes other objects, and what no verdict of `tablegen verify` may depend on."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from building import NAME, Build
from editing import run
from sets import long

from tablegen.verification.c import objects as c_objects
from tablegen.verification.c import play as c_play
from tablegen.verification.c.objects import Objects, maker


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name in c_objects._SETTINGS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("CC", "gcc")
    return tmp_path / "cache" / "tablegen" / "objects"


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A source, and headers beside it."""
    place = tmp_path / "sources"
    place.mkdir()
    (place / "one.c").write_text('#include "one.h"\nint one(void) { return ONE; }\n', "ascii")
    (place / "one.h").write_text("#define ONE 1\n", "ascii")
    (place / "other.h").write_text("#define OTHER 1\n", "ascii")
    return place


def objects(sources: Path, *words: str) -> Objects:
    return Objects([str(sources / "one.c")], ["-O2", *words], [str(path) for path in sorted(sources.iterdir())])


def kept(cache: Path) -> set[str]:
    return set(os.listdir(cache))


def compilations(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Which commands the player runs to compile."""
    lines: list[list[str]] = []
    real = c_play.compile_line

    def counted(line: list[str], place: Path | None = None) -> None:
        lines.append(line)
        real(line, place)

    monkeypatch.setattr(c_play, "compile_line", counted)
    return lines


def test_an_object_is_compiled_once(sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = compilations(monkeypatch)
    for _ in range(2):
        c_play._compile(tmp_path, ["gcc"], [objects(sources)])
        assert (tmp_path / c_play.OBJECTS / "one.o").is_file()
    assert len(lines) == 1
    c_play._compile(tmp_path, ["gcc"], [objects(sources, "-DTWO=2")])
    assert len(lines) == 2


def test_everything_that_an_object_is_made_of_makes_another_one(
    sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every file that can be included, by name and content, options and macros in their order, and the compiler."""

    def key(*words: str, made_by: str | None = None) -> str:
        (found,) = objects(sources, *words)._keys(made_by or str(maker(["gcc"]))).values()
        return found

    keys = [key(), key("-DA=1"), key("-DA=2"), key("-DA=1", "-DB=1"), key("-DB=1", "-DA=1"), key("-O0")]
    for name in "one.c", "one.h", "other.h":
        before = (sources / name).read_text("ascii")
        (sources / name).write_text(before + " ", "ascii")
        keys.append(key())
        (sources / name).write_text(before, "ascii")
    (sources / "other.h").rename(sources / "another.h")
    keys.append(key())
    (sources / "another.h").rename(sources / "other.h")
    assert key() == keys[0]
    compiler = tmp_path / "compiler"
    for said in "1.0", "2.0":
        compiler.write_text(f"#!/bin/sh\necho compiler {said} >&2\n", "ascii")
        compiler.chmod(0o755)
        keys.append(key(made_by=maker([str(compiler)])))
    os.utime(compiler, (1000, 1000))  # another one that says the same
    keys.append(key(made_by=maker([str(compiler)])))
    shutil.copy2(compiler, tmp_path / "elsewhere")
    keys.append(key(made_by=maker([str(tmp_path / "elsewhere")])))
    assert len(set(keys)) == len(keys) == 14


def test_the_same_files_in_another_folder_make_the_same_objects(sources: Path, tmp_path: Path) -> None:
    before = objects(sources)._keys("gcc")
    assert objects(sources.rename(tmp_path / "moved"))._keys("gcc") == before


@pytest.mark.parametrize("setting", c_objects._SETTINGS)
def test_what_settings_lead_to_is_not_known(setting: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert maker(["gcc"]) is not None
    monkeypatch.setenv(setting, "/somewhere")
    assert maker(["gcc"]) is None


def test_what_options_of_the_command_or_a_silent_compiler_make_is_not_known(tmp_path: Path) -> None:
    assert maker(["gcc", "-march=native"]) is None
    assert maker([str(tmp_path / "missing")]) is None
    silent = tmp_path / "silent"
    silent.write_text("#!/bin/sh\n", "ascii")
    silent.chmod(0o755)
    assert maker([str(silent)]) is None


def test_a_source_that_does_not_compile_is_not_kept(sources: Path, tmp_path: Path, cache: Path) -> None:
    (sources / "one.h").write_text("#error spoilt\n", "ascii")
    with pytest.raises(c_play.SimulationFailed, match="spoilt"):
        c_play._compile(tmp_path, ["gcc"], [objects(sources)])
    assert not cache.exists() or not kept(cache)


@pytest.mark.common
def test_a_build_that_was_verified_takes_its_objects_from_there(short: Build, cache: Path) -> None:
    """Whether they are there or not, what is said of the build is the same; options leave them alone."""
    first = run("verify", short.folder, "--target", "c")
    names = kept(cache)
    assert first.status == 0
    assert len(names) == 2 + len(list(short.folder.glob("dac_*.c")))
    second = run("verify", short.folder, "--target", "c")
    assert (second.status, second.out) == (0, first.out)
    assert kept(cache) == names


@pytest.mark.rest
@pytest.mark.parametrize("content", long([None], [b"", b"\x7fELF", None]))
def test_damaged_objects_change_no_verdict(short: Build, cache: Path, content: bytes | None) -> None:
    """Nor do those of others, in their place: they are taken out, and made again."""
    outcome = run("verify", short.folder, "--target", "c")
    names = kept(cache)
    paths = sorted(cache.iterdir())
    before = [path.read_bytes() for path in paths]
    for path, other in zip(paths, [*before[1:], before[0]], strict=True):
        path.write_bytes(other if content is None else content)
    again = run("verify", short.folder, "--target", "c")
    assert (again.status, again.out) == (outcome.status, outcome.out)
    assert outcome.status == 0
    assert kept(cache) == names


@pytest.mark.rest
def test_a_runtime_that_was_changed_is_compiled(folder: Path, cache: Path) -> None:
    """A source, or a header that others include: the objects of the one that was right are not taken for it."""
    assert run("verify", folder, "--target", "c").status == 0
    for name, old, new in (
        ("dac_arithmetic.h", "(int32_t)1 << (14u - (guard))", "(int32_t)0"),
        ("dac_sequencer.c", "(uint8_t)(all | DAC_LINE |", "(uint8_t)(all |"),
    ):
        path = folder / name
        text = path.read_text("ascii")
        assert text.count(old) == 1
        path.write_text(text.replace(old, new), "ascii")
        outcome = run("verify", folder, "--target", "c")
        assert outcome.status == 5
        assert "differ from the model" in outcome.err
        path.write_text(text, "ascii")
        assert run("verify", folder, "--target", "c").status == 0


@pytest.mark.common
def test_the_runtime_finds_no_header_but_its_own(folder: Path) -> None:
    """What it is compiled from would otherwise not be all in the key."""
    path = folder / "dac_axis.c"
    path.write_text(path.read_text("ascii") + f'#include "{NAME}.h"\n', "ascii")
    outcome = run("verify", folder, "--target", "c")
    assert outcome.status == 5
    assert f"{NAME}.h: No such file" in outcome.err


@pytest.mark.rest
@pytest.mark.parametrize("cflags", long(["-O1"], ["", "-O1"]))
def test_without_a_cache_everything_is_compiled(
    short: Build, cache: Path, cflags: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if cflags:
        monkeypatch.setenv("CFLAGS", cflags)
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    assert run("verify", short.folder, "--target", "c").status == 0
    assert not cache.exists() or not kept(cache)


def test_an_object_is_what_the_compiler_makes(sources: Path, tmp_path: Path) -> None:
    one = objects(sources)
    for _ in range(2):
        c_play._compile(tmp_path, ["gcc"], [one])
    subprocess.run(one.line(["gcc"]), check=True, cwd=tmp_path)
    assert (tmp_path / "one.o").read_bytes() == (tmp_path / c_play.OBJECTS / "one.o").read_bytes()
