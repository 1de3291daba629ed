"""The commands of a page of docs/, run in its order in one shell, and what the page shows of their output.

Blocks in `sh` are run, and those in `python`, each as a program. Of blocks in `text` the lines that begin with "$ "
are run, and what they print is compared: whole numbers within 1, others within a tenth, and "..." stands for any lines.
A comment `<!-- file: NAME -->` before a block makes it a file, `<!-- not run: REASON -->` leaves it out, and so does
`<!-- tested: WHERE -->`. Any other language has to have one of these.
"""

import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from building import REPOSITORY
from limits import PATIENCE_S

_BLOCK = re.compile(r"^(?:<!-- ([a-z ]+): (.*?) -->\n)?^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass
class Shown:
    """A command of a dialogue, and what the page says that it prints."""

    command: str
    lines: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Script:
    """``steps`` are shell text, files, and commands with their output; ``left_out`` has the reasons."""

    steps: list[str | tuple[str, str] | Shown]
    left_out: list[str]


def script_of(page: str) -> Script:
    """Of the text of a page. Raises ``ValueError`` for a block that nobody runs."""
    steps: list[str | tuple[str, str] | Shown] = []
    left_out = []
    for kind, argument, language, text in _BLOCK.findall(page):
        if kind in {"not run", "tested"}:
            left_out.append(f"{kind}: {argument}")
        elif kind == "file":
            steps.append((argument, text))
        elif language == "sh":
            steps.append(text)
        elif language == "python":
            steps.append(f"python - <<'END OF THE PROGRAM'\n{text}END OF THE PROGRAM")
        elif language == "math":
            continue
        elif language == "text":
            steps += _dialogue(text)
        else:
            raise ValueError(f"a block in {language} is neither a file nor left out: {text[:60]!r}")
    return Script(steps, left_out)


def _dialogue(text: str) -> list[Shown]:
    found: list[Shown] = []
    for line in text.splitlines():
        if line.startswith("$ "):
            found.append(Shown(line[2:]))
        elif found:
            found[-1].lines.append(line)
    return found


def run_page(page: Path, folder: Path, before: str = "") -> list[str]:
    """Run a page in a folder beside the examples, after the commands ``before`` it; what differs from it, a line each.

    They make what a reader of the page has already: the files of ``tablegen init``, a build.
    """
    if not (folder / "examples").exists():
        (folder / "examples").symlink_to(REPOSITORY / "examples")
    script = script_of(page.read_text("utf-8"))
    text, outputs = [f"set -e\n{before}\n"], []
    for number, step in enumerate(script.steps):
        if isinstance(step, str):
            text.append(f"{step}\n")
        elif isinstance(step, Shown):
            output = folder / f"output_{number}"
            outputs.append((step, output))
            text.append(f"{{\n{step.command}\n}} >{output} 2>&1\n")
        else:
            (folder / f"file_{number}").write_text(step[1], "utf-8")
            text.append(f"cp {folder}/file_{number} {step[0]}\n")
    (folder / "page.sh").write_text("".join(text), "utf-8")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", folder / "page.sh"],
        cwd=folder,
        env={**os.environ, "PATH": path, "COLUMNS": "120"},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    said = "".join(f"$ {step.command}\n{output.read_text('utf-8')}" for step, output in outputs if output.exists())
    assert done.returncode == 0, f"{page.name}\n{done.stdout[-2000:]}\n{said[-2000:]}\n{done.stderr[-2000:]}"
    return [line for step, output in outputs for line in different(step, output.read_text("utf-8"))]


def different(step: Shown, printed: str) -> list[str]:
    """The lines of a page that a command did not print in this order; without "..." it has to print no others."""
    waiting = [line.rstrip() for line in printed.splitlines()]
    found, free = [], False
    for line in step.lines:
        if line.strip() == "...":
            free = True
            continue
        places = range(len(waiting)) if free else range(min(1, len(waiting)))
        at = next((i for i in places if same(line.rstrip(), waiting[i])), None)
        if at is None:
            found.append(f"$ {step.command}: {line!r} is not there, but {waiting[:3]}")
            return found
        del waiting[: at + 1]
        free = False
    if waiting and not free:
        found.append(f"$ {step.command}: also {waiting[:3]}")
    return found


def same(shown: str, printed: str) -> bool:
    """Whether a line is that of the page: whole numbers within 1, as codes are, others within a tenth, or 0.02."""
    if _NUMBER.sub("#", shown) != _NUMBER.sub("#", printed):
        return False
    pairs = zip(_NUMBER.findall(shown), _NUMBER.findall(printed), strict=True)
    return all(abs(float(one) - float(other)) <= _room(one) for one, other in pairs)


def _room(number: str) -> float:
    """How far a number may be from the one of the page."""
    return 1.0 if number.lstrip("+-").isdigit() else 0.02 + 0.1 * abs(float(number))
