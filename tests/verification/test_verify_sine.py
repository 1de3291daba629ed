"""``tablegen verify`` of a scan with a sine on its fast axis: what passes in C, and the tampering that is found."""

import hashlib
import json
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from shutil import copytree
from typing import Any

import pytest
from kept_plays import own_program_alone
from sets import long
from sine_scans import short_sine

from tablegen.api.build import build as build_scan
from tablegen.manifest.read import parse_manifest, read_build
from tablegen.verification.run import verify

NAME = "annexin_200nm"
TICKS = 3000  # that the Verilog plays of it: lines, swaps and a park


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sine")
    setup = short_sine(folder)
    build_scan(setup, folder / "out", formats=["c", "verilog"])
    return folder / "out"


def failures(folder: Path) -> str:
    """What verify says of a build, without the part that compiles."""
    return "\n".join(verify(folder, "files").failures)


@pytest.mark.common
def test_a_build_verifies_in_c(build: Path) -> None:
    """The markers of the table as the emitted C plays them, tick by tick, and every figure of the certificate."""
    report = verify(build, "c")
    assert report.failures == []
    assert any(check.subject == "markers" for check in report.checks)


@pytest.mark.rest
@pytest.mark.parametrize("requests", long([False], [False, True]), ids=["alone", "with requests"])
def test_it_verifies_in_verilog(build: Path, requests: bool) -> None:
    """The markers of the table as the emitted modules play them, uploaded and booted by the emitted top."""
    with nullcontext() if requests else own_program_alone():
        report = verify(build, "verilog", axis="blocks", ticks=TICKS)
    assert report.failures == []
    (top,) = (check for check in report.checks if check.subject == "top")
    assert top.failure is None


def test_tampering_of_a_memory_is_found(build: Path, tmp_path: Path) -> None:
    """A pixel of the memory file gives a tick to the next one, and the manifest has the digest of that file."""
    folder = copytree(build, tmp_path / "out")
    path = folder / f"{NAME}_pixels.mem"
    words = [int(word, 16) for word in path.read_text("ascii").split()]
    words[3] -= 1
    words[4] += 1
    path.write_text("".join(f"{word:04x}\n" for word in words), "ascii")
    manifest = folder / "manifest.json"
    plain = json.loads(manifest.read_text("ascii"))
    plain["files"][path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    manifest.write_text(json.dumps(plain), "ascii")
    assert f"{path.name}: word 3 is" in failures(folder)


def test_it_reads_back_as_it_was_built(build: Path) -> None:
    schedule = read_build(build).program.schedule
    assert schedule.pixel_table is not None
    text = (build / f"{NAME}.c").read_text("ascii")
    row = ", ".join(map(str, schedule.pixel_table[0][:10]))
    assert f"{NAME}_pixel_table[] = {{\n    {row}" in text
    assert "DAC_PIXEL_PROGRAM" in (build / f"{NAME}_program.c").read_text("ascii")


def moved_pixel(plain: dict[str, Any]) -> None:
    """A pixel gives two ticks to the next one: the window stays full."""
    counts = plain["sequence"]["pixel_table"][1]
    counts[0] -= 2
    counts[1] += 2


def other_errors(plain: dict[str, Any]) -> None:
    plain["axes"]["x"]["certificate"]["pixels"]["rms_percent"]["forward"] *= 1.01


def other_error(plain: dict[str, Any]) -> None:
    plain["axes"]["x"]["certificate"]["pixels"]["errors_percent"]["backward"][7] += 0.01


def no_pixels(plain: dict[str, Any]) -> None:
    del plain["axes"]["x"]["certificate"]["pixels"]


def other_place(plain: dict[str, Any]) -> None:
    plain["axes"]["x"]["fourier"]["place"]["b"][0] += 0.02


TAMPERED: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "a pixel": (moved_pixel, "sequence.pixel_table is"),
    "an rms": (other_errors, "pixels.rms_percent.forward"),
    "the error of a pixel": (other_error, "pixels.errors_percent.backward"),
    "no figures": (no_pixels, "certificate.pixels is missing"),
    "the position": (other_place, "sequence.pixel_table is"),
}


@pytest.mark.parametrize("what", TAMPERED)
def test_tampering_is_found_though_the_hash_is_right(what: str, build: Path, tmp_path: Path) -> None:
    change, says = TAMPERED[what]
    folder = copytree(build, tmp_path / "out")
    path = folder / "manifest.json"
    plain = json.loads(path.read_text("ascii"))
    change(plain)
    plain["hash"] = parse_manifest(json.dumps(plain).encode("ascii")).own_hash
    plain["files"] = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in plain["files"]}
    path.write_text(json.dumps(plain), "ascii")
    assert says in failures(folder)


def test_the_build_itself_is_not_blamed(build: Path) -> None:
    assert failures(build) == ""
