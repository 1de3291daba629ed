"""What the tests of ``tablegen verify`` share: damage, the table that it prints, its processes."""

import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from building import NAME, Variant, build
from editing import Outcome
from limits import PATIENCE_S
from replacing import replace

from tablegen.fixedpoint.program import Program
from tablegen.manifest.format import content_hash


def verdicts(outcome: Outcome) -> dict[tuple[str, str], str]:
    """The last column of the table by its first two."""
    rows = [
        re.split(r"  +", line) for line in outcome.out.splitlines() if re.search(r"  (ok|FAILED|not exercised)$", line)
    ]
    return {(row[0], row[1]): row[-1] for row in rows}


def failed(outcome: Outcome) -> set[tuple[str, str]]:
    return {key for key, verdict in verdicts(outcome).items() if verdict == "FAILED"}


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("ascii")
    assert text.count(old) == 1, f"{path.name} has {text.count(old)} of {old!r}"
    path.write_text(text.replace(old, new), "ascii")


def make_right(folder: Path, version: str | None = None) -> None:
    """What a tamperer does at last: the hashes of the files, and of the plan in all of them, are made right again.

    With another ``version`` the files cannot be compared with those that are installed.
    """
    manifest = json.loads((folder / "manifest.json").read_bytes())
    before = manifest["hash"]
    record = {key: value for key, value in manifest.items() if key not in ("tablegen", "hash", "formats", "files")}
    record["axes"] = {
        axis: {key: value for key, value in content.items() if key != "certificate"}
        for axis, content in manifest["axes"].items()
    }
    manifest["hash"] = content_hash(record)
    manifest["tablegen"] = version or manifest["tablegen"]
    for name in manifest["files"]:
        path = folder / name
        if path.is_file():
            content = path.read_bytes().replace(before.encode(), manifest["hash"].encode())
            path.write_bytes(content)
            manifest["files"][name] = hashlib.sha256(content).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest), "ascii")


def edit_manifest(folder: Path, *path: str | int, value: Any) -> None:
    """Put another value into the manifest."""
    manifest = json.loads((folder / "manifest.json").read_bytes())
    place = manifest
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    (folder / "manifest.json").write_text(json.dumps(manifest), "ascii")


def differing(outcome: Outcome) -> tuple[int, int, int, str, str]:
    """The first differing tick as it is told: tick, line, tick of the line, expected and got."""
    told = outcome.err.split("first difference: ")[1]
    found = re.match(
        r"tick (\d+) \(line (\d+)(?: of a variation)?, tick (\d+) of it\)\n  expected  (.*)\n  got       (.*)\n", told
    )
    assert found, told
    return int(found[1]), int(found[2]), int(found[3]), found[4], found[5]


@dataclass(frozen=True)
class Heard:
    """The first tick of a period on which words other than the program's are heard, and the codes of that tick."""

    tick: int
    wanted: int
    got: int


def first_heard(program: Program, word: int, value: int) -> Heard:
    """What comes of another value of a word; the slew guard holds a step that is too large."""
    words = program.words.copy()
    words[word] = value
    k = np.arange(program.ticks)
    wanted, altered = program.codes(k), replace(program, words=words).codes(k)
    tick = int(np.flatnonzero(wanted != altered)[0])
    before, most = int(wanted[tick - 1]), program.output.max_step
    return Heard(tick, int(wanted[tick]), before + int(np.clip(altered[tick] - before, -most, most)))


def check_first_difference(outcome: Outcome, axis: str, heard: Heard, line_ticks: int) -> None:
    """The tick and both codes are told."""
    _, line, tick, expected, got = differing(outcome)
    assert line * line_ticks + tick == heard.tick
    assert f"{axis} {heard.wanted}," in expected
    assert f"{axis} {heard.got}," in got


def with_a_long_table(folder: Path, lines: int) -> Path:
    """A build whose y is a direct table of so many lines of 2000 words."""
    changes = {
        "y.table": {"mode": "direct", "bits": 16},
        "timing.lines": lines,
        "timing.ticks_per_line": 2000,
        "timing.line_rate_hz": 250.0,
    }
    return build(folder, Variant(changes)).folder


@dataclass(frozen=True)
class Report:
    """A JUnit file: what its suite counts, and the failures of each case by the first two columns of the table."""

    counts: tuple[str | None, str | None, str | None]  # tests, failures, errors
    cases: dict[tuple[str, str], list[ElementTree.Element]]
    manifest_sha256: str | None
    seconds: float
    times: list[float]

    @property
    def failed(self) -> set[tuple[str, str]]:
        return {case for case, failures in self.cases.items() if failures}


def read_report(path: Path) -> Report:
    """Its one suite."""
    (suite,) = ElementTree.parse(path).getroot()
    found = suite.findall("testcase")
    cases = {}
    for case in found:
        classname = case.get("classname", "")
        assert classname.startswith(f"{NAME}."), classname
        cases[classname.removeprefix(f"{NAME}."), case.get("name", "")] = list(case)
    assert len(cases) == len(found), "two cases of one name"
    counts = suite.get("tests"), suite.get("failures"), suite.get("errors")
    properties = {one.get("name"): one.get("value") for one in suite.findall("properties/property")}
    seconds, times = float(suite.get("time", "nan")), [float(case.get("time", "nan")) for case in found]
    return Report(counts, cases, properties.get("manifest_sha256"), seconds, times)


def command(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own."""
    return _command(["-m", "tablegen"], arguments, environment)


def command_without(packages: Sequence[str], *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """The same where these packages are not installed."""
    return command_after(f"import sys; sys.modules.update({dict.fromkeys(packages)})", *arguments)


def command_after(statements: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """The same in a process that has run some Python before."""
    return _command(["-c", f"{statements}; from tablegen.cli import main; main()"], arguments, {})


def _command(
    start: Sequence[str], arguments: Sequence[str | Path], environment: Mapping[str, str]
) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, *start, "verify", *map(str, arguments)]
    return subprocess.run(
        line, env={**os.environ, **environment}, capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )


def processes_below(folder: Path) -> list[str]:
    """Command lines of processes that name a folder."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            text = entry.read_bytes().replace(b"\0", b" ").decode("utf-8", "replace")
        except OSError:
            continue
        if str(folder) in text and str(os.getpid()) != entry.parent.name:
            found.append(text)
    return found


# The command line with a signal to itself as the last thing that starting the worker does: the worker is at work, and
# nobody has its number yet.
WITHIN_POPEN = """
import os, pathlib, subprocess, sys, time
number, begun = int(sys.argv.pop(1)), sys.argv.pop(1)
class Interrupted(subprocess.Popen):
    def __init__(self, arguments, **options):
        super().__init__(arguments, **options)
        if "tablegen.verification.process_group" not in arguments:
            return  # ldconfig, in the search for libpython
        while not pathlib.Path(arguments[-1], begun).exists():
            time.sleep(0.01)
        os.kill(os.getpid(), number)
subprocess.Popen = Interrupted
from tablegen.cli import main
main()
"""


def check_interruption(
    folder: Path, temporary: Path, number: signal.Signals, begun: str, *arguments: str, within_popen: bool = False
) -> None:
    """Interrupt a verification: no process, no folder may stay, and the build has to be as it was.

    The signal comes once there is something of the name ``begun`` in the folder of the verification: from outside, or
    before Popen has returned.
    """
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    temporary.mkdir()
    start = ["-c", WITHIN_POPEN, str(int(number)), begun] if within_popen else ["-m", "tablegen"]
    with subprocess.Popen(
        [sys.executable, *start, "verify", str(folder), *arguments],
        env={**os.environ, "TMPDIR": str(temporary)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        if not within_popen:
            while not list(temporary.glob(f"tablegen-*/{begun}")):
                assert process.poll() is None, process.communicate()
                time.sleep(0.01)
            process.send_signal(number)
        try:
            printed, told = process.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.terminate()  # otherwise one would wait for ever
            raise
    assert process.returncode == 130
    assert (printed, told.strip()) == ("", "interrupted")
    assert list(temporary.iterdir()) == []
    assert processes_below(temporary) == []
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == before
