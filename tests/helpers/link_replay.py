"""The same device on other processors and by other compilers: what was written down of one is done with another."""

import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from building import run_clean, tool
from limits import ENDED, within
from link_device import HERE, LINES, HostDevice, Line
from link_random import KEY, Dialogue

from tablegen.base.resources import c_link, c_runtime, c_store
from tablegen.verification.play.sequencer_shape import SequencerShape

_REPLAY_S = 240  # of CPU time; in an emulator it takes ten
STEPS = 200


@dataclass(frozen=True)
class Replay:
    """What was done with a device, in the order of lines, and what came out: bytes, then lines that were played."""

    bits: int  # of storage
    notes: str
    heard: str
    lines: tuple[str, ...]


def line_text(line: Line) -> str:
    """A line that was played, as a replay prints it."""
    return f"{line.generation} {line.line} {line.ticks} {line.crc:08x} {line.markers:02x} {line.faults:02x}"


def replay_of(device: HostDevice, heard: bytes) -> Replay:
    """Of a device that took notes from its start."""
    assert device.notes is not None
    lines = [line_text(line) for line in device.lines()]
    return Replay(8 * device.library.word_bytes, "\n".join(device.notes) + "\n", heard.hex(), tuple(lines))


def random_replay(
    shape: SequencerShape,
    seed: int,
    keyed: bool = False,
    modes: bool = False,
    store: bool = False,
    moves: bool = False,
    plays: bool = False,
) -> Replay:
    """Of a random dialogue, which the model has told to be right; with ``modes`` of a COMMIT, kept programs, moves, and
    programs that a host plays by number.
    """
    key, how = KEY if keyed else b"", {"store": store, "modes": modes, "moves": moves, "plays": plays}
    dialogue = Dialogue(shape, seed, key, notes=True, **how)
    dialogue.play(STEPS)
    return replay_of(dialogue.device, bytes(dialogue.heard))


def compile_replay(
    program: Path,
    bits: int,
    compiler: Sequence[str] = ("gcc",),
    options: Sequence[str] = ("-std=c99", "-O1"),
    sources: Iterable[Path] | None = None,
) -> Path:
    """The device that replays, for storage of so many bits; ``sources`` in place of runtime and link."""
    runtime = list(sources) if sources is not None else [*c_runtime(), *c_link(), *c_store()]
    folders = sorted({str(file.parent) for file in runtime})
    run_clean(
        [
            *compiler, *options, "-Wall", "-Wextra", "-Werror", f"-DDAC_TABLE_STORAGE_BITS={bits}",
            f"-DDAC_OUTPUT_STORAGE_BITS={bits}", *(f"-I{folder}" for folder in folders),
            f"-I{LINES}", f"-I{HERE}", *(file for file in runtime if file.suffix == ".c"), HERE / "link_device.c",
            HERE / "link_replay.c", "-o", program,
        ]
    )  # fmt: skip
    return program


def replay(program: Path, what: Replay, emulator: str | None = None) -> subprocess.CompletedProcess[str]:
    """Do again what was done; status ``ENDED`` where it hangs."""
    command = [str(program)]
    if emulator is not None:
        command = [tool(emulator), *command]
    command = within(_REPLAY_S, command)
    return subprocess.run(command, input=what.notes, capture_output=True, text=True, check=False)


def differs(program: Path, what: Replay, emulator: str | None = None) -> str | None:
    """Replay with a program; says what is not as it was."""
    done = replay(program, what, emulator)
    if done.returncode == ENDED:
        return "it hangs"
    if done.returncode:
        return f"status {done.returncode}: {done.stderr[-2000:]}"
    rows = done.stdout.splitlines()
    heard = "".join(row for row in rows if " " not in row)
    lines = tuple(row for row in rows if " " in row)
    if heard != what.heard:
        at = next(i for i, (a, b) in enumerate(zip(heard + "..", what.heard + "..", strict=False)) if a != b)
        return f"byte {at // 2} of {len(what.heard) // 2} is another"
    return None if lines == what.lines else "lines differ"
