"""Faults put into the C sequencer, each of which the tests have to find; run as a program it lists them.

A mutant is tried where it shows: by scripts that are played by fills or by steps, with words of 16 bits or of 32, by
the checks of the functions, or between two threads. As a program it needs ``PYTHONPATH=hdl_tests/helpers``.
"""

import faulthandler
from functools import cache
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

import c_checks
import c_mutants_axis
import c_mutants_fourier
import c_mutants_program
import c_mutants_sequencer
import c_mutants_shaping
import mutants
import numpy as np
from building import run_clean
from c_benches import FILL, words_of
from c_devices import Check, Libraries
from c_faults import Mutant
from c_library import PROBE, Library
from c_scripts import IN_C, LONG, everything, long_periods, long_play, refused_by_y, shaped_short_lines
from c_scripts import LONG_PERIODS as PERIODS
from c_shaped_waves import JUMPS, WAVES, shaped_jumps, shaped_waves
from c_threads import compile_threads
from c_threads import play as play_threads
from kept_objects import objects
from limits import ENDED, limit, program_within
from mutants import Verdict

from tablegen.base.resources import c_runtime
from tablegen.verification.c.bench import OWN_SOURCES, CRecord, defines, macros
from tablegen.verification.c.play import run
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script, compare

HERE = Path(__file__).parent
OPTIONS = ("-std=c99", "-O1", "-DDAC_WAIT=0")  # as many runs as can be
CHECKS = {"checks": (), "checks small": ("-DDAC_SMALL=1",), "checks short": ("-DDAC_LONG_MULTIPLY=0",)}
PLAY_S, CHECK_S = 20, 120  # of CPU time: what does not hang takes a second of it, and two
_FORK = get_context("fork")  # nothing is imported again
_PROGRAMS = 3000  # between two threads

PLACES = (
    "fill",
    "step",
    "wide",
    "wide short",
    "short",
    "cubic",
    "cubic short",
    "shaped",
    "shaped short",
    "shaped few",
    "shaped wide",
    "shaped wide short",
    "shaped wide few",
    *CHECKS,
    "threads",
)
_FILES = c_mutants_axis, c_mutants_program, c_mutants_sequencer, c_mutants_fourier, c_mutants_shaping
MUTANTS: tuple[Mutant, ...] = tuple(mutant for each in _FILES for mutant in each.MUTANTS)
EQUIVALENT = {**c_mutants_axis.EQUIVALENT, **c_mutants_program.EQUIVALENT, **c_mutants_sequencer.EQUIVALENT}


@cache
def scripts(where: str) -> tuple[tuple[Script, SequencerShape], ...]:
    """What the benches play; the same every time."""
    if where == "wide short":
        names = ("cubic_and_lines", "bits_24", "dac_24_words_8")
        return tuple((long_play(name, 20_000), LONG[name][0]) for name in names)
    if where == "wide":
        names = ("bits_20", "bits_24", "dac_24_words_8")
        long = [(long_play(name, 9000), LONG[name][0]) for name in names]
        return (*long, (IN_C["bits_24"].script("bits_24"), IN_C["bits_24"].shape))
    if where == "cubic":
        names = ("cubic", "cubic_with_few_ticks")
        wild = SequencerShape(16, 3, 4, 14, 3, 3, 16)
        long = [(long_play(name, 60_000), LONG[name][0]) for name in names]
        return (*long, (everything(wild, 1, 500), wild))
    if where == "shaped wide":
        return tuple((shaped_waves(WAVES[name]), WAVES[name]) for name in ("bits_18", "bits_20", "bits_24"))
    if where == "shaped":
        names = ("bits_16", "bits_8", "direct", "many_lines")
        return (
            *((long_play(name, 12_000, 0, 3), LONG[name][0]) for name in names),
            (long_play("bits_16", 20_000, 1, 3), LONG["bits_16"][0]),
            (long_play("bits_12", 60_000, 0, 3), LONG["bits_12"][0]),
            (shaped_waves(WAVES["bits_12"]), WAVES["bits_12"]),
            (shaped_jumps(JUMPS), JUMPS),
            (refused_by_y(20_000), LONG["many_lines"][0]),
            (shaped_short_lines(SequencerShape(16, 1, 4, 16, 1, 3, 16), 6000), SequencerShape(16, 1, 4, 16, 1, 3, 16)),
        )
    shape = SequencerShape(16, 1, 4, 16, 1, 3, 16)
    return (
        (everything(shape, 1, 500), shape),
        *((long_play(name, 12_000), LONG[name][0]) for name in ("bits_16", "bits_8", "direct", "many_lines")),
        (long_play("longest_table", 12_000), LONG["longest_table"][0]),
        (long_play("bits_16", 20_000, 1), LONG["bits_16"][0]),
        (long_periods(1 << 16, 3641, 12_000), PERIODS),
        (long_periods(1 << 16, 30_000, 3000), PERIODS),
        (long_periods(1 << 8, 300, 12_000), PERIODS),
    )


def runtime_with(mutant: Mutant | None, folder: Path) -> list[Path]:
    """A copy of the runtime, with a mutant in it or with none."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in c_runtime():
        text = mutant.source if mutant is not None and mutant.file == path.name else path.read_text("utf-8")
        (folder / path.name).write_text(text, "utf-8")
    return [folder / path.name for path in c_runtime()]


def judge(mutant: Mutant | None, folder: Path, where: str = "") -> Verdict:
    """Try a mutant in its place, or the runtime as it is in a place."""
    where = mutant.where if mutant is not None else where
    runtime = runtime_with(mutant, folder / "runtime")
    if where == "threads":
        for seed in range(1, 4):
            done = play_threads(compile_threads(folder, "gcc", True, runtime), _PROGRAMS, seed)
            if done.returncode:
                return Verdict(True, {66: "a race", ENDED: "hangs"}.get(done.returncode, done.stderr.strip()))
        return Verdict(False, "")
    if where in CHECKS:
        return _check(where, folder, runtime)
    return _play(where, folder, runtime)


def _check(where: str, folder: Path, runtime: list[Path]) -> Verdict:
    """Run the checks in a process that has all of this one, on libraries as ``compile_both`` makes them."""
    paths = []
    for bits, stride in ((16, 2), (32, 1)):
        storage = (f"-DDAC_{kind}_STORAGE_BITS={bits}" for kind in ("TABLE", "OUTPUT"))
        options = (*OPTIONS, *CHECKS[where], "-fPIC", *storage, f"-DDAC_STRIDE={stride}")
        paths.append(folder / f"library_{bits}.so")
        run_clean(["gcc", "-shared", *objects(["gcc", *options], [*runtime, PROBE]), "-o", paths[-1]])
    hear, tell = _FORK.Pipe(duplex=False)
    process = _FORK.Process(target=_run_checks, args=(paths, tell))
    process.start()
    tell.close()
    process.join()
    if process.exitcode == ENDED:
        return Verdict(True, "hangs")
    if process.exitcode:
        return Verdict(True, "crash")
    failure: str = hear.recv()
    return Verdict(failure != "", failure)


def _run_checks(paths: list[Path], tell: Connection) -> None:
    limit(CHECK_S)
    faulthandler.disable()  # some mutants crash, and that is all there is to know
    libraries = Libraries(*map(Library, paths))
    tell.send(next((check.__name__ for check in c_checks.CHECKS if not _holds(check, libraries)), ""))


def _holds(check: Check, libraries: Libraries) -> bool:
    try:
        check(libraries)
    except Exception:  # whatever a broken runtime leads to
        return False
    return True


def _play(where: str, folder: Path, runtime: list[Path]) -> Verdict:
    fill = 0 if where == "step" else FILL
    shaped = where.startswith("shaped")
    kinds = ("wide short", "wide", "cubic", "shaped wide", "shaped")
    playing = scripts(next((kind for kind in kinds if where.startswith(kind)), "fill"))
    chosen = defines(playing[0][1], fill) | ({"DAC_LONG_MULTIPLY": 0} if where.endswith(("short", "few")) else {})
    chosen |= {"DAC_FEW_REGISTERS": 1} if where.endswith("few") else {}
    chosen |= {"DAC_SHAPING": 3} if shaped else {}
    program = folder / "stream_bench"
    run_clean(["gcc", *objects(["gcc", *OPTIONS, *macros(chosen)], [*runtime, *OWN_SOURCES]), "-o", program])
    limited = program_within(PLAY_S, program)
    for script, shape in playing:
        words = words_of(script, shape)
        try:
            played = CRecord.of(np.frombuffer(run(limited, words.encode("ascii")), dtype="<u8"), words)
        except SimulationFailed as error:
            return Verdict(True, str(error))
        expected = script.expected if not fill else [word & (1 << 56) - 1 for word in script.expected]
        mismatch = compare(expected, played.capture)
        if mismatch is not None:
            return Verdict(True, f"tick {mismatch.tick}")
        if played.counts[:2] != script.counts:
            return Verdict(True, "fault counts")
    return Verdict(False, "")


if __name__ == "__main__":
    mutants.print_list(judge, MUTANTS, "file", "where")
