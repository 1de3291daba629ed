"""CPU time of whole processes beside that of a baseline, and versions of tools."""

import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import version

from build_cost import cpu_seconds

ROUNDS = 11
PYTHON = sys.executable


def least_cpu(commands: Mapping[str, Sequence[str]], rounds: int = ROUNDS) -> dict[str, float]:
    """CPU seconds of each command: the least of ``rounds``, in which all are run in turn.

    What else the machine does only adds time, so that the least is the command's own; and a machine whose speed drifts
    slows all of them.
    """
    for command in commands.values():
        cpu_seconds(list(command))  # once, to fill the file cache
    least = dict.fromkeys(commands, float("inf"))
    for _ in range(rounds):
        for name, command in commands.items():
            least[name] = min(least[name], cpu_seconds(list(command)))
    return least


def python_version() -> dict[str, str]:
    """Of the interpreter and of numpy."""
    return {"Python": sys.version.split()[0], "numpy": version("numpy")}


def tool_version(command: str, option: str = "--version") -> str:
    """The number in what a tool says first about its version; raises ``FileNotFoundError`` where there is none."""
    done = subprocess.run([command, option], capture_output=True, text=True, check=False)
    said, number = done.stdout + done.stderr, re.compile(r"\b\d+\.\d+(\.\d+)*")
    found = number.search(re.sub(r"\(.*?\)", "", said)) or number.search(said)  # packages say theirs in brackets
    return found[0] if found else "of unknown version"
