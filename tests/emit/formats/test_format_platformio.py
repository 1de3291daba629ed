"""The PlatformIO library: its manifest by PlatformIO's own check, packed by it, and played from the package."""

import json
from pathlib import Path

import pytest
from building import NAME, run_clean
from formatted import Formatted, check_finds_a_flip, formatted
from packed_library import DEMANDING, MAIN, pack_platformio, plays_the_model, unpacked
from short_scans import short

from tablegen.version import __version__


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("platformio"), "short", "platformio")


def test_it_names_the_c_files_of_the_build(built: Formatted) -> None:
    manifest = json.loads(built.files["library.json"])
    assert (manifest["name"], manifest["version"]) == (NAME, __version__)
    assert manifest["headers"] == [f"{NAME}.h", f"{NAME}_program.h"]
    c_files = {name for name in built.files if name.endswith((".c", ".h"))}
    assert set(manifest["export"]["include"]) == c_files == set(built.files) - {"library.json", "manifest.json"}
    sources = manifest["build"]["srcFilter"]
    assert sources[0] == "-<*>"
    assert {each.removeprefix("+<").removesuffix(">") for each in sources[1:]} == {
        name for name in c_files if name.endswith(".c")
    }


def test_a_header_only_build_has_its_own_headers(tmp_path: Path) -> None:
    files = short(tmp_path, {"emit.formats": ["platformio"], "emit.header_only": True}).files
    manifest = json.loads(files["library.json"])
    assert manifest["headers"] == [f"{NAME}.h", "dac_sequencer.h"]
    assert set(manifest["export"]["include"]) < files.keys()


def test_a_changed_build_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "platformio"), "platformio", ["library.json", "tablegen_options.h"])


@pytest.mark.rest
def test_what_platformio_packs_plays_the_model(tmp_path: Path) -> None:
    """Without an option of the compiler, whatever the scan needs."""
    built = short(tmp_path, {"emit.formats": ["platformio", "verilog"], **DEMANDING})
    done = pack_platformio(built.folder, tmp_path / "own")
    assert done.returncode == 0, done.stdout + done.stderr
    packed = tmp_path / "packed"
    names = unpacked(tmp_path / "own" / "packed.tar.gz", packed)
    named = json.loads(built.files["library.json"])["export"]["include"]
    assert {name for name in names if name.endswith((".c", ".h"))} == set(named)
    assert any(name.endswith(".v") for name in built.files)
    assert not any(name.endswith((".v", ".vh", ".mem")) for name in names)
    (packed / "main.c").write_text(MAIN, "ascii")
    sources = [packed / name for name in sorted(named) if name.endswith(".c")]
    run_clean(["gcc", "-std=c99", "-O1", f"-I{packed}", packed / "main.c", *sources, "-o", packed / "play"])
    assert plays_the_model(packed / "play", built.plan.program)


@pytest.mark.rest
def test_a_version_that_is_none_is_refused(tmp_path: Path) -> None:
    """A negative control: PlatformIO reads the manifest."""
    built = short(tmp_path, {"emit.formats": ["platformio"]})
    wrong = built.files["library.json"].replace(f'"{__version__}"'.encode(), b'"none"')
    (built.folder / "library.json").write_bytes(wrong)
    done = pack_platformio(built.folder, tmp_path / "own")
    assert done.returncode != 0
    assert "version" in done.stdout + done.stderr
