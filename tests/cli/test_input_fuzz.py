"""Damaged files of every kind: a status, and a message that a terminal can show; no traceback, no hang, no flood.

Each share is a process of its own, limited in CPU time, whose memory is measured. Seeds are fixed.
"""

import os
import random
import re
import resource
import sys
import traceback
import warnings
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, Outcome, edited, run, write_pair
from gwyfile.objects import GwyContainer, GwyDataField
from image_writers import ascii_of, npy, png
from instrument_files import asd, createc, ibw, iso28600, jpk, mdt, nid, park, spm, sxm, wsxm
from limits import limit
from mutating import damaged, damaged_json
from PIL import Image as Pillow
from sets import long

STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]")
MOST_MEMORY_BYTES = 500 << 20
FRESH_BYTES = 64 << 20  # of a process that has imported what these tests do, and nothing of other tests
CPU_S_PER_CASE = 5
HEIGHTS = np.round(np.random.default_rng(1).uniform(0.0, 60000.0, (33, 40)))
SMALL = edited(
    SCAN,
    "name = 'little'",
    *("timing.lines = 12", "timing.pixels = 20", "dac.update_rate_hz = 50e3", "y.band_limit.harmonics = 16"),
    *("x.table.length = 128", "y.table.length = 64", "- [limits]"),
)
TABLES = {
    "offset": "offset_v,apparent_nm\n0,100\n25,110\n50,120\n75,131\n100,140\n",
    "size": "drive_v,actual_nm\n10,95\n20,200\n40,430\n80,900\n",
    "frequency": "frequency_hz,gain\n10,1\n100,0.97\n1000,0.94\n5000,0.93\n",
    "resonance": "frequency_hz,gain,phase_deg\n"
    + "".join(f"{1500 * n},{1 / abs(1 - (n / 27) ** 2 + 0.05j * n / 27):.6f},{-0.4 * n}\n" for n in range(1, 40)),
}


def pictures() -> dict[str, bytes]:
    made = {
        "npy": npy(HEIGHTS),
        "png": png(HEIGHTS),
        "txt": ascii_of(HEIGHTS[:, :33], " "),
        "csv": ascii_of(HEIGHTS, ","),
    }
    for name, arguments in (("tif", {}), ("tiff", {"compression": "tiff_deflate"})):
        out = BytesIO()
        Pillow.fromarray(HEIGHTS.astype(np.uint16)).save(out, "TIFF", **arguments)
        made[name] = out.getvalue()
    container = GwyContainer()
    container["/0/data/title"] = "Height"
    container["/0/data"] = GwyDataField(HEIGHTS[:33, :33])
    made["gwy"] = b"GWYP" + container.serialize()
    both = {"Height": (HEIGHTS / 3000.0, HEIGHTS / 3000.0)}  # -100 nm to 100 nm are the most of a writer
    made |= {"sxm": sxm(both), "spm": spm(both), "jpk": jpk(both), "asd": asd({"TP": HEIGHTS[np.newaxis] / 3000.0})}
    made["ibw"] = ibw({"HeightTrace": HEIGHTS}, {"ScanRate": "1"})
    small = HEIGHTS / 3000.0
    made |= {
        "stp": wsxm(small),
        "top": wsxm(small, "double"),
        "nid": nid({"Z": (small, small)}),
        "park.tiff": park(small),
    }
    made |= {"mdt": mdt({"1F:Height": small}), "dat": createc([small]), "iso.spm": iso28600({"Z": small})}
    return made


class Files:
    """What is damaged, and what then reads it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.build = folder / "build"
        assert run("build", write_pair(folder, SMALL), "-o", self.build, "-q").status == 0
        self.manifest = (self.build / "manifest.json").read_bytes()
        self.pictures = pictures()

    def one(self, number: int) -> tuple[str, Callable[[], Outcome]]:
        """A case by its number: what it is, and the run of it."""
        chance = random.Random(number)
        kind = ("manifest", "image", "table", "scan", "scanner", "response", "manifest", "image", "table")[number % 9]
        return f"{kind} {number}", getattr(self, f"_{kind}")(chance)

    def _manifest(self, chance: random.Random) -> Callable[[], Outcome]:
        content = damaged_json(self.manifest, chance) if chance.random() < 0.7 else damaged(self.manifest, chance)
        (self.build / "manifest.json").write_bytes(content)
        command = (
            ("verify", self.build, "--target", "files")
            if chance.random() < 0.7
            else ("upload", self.build, "--dry-run")
        )
        return lambda: run(*command)

    def _image(self, chance: random.Random) -> Callable[[], Outcome]:
        ending = chance.choice(sorted(self.pictures))
        path = self.folder / f"trace.{ending}"
        path.write_bytes(damaged(self.pictures[ending], chance))
        other = self.folder / "narrow.npy"  # of another shape: what is read is not fitted, which takes seconds
        other.write_bytes(npy(HEIGHTS[:, :35]))
        return lambda: run("calibrate", "images", "--axis", "x", "--v-max", "100", "--pair", "50", path, other)

    def _table(self, chance: random.Random) -> Callable[[], Outcome]:
        kind = chance.choice(sorted(TABLES))
        path = self.folder / "data.csv"
        path.write_bytes(damaged(TABLES[kind].encode(), chance))
        return lambda: run("calibrate", kind, path, "--axis", "x", "--v-max", "100")

    def _scan(self, chance: random.Random) -> Callable[[], Outcome]:
        return self._checked("scan.toml", damaged(SMALL.encode(), chance))

    def _scanner(self, chance: random.Random) -> Callable[[], Outcome]:
        return self._checked("scanner.toml", damaged(SCANNER.encode(), chance))

    def _response(self, chance: random.Random) -> Callable[[], Outcome]:
        rows = "hz,gain,phase_deg\n" + "".join(f"{f},1.0,{-f / 1e4}\n" for f in (1, 10, 100, 1e3, 1e4, 1e5, 1e6))
        (self.folder / "response.csv").write_bytes(damaged(rows.encode(), chance))
        scanner = edited(SCANNER, "- [x.resonance]", "+ [x.resonance]\nresponse = 'response.csv'")
        return self._checked("scanner.toml", scanner.encode())

    def _checked(self, name: str, content: bytes) -> Callable[[], Outcome]:
        write_pair(self.folder, SMALL)
        (self.folder / name).write_bytes(content)
        return lambda: run("check", self.folder / "scan.toml")


def resident_bytes() -> int:
    """What of this process is in memory now."""
    return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * resource.getpagesize()


def faults(folder: Path, numbers: range) -> list[str]:
    """What went wrong in some cases; this process ends where one of them does not."""
    warnings.simplefilter("error")  # numpy says so where it makes an inf or a nan
    files, found = Files(folder), []
    inherited = resident_bytes()  # of all tests that this process, or the one it was forked from, has run before
    for number in numbers:
        used = resource.getrusage(resource.RUSAGE_SELF)
        limit(int(used.ru_utime + used.ru_stime) + CPU_S_PER_CASE + 1)
        name, case = files.one(number)
        print(name, file=sys.stderr, flush=True)
        try:
            outcome = case()
        except BaseException:
            found.append(f"{name}: {traceback.format_exc()}")
            continue
        text = outcome.out + outcome.err
        if outcome.status not in (0, 2, 3, 5):
            found.append(f"{name}: status {outcome.status}: {text[:300]!r}")
        if outcome.status and not outcome.messages:
            found.append(f"{name}: status {outcome.status} and no message")
        if STEERING.search(text):
            found.append(f"{name}: a raw control: {text[:300]!r}")
        if len(outcome.messages) > 60 or max(map(len, outcome.messages), default=0) > 1300 + len(str(folder)):
            found.append(f"{name}: a flood of {len(outcome.err)} characters in {len(outcome.messages)} lines")
    memory = FRESH_BYTES + (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10) - inherited
    if memory > MOST_MEMORY_BYTES:
        found.append(f"cases {numbers}: {memory >> 20} MiB")
    return found


def in_a_process(folder: Path, numbers: range) -> list[str]:
    """The same in a child, whose end by a signal is a fault of the case that it named last."""
    log, answer = folder / "log", folder / "answer"
    child = os.fork()
    if child == 0:
        try:
            sys.stderr = log.open("w", encoding="utf-8", buffering=1)
            answer.write_text("\n".join(faults(folder, numbers)), "utf-8", "backslashreplace")
            os._exit(0)
        except BaseException:
            answer.write_text(traceback.format_exc(), "utf-8")
            os._exit(1)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        last = log.read_text("utf-8").splitlines()[-1:]
        return [f"{last}: ended by signal {os.WTERMSIG(status)}, after {CPU_S_PER_CASE} s of CPU time"]
    return [line for line in answer.read_text("utf-8").split("\n") if line]


@pytest.mark.common
def test_a_few_damaged_files(tmp_path: Path) -> None:
    assert in_a_process(tmp_path, range(36)) == []


@pytest.mark.rest
@pytest.mark.parametrize("share", long(range(1, 5), range(1, 11)))
def test_two_thousand_damaged_files(share: int, tmp_path: Path) -> None:
    assert in_a_process(tmp_path, range(200 * share, 200 * share + 200)) == []


@pytest.mark.common
def test_a_hang_and_an_escape_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Negative control."""

    def hang() -> Outcome:
        while True:
            pass

    monkeypatch.setattr(Files, "__init__", lambda _self, _folder: None)
    with monkeypatch.context() as impatient:  # for the hang alone: on a slow machine the other cases take longer
        impatient.setattr(sys.modules[__name__], "CPU_S_PER_CASE", 0)
        impatient.setattr(Files, "one", lambda _self, number: (f"hang {number}", hang))
        assert "hang 7" in "".join(in_a_process(tmp_path, range(7, 9)))
    monkeypatch.setattr(Files, "one", lambda _self, _number: ("bad", lambda: Outcome(2, "\x1b[2J", "why\n" * 99)))
    assert [line.split(":")[1].split()[0:2] for line in in_a_process(tmp_path, range(1))] == [
        ["a", "raw"],
        ["a", "flood"],
    ]

    def large() -> Outcome:
        assert len(bytearray(b"\1") * MOST_MEMORY_BYTES) == MOST_MEMORY_BYTES
        return Outcome(0, "", "")

    monkeypatch.setattr(Files, "one", lambda _self, _number: ("large", large))
    assert [line.split()[-1] for line in in_a_process(tmp_path, range(1))] == ["MiB"]
