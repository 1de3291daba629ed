"""Play frames of a sequencer with a slow part in C, a tick a call and many ticks a call, against the model."""

from pathlib import Path

import numpy as np

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.device.dual_program import ScanProgram
from tablegen.device.sequencer import Sequencer, Tick
from tablegen.numerics.arrays import Ints
from tablegen.verification.c.bench import require_compiler
from tablegen.verification.c.host import host_compiler
from tablegen.verification.c.play import compile_line, record, require_headers
from tablegen.verification.c.program import OPTIONS
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.stream import FLAGS

_BENCH = Path(__file__).parent / "frame_bench.c"
_REST = 5  # ticks before the scan
_TICK = np.dtype([("x", "<u4"), ("y", "<u4"), ("markers", "u1"), ("faults", "u1")])
_LEAST_TICKS_A_SECOND = 5000  # a slower program counts as hanging


def frame_checks(
    label: str, name: str, program: ScanProgram, files: list[Path], options: dict[str, int], work: Path, ticks: int
) -> tuple[list[Check], str | None]:
    """Compile the runtime with the program of one sequencer, and compare what it plays with the model.

    Parameters
    ----------
    label
        What checks begin with.
    name
        Prefix of its files and objects.
    program
        What it should play.
    files
        C files and headers, all in one folder or in several.
    options
        Macros of the runtime.
    work
        Directory of the compiled program and its record.
    ticks
        Ticks to play before the park.

    Returns
    -------
    list of Check, str or None
        A check of each way of playing, and the first difference.
    """
    outputs = program.x.output, program.y.output
    parked = 2 * (1 << max(each.dac_bits for each in outputs)) // min(each.max_step for each in outputs)
    parked = min(parked + 10, ticks)
    expected = _model(program, ticks, parked)
    checks, difference = [], None
    try:
        bench = _compiled(name, files, options, work)
        for way in ("steps", "fills"):
            capture = work / f"{way}.bin"
            timeout = 60.0 + (ticks + parked) / _LEAST_TICKS_A_SECOND
            most = 2 * _TICK.itemsize * len(expected) + 1000
            record([str(bench), way, str(ticks), str(parked)], b"", capture, most, timeout)
            played = np.frombuffer(read_bytes(capture, BUILD_FILE), dtype=_TICK)
            differs, what = _first_difference(played, expected, way), f"{label}, {way}"
            difference = difference or differs
            failure = differs and f"{what}: {differs}"
            checks.append(Check(what, "the model", f"{len(expected)} ticks", failure=failure))
    except SimulationFailed as error:
        checks.append(Check(label, "the model", f"{len(expected)} ticks", failure=f"{label}: {error}"))
    return checks, difference


def _compiled(name: str, files: list[Path], options: dict[str, int], work: Path) -> Path:
    compiler = require_compiler(host_compiler())
    macros = {
        **options,
        "BENCH_PROGRAM_HEADER": f'"{name}_program.h"',
        "BENCH_PROGRAM": f"{name}_program",
        "BENCH_X_CONVERTER": f"{name}_x_converter",
        "BENCH_Y_CONVERTER": f"{name}_y_converter",
    }
    program = work / "frame_bench"
    sources = [str(path) for path in files if path.suffix == ".c"]
    line = [*compiler, *OPTIONS, "-w", *(f"-D{key}={value}" for key, value in macros.items())]
    line += [f"-I{folder}" for folder in dict.fromkeys(path.parent for path in files)]
    try:
        compile_line([*line, *sources, str(_BENCH), "-o", str(program)])
    except SimulationFailed:
        require_headers(compiler)
        raise
    return program


def _model(program: ScanProgram, ticks: int, parked: int) -> Ints:
    """Return what the integer model plays: rows of converter words of x and y, markers, and faults."""
    model = Sequencer(None)
    outputs = program.x.output, program.y.output
    parts: list[Ints] = []

    def put(tick: Tick) -> None:
        markers = sum(1 << bit for bit, flag in enumerate(FLAGS) if getattr(tick, flag))
        words = outputs[0].word(tick.x), outputs[1].word(tick.y)
        parts.append(np.array([[*words, markers, tick.faults.value]], dtype=np.int64))

    for _ in range(_REST):
        put(model.step())
    model.commit(program)
    model.arm()
    model.trigger()
    left = ticks
    while left:
        ahead = model.ahead(left)
        if ahead is None:
            put(model.step())
            left -= 1
            continue
        line, faults = ahead
        markers = np.full(len(faults), 1 << FLAGS.index("playing"), dtype=np.int64)
        for flag in ("line", "frame", "pixel", "backward", "valid"):
            markers += getattr(line, flag) * (1 << FLAGS.index(flag))
        parts.append(np.stack([outputs[0].word(line.x), outputs[1].word(line.y), markers, faults], axis=1))
        left -= len(faults)
    model.park()
    for _ in range(parked):
        put(model.step())
    return np.concatenate(parts)


def _first_difference(played: np.ndarray, expected: Ints, way: str) -> str | None:
    if len(played) != len(expected):
        return f"{len(played)} ticks were played, not {len(expected)}"
    for at, key in enumerate(("x", "y", "markers", "faults")):
        if key == "faults" and way == "fills":  # those of the status, after as many ticks as a fill has
            continue
        different = np.flatnonzero(played[key].astype(np.int64) != expected[:, at])
        if len(different):
            tick = int(different[0])
            return f"{key} of tick {tick} is {played[key][tick]}, {expected[tick, at]} by the model"
    return None
