"""Arduino's builder, core and libraries, as Debian has them."""

import re
import subprocess
from itertools import islice
from pathlib import Path
from subprocess import CompletedProcess

from building import run, tool

_SHARE = Path("/usr/share/arduino")
_BUILDER = (
    "arduino-builder", "-compile", "-hardware", "/usr/share/arduino-builder", "-hardware", _SHARE / "hardware",
    "-tools", _SHARE / "hardware", "-warnings", "all",
    # Debian's core 1.8.7 takes DECIMAL_DIG from a header in which Debian's avr-gcc 5.4 has it for C alone.
    "-prefs", "compiler.cpp.extra_flags=-DDECIMAL_DIG=__DECIMAL_DIG__",
)  # fmt: skip
_SIMAVR = ("simavr", "-m", "atmega2560", "-f", "16000000")


def run_builder(sketch: Path, board: str, folder: Path, *options: str | Path) -> CompletedProcess[str]:
    """Compile a sketch for a board of the AVR core into a folder, whatever the exit status."""
    return run([*_BUILDER, *options, "-fqbn", f"arduino:avr:{board}", "-build-path", folder, sketch])


def own_warnings(done: CompletedProcess[str]) -> list[str]:
    """The warnings of the compiler about anything but the core."""
    return [line for line in done.stderr.splitlines() if "warning:" in line and not line.startswith(f"{_SHARE}/")]


def simulated_output(executable: Path) -> str:
    """What a program sends over the UART of a Mega in simavr until it sleeps for good."""
    done = run([*_SIMAVR, executable])
    return re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr)  # simavr colours a line, and ends it in dots


def simulated_lines(executable: Path, count: int) -> list[str]:
    """Return the first lines of two numbers that a program sends over the UART of a Mega in simavr."""
    command = [tool(_SIMAVR[0]), *_SIMAVR[1:], executable]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as simavr:
        assert simavr.stdout is not None
        plain = (re.sub(r"\x1b\[[0-9;]*m", "", line) for line in simavr.stdout)
        pairs = (re.match(r"\d+ \d+\b", line) for line in plain)
        found = [pair[0] for pair in islice(filter(None, pairs), count)]
        simavr.kill()
    return found
