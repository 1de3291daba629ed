"""The C sequencer of a build: what a user would compile plays, on this machine or on an emulated Cortex-M.

The bench is compiled with the emitted header and arrays and with the ``dac_*.c`` of the directory. A session is played
twice, a tick a call (``dac_sequencer_step``) and many ticks a call (``dac_sequencer_fill``).
"""

import os
import shlex
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.emit.constants import scan_constants
from tablegen.emit.content import Content
from tablegen.emit.formats.c import arrays_file
from tablegen.emit.stored import stored_content
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.program import Program
from tablegen.manifest.read import NotABuild, StoredBuild
from tablegen.reading import BUILD_FILE, read_bytes
from tablegen.verification import c_play, worker
from tablegen.verification.bench import SCRIPT, SequencerShape
from tablegen.verification.build import Outcome, PlayJob, differing_check
from tablegen.verification.c_bench import (
    OWN_SOURCES,
    CPlayed,
    compiler_line,
    constants_written,
    require_compiler,
    script_words,
    storage_bits,
)
from tablegen.verification.capture import make_capture, recaptured
from tablegen.verification.checks import (
    Check,
    check_codes,
    check_faults,
    check_filled,
    check_no_faults,
    check_states,
    check_waveform,
    first_difference,
)
from tablegen.verification.directory import copies, some
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.placement import Placement
from tablegen.verification.session import make_session
from tablegen.verification.stream import Script, Words, read_states

_UNTOLD = ("armed", "running")  # what the status of the C sequencer does not tell
_MAX_TABLE_WORDS = 1 << 17  # words of a direct table that dac_sequencer_load() accepts
_CHUNK_TICKS = 1 << 14  # ticks that are worked out together, in the cache
_MAX_FILL_TICKS = 600  # ticks per call
_LINK = "dac_link"  # how the names of the link's sources begin
_MIN_TICKS_PER_SECOND = 5000  # a slower program is taken for hanging


@dataclass(frozen=True)
class CTarget:
    """Where the C sequencer plays, and whether it renders its tables from Fourier words."""

    machine: Literal["c", "cortex-m"]
    fourier: bool = False
    format_name: str = "c"

    def require(self) -> None:
        """A compiler, and what runs its output."""
        if self.machine == "cortex-m":
            from tablegen.verification.emulate import require_emulator

            require_emulator()
        else:
            require_compiler(_compiler())

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """``direct`` tables may be longer than the runtime takes, and are not rendered."""
        for name, axis in stored.axes:
            if axis.table.mode == "direct" and len(axis.table.words) > _MAX_TABLE_WORDS:
                raise NotABuild(
                    f"{folder}: the table of {name} has {len(axis.table.words)} words, the C sequencer plays at most "
                    f"{_MAX_TABLE_WORDS}; mode = 'interpolated' needs fewer"
                )
        if self.fourier and not any(axis.table.mode != "direct" for _, axis in stored.axes):
            raise NotABuild(
                f"{folder}: both tables are direct, and no device renders those; verify it without --fourier"
            )

    def play(self, job: PlayJob) -> Outcome:
        """One session by steps, and the same by fills."""
        stored, work, progress = job.stored, job.work, job.progress
        player = _compiler() if self.machine == "c" else "arm-none-eabi-gcc, Cortex-M4"
        sources, absent = _sources(job.folder, work, stored, self.fourier)
        if absent:
            return Outcome([Check("program", player, "nothing", failure="program: " + some(absent))])

        progress("playing the integer model")
        session = make_session(stored.program, None, job.most_ticks, job.seed, Placement())
        script = session.script
        shape = SequencerShape.of((stored.program.x, stored.program.y))
        text = script_words(script, shape)  # which ends the script
        (work / SCRIPT).write_text(text, "ascii")
        ticks = len(script.expected)
        wanted = {
            "shape": asdict(shape),
            "sources": [str(path) for path in sources],
            "defines": self._defines(stored),
        }
        try:
            progress(f"compiling and playing {ticks} ticks, one a call")
            step = _played(work, self.machine, text, ticks, {**wanted, "fill": 0})
        except (SimulationFailed, OSError, ValueError) as error:
            return Outcome([Check("program", player, f"{ticks} ticks", failure=f"program: {error}")])
        capture = make_capture(stored, script, _packed(step.capture, stored))
        sent = {"x": step.capture[::2] & np.uint64(0xFFFFFFFF), "y": step.capture[::2] >> np.uint64(32)}
        checks = [
            self._header(stored, step),
            *check_codes(capture, stored, {axis: part.astype(np.int64) for axis, part in sent.items()}),
            *check_waveform(capture, stored, job.limits),
            check_no_faults(capture),
            check_faults(capture, step.counts, script.all_counts),
            _states(script, step),
        ]
        try:
            progress(f"compiling and playing {ticks} ticks, many a call")
            fill = _played(work, self.machine, text, ticks, {**wanted, "fill": _MAX_FILL_TICKS})
            codes = _packed(fill.capture, stored)
            filled = recaptured(capture, codes) or make_capture(stored, script, codes)
            checks.append(check_filled(filled, _states(script, fill), fill.counts, script.all_counts))
        except (SimulationFailed, OSError, ValueError) as error:
            checks.append(Check("fill", "integer model", f"{ticks} ticks", failure=f"fill: {error}"))
        return Outcome(checks, session, first_difference(capture))

    @staticmethod
    def _header(stored: StoredBuild, step: CPlayed) -> Check:
        """The constants of the header as the compiler reads them."""
        content = stored_content(stored)
        wanted = header_constants(content)
        wrong = [
            f"{content.name}.h: {name} is {value} to the compiler, it is {right} in the manifest"
            for (name, right), value in zip(wanted.items(), step.constants, strict=True)
            if value != right
        ]
        return differing_check("c header", "manifest, by the compiler", f"{len(wanted)} constants", wrong)

    def _defines(self, stored: StoredBuild) -> dict[str, int]:
        """What a firmware for this build is compiled with, and what the bench is."""
        axes = [axis for _, axis in stored.axes]
        rendered = [len(axis.table.words) for axis in axes if self.fourier and axis.table.mode != "direct"]
        return {
            "DAC_TABLE_STORAGE_BITS": storage_bits(max(axis.table.bits for axis in axes)),
            "DAC_OUTPUT_STORAGE_BITS": storage_bits(max(axis.output.word_bits for axis in axes)),
            **({"DAC_SPLINE": 1} if any(axis.table.mode == "cubic" for axis in axes) else {}),
            **({"DAC_SHAPING": order} if (order := _highest_order(stored)) else {}),
            "BENCH_EMITTED": 1,
            "BENCH_TABLE_WORDS": max([*rendered, *map(_variation_words, (stored.program.x, stored.program.y))]),
            "BENCH_CONSTANTS": len(scan_constants(stored_content(stored))),
        }


def header_constants(content: Content) -> dict[str, int]:
    """What the emitted header defines, by whole names; of the hash each character is a number."""
    own = {f"{content.name.upper()}_{key}": value for key, value in scan_constants(content).items()}
    digits = {f"{content.name.upper()}_HASH[{at}]": ord(digit) for at, digit in enumerate(content.hash)}
    return own | digits


def _highest_order(stored: StoredBuild) -> int:
    """What the runtime of a build that shapes is compiled for."""
    return max(program.output.shaping.order for program in (stored.program.x, stored.program.y))


def _variation_words(own: Program) -> int:
    """Words that the table of a variation may have."""
    return len(own.words) if own.mode != "direct" else max(len(own.words), 8)


def _states(script: Script, played: CPlayed) -> Check:
    return check_states(script.states, read_states(played.states), (1 << 32) - 1, _UNTOLD)


def play_job(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Compile and play the script that stands in ``folder`` on a Cortex-M; in a process that can be ended."""
    from tablegen.verification.emulate import CortexMBench

    fill = job["fill"]
    sources = [Path(source) for source in job["sources"]]
    bench = CortexMBench(
        SequencerShape(**job["shape"]), folder / _place_of(fill), None, _options(), sources, fill, job["defines"]
    )
    played = bench.run((folder / SCRIPT).read_text("ascii"))
    (folder / _record_of(fill)).write_bytes(played.capture.tobytes())
    return {"counts": played.counts, "states": played.states, "constants": played.constants}


def _played(work: Path, machine: str, text: str, ticks: int, job: dict[str, Any]) -> CPlayed:
    """What the bench stored, two words a tick, counts of faults, states, and the constants of the header."""
    fill = job["fill"]
    job["defines"] = {**job["defines"], **({"BENCH_FILL": fill} if fill else {})}
    if machine == "cortex-m":
        status = worker.run(work, __name__, job)
        return CPlayed(_record(work, fill), **status)
    worker.run(work, c_play.__name__, _host_job(job, ticks))
    return CPlayed.of(_record(work, fill), text, constants_written(job["defines"]))


def _host_job(job: dict[str, Any], ticks: int) -> dict[str, Any]:
    """How this machine compiles and runs it. The first job compiles the sources, which do not ask for ``fill``."""
    fill, sources = job["fill"], [Path(source) for source in job["sources"]]
    line = compiler_line(_compiler(), _options(os.environ.get("CFLAGS", "")), sources, job["defines"])
    parts = [source for source in sources if source.suffix == ".c"]
    # The link is compiled and linked too, but nothing plays it: it does not have to be fast.
    links = [str(part) for part in parts if part.name.startswith(_LINK)]
    played = [str(part) for part in parts if not part.name.startswith(_LINK)]
    objects = [] if fill else [[*line, "-c", *played], *([[*line, "-O0", "-c", *links]] if links else [])]
    return {
        "objects": objects,
        "line": [*line, *(f"objects/{part.stem}.o" for part in parts), *map(str, OWN_SOURCES)],
        "program": f"{_place_of(fill)}/stream_bench",
        "script": SCRIPT,
        "record": _record_of(fill),
        "most_bytes": 1_000_000 + 32 * ticks,  # twice what is right, so that a few too many are told as such
        "timeout": 60.0 + ticks / _MIN_TICKS_PER_SECOND,
    }


def _record(work: Path, fill: int) -> Words:
    return np.frombuffer(read_bytes(work / _record_of(fill), BUILD_FILE), dtype="<u8")


def _place_of(fill: int) -> str:
    return "fill" if fill else "step"


def _sources(folder: Path, work: Path, stored: StoredBuild, fourier: bool) -> tuple[list[Path], list[str]]:
    """Copies of what a user of the build would compile, and the file that hands it to the bench; what is missing."""
    runtime = stored.runtime(".c", ".h")
    own = sorted({f"{stored.manifest.name}.h", arrays_file(stored_content(stored))})
    sources, absent = copies(folder, own + runtime, work / "c")
    if not runtime:
        absent.append("the build holds no dac_*.c")
    (work / "bench").mkdir(exist_ok=True)
    handed = work / "bench" / "bench_program.c"
    handed.write_text(_bench_program(stored, fourier), "ascii")
    return [*sources, handed], absent


def _compiler() -> str:
    return os.environ.get("CC") or "cc"


def _options(flags: str = "") -> list[str]:
    """Warnings are for whoever compiles the firmware: what counts here is what it does."""
    try:
        return ["-std=c99", "-O2", *shlex.split(flags), "-w"]
    except ValueError as error:
        raise SimulationFailed(f"CFLAGS cannot be read: {error}") from None


def _record_of(fill: int) -> str:
    return "fill_capture.bin" if fill else "step_capture.bin"


def _bench_program(stored: StoredBuild, fourier: bool) -> str:
    """The C file that hands what the build emitted to the bench, by the names that its header has."""
    name = stored.manifest.name
    capital = name.upper()
    lines = [
        "/* Hands what a build emitted to the bench of tablegen verify. */",
        f'#include "{name}.h"',
        '#include "stream_bench.h"',
        "",
        f"const dac_program bench_program = DAC_PROGRAM({capital}, {name});",
    ]
    rendered = []
    for axis, content in stored.axes:
        rendered.append(fourier and content.table.mode != "direct")
        of = f"{capital}_{axis.upper()}"
        words = f"{name}_{axis}_fourier, {of}_HARMONICS" if rendered[-1] else "NULL, 0"
        lines += [
            f"const dac_converter bench_{axis}_converter = DAC_CONVERTER({of}, 0);",
            f"const bench_axis bench_{axis} = {{{words}}};",
        ]
    lines += [
        f"const int32_t *const bench_sine = {f'{name}_sine' if any(rendered) else 'NULL'};",
        f"const unsigned bench_sine_index_bits = {f'{capital}_SINE_INDEX_BITS' if any(rendered) else '0'};",
        "",
        "const int64_t bench_constants[BENCH_CONSTANTS] = {",
        *(f"    {capital}_{constant}," for constant in scan_constants(stored_content(stored))),
        "};",
        f"const char bench_hash[BENCH_HASH_DIGITS + 1] = {capital}_HASH;",
    ]
    return "\n".join(lines) + "\n"


def _packed(words: Words, stored: StoredBuild) -> Words:
    """Pairs of captures as one word a tick, as models are stored: converter words turned back into codes."""
    packed = np.empty(len(words) // 2, dtype=np.uint64)
    for first in range(0, len(packed), _CHUNK_TICKS):
        chunk = slice(2 * first, 2 * (first + _CHUNK_TICKS))
        sent, told = words[: 2 * len(packed)][chunk].reshape(-1, 2).T
        x = _codes(sent & np.uint64(0xFFFFFFFF), stored.program.x.output)
        y = _codes(sent >> np.uint64(32), stored.program.y.output)
        told = (told & np.uint64(0xFFFF)) << np.uint64(48)  # faults above markers
        packed[first : first + _CHUNK_TICKS] = told | y << np.uint64(24) | x
    return packed


def _codes(words: Words, output: Output) -> Words:
    """The codes in converter words, by the coding that the manifest has."""
    shift = output.word_bits - output.dac_bits if output.align == "left" else 0
    flip = 1 << (output.dac_bits - 1) if output.coding == "twos-complement" else 0
    codes: Words = (words >> np.uint64(shift) ^ np.uint64(flip)) & np.uint64(0xFFFFFF)
    return codes
