"""What the tests of ``tablegen verify`` share: damage, the table that it prints, its processes."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from editing import Outcome


def verdicts(outcome: Outcome) -> dict[tuple[str, str], str]:
    """The last column of the table by its first two."""
    rows = [re.split(r"  +", line) for line in outcome.out.splitlines() if re.search(r"  (ok|FAILED)$", line)]
    return {(row[0], row[1]): row[-1] for row in rows}


def failed(outcome: Outcome) -> set[tuple[str, str]]:
    return {key for key, verdict in verdicts(outcome).items() if verdict == "FAILED"}


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("ascii")
    assert text.count(old) == 1, f"{path.name} has {text.count(old)} of {old!r}"
    path.write_text(text.replace(old, new), "ascii")


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
    found = re.match(r"tick (\d+) \(line (\d+), tick (\d+) of it\)\n  expected  (.*)\n  got       (.*)\n", told)
    assert found, told
    return int(found[1]), int(found[2]), int(found[3]), found[4], found[5]


def command(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own."""
    line = [sys.executable, "-m", "tablegen", "verify", *map(str, arguments)]
    return subprocess.run(
        line, env={**os.environ, **environment}, capture_output=True, text=True, check=False, timeout=120
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
            printed, told = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.terminate()  # otherwise one would wait for ever
            raise
    assert process.returncode == 130
    assert (printed, told.strip()) == ("", "interrupted; the output directory was left as it was")
    assert list(temporary.iterdir()) == []
    assert processes_below(temporary) == []
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == before
