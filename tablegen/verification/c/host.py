"""The C of a build on this machine: compiled once, and played a tick a call and many ticks a call.

The runtime and the bench are the same for most builds, and their objects are kept. What the build has of its own is
compiled every time.
"""

import os
import shlex
from dataclasses import asdict
from functools import cached_property
from pathlib import Path

import numpy as np

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.verification import process_group as worker
from tablegen.verification.c import play as c_play
from tablegen.verification.c.bench import BENCH, OWN_SOURCES, CRecord, constants_written, macros, require_compiler
from tablegen.verification.c.objects import Objects
from tablegen.verification.c.program import MOST_FILLED, OPTIONS, CProgram
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.sequencer_shape import SCRIPT

_LINK = "dac_link"  # prefix of the link's sources
_MIN_TICKS_PER_SECOND = 5000  # a slower program counts as hanging
_PROGRAM = "step/stream_bench"
_STEP, _FILL = "step_capture.bin", "fill_capture.bin"


def host_compiler() -> str:
    """Return the C compiler of the environment."""
    return os.environ.get("CC") or "cc"


class HostPlayer:
    """A player on this machine: it compiles a program, and plays the script in ``work`` in both ways."""

    def __init__(self, work: Path, program: CProgram, script: str, ticks: int) -> None:
        self._compiler = host_compiler()
        self._work, self._program, self._script, self._ticks = work, program, script, ticks

    def played(self, fills: bool) -> CRecord:
        """Return what the bench captured, one tick or (``fills``) many ticks a call.

        Raises
        ------
        SimulationFailed
            If the bench does not end by itself.
        """
        record = _FILL if fills else _STEP
        if record in self._failures:
            raise SimulationFailed(self._failures[record])
        capture = np.frombuffer(read_bytes(self._work / record, BUILD_FILE), dtype="<u8")
        return CRecord.of(capture, self._script, constants_written(self._program.bench))

    @cached_property
    def _failures(self) -> dict[str, str]:
        """The reasons for missing records; both are played by one process."""
        objects = self._objects()
        job = {
            "compiler": require_compiler(self._compiler),
            "objects": [asdict(one) for one in objects],
            "line": self._line(objects),
            "program": _PROGRAM,
            "script": SCRIPT,
            "plays": [(_STEP, ["steps"]), (_FILL, [])],
            "most_bytes": 1_000_000
            + 32 * self._ticks,  # twice the right size: a few ticks too many are reported as such
            "timeout": 60.0 + self._ticks / _MIN_TICKS_PER_SECOND,
        }
        failures: dict[str, str] = worker.run(self._work, c_play.__name__, job)
        return failures

    def _objects(self) -> list[Objects]:
        """Return the objects that do not depend on the build: the sequencer, the link, the bench."""
        program, options = self._program, _options()
        words = [*options, *macros(program.choices)]
        runtime, bench = list(map(str, program.runtime)), list(map(str, {*BENCH, *OWN_SOURCES}))
        parts = [path for path in program.runtime if path.suffix == ".c"]
        link = [str(path) for path in parts if path.name.startswith(_LINK)]
        played = [str(path) for path in parts if not path.name.startswith(_LINK)]
        return [
            Objects(played, words, runtime),
            # The link is compiled and linked too, but nothing plays it: it does not have to be fast.
            *([Objects(link, [*words, "-O0"], runtime)] if link else []),
            Objects(list(map(str, OWN_SOURCES)), [*options, *self._macros()], [*runtime, *bench]),
        ]

    def _line(self, objects: list[Objects]) -> list[str]:
        """Return the command that compiles the build's own sources and links everything."""
        program = self._program
        places = sorted({str(path.parent) for path in (*program.sources, *BENCH)})
        own = [str(path) for path in program.own if path.suffix == ".c"]
        return [
            *(*require_compiler(self._compiler), *_options(), *self._macros(), *(f"-I{place}" for place in places)),
            *(*own, *(f"{c_play.OBJECTS}/{name}" for one in objects for name in one.names), "-o", _PROGRAM),
        ]

    def _macros(self) -> list[str]:
        return macros(self._program.defines | {"BENCH_FILL": MOST_FILLED})


def _options() -> list[str]:
    """Return the options of the compiler, without warnings, which are for whoever compiles the firmware."""
    try:
        return [*OPTIONS, *shlex.split(os.environ.get("CFLAGS", "")), "-w"]
    except ValueError as error:
        raise SimulationFailed(f"CFLAGS cannot be read: {error}") from None
