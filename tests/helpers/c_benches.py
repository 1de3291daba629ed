"""Benches of the C sequencer, compiled once for all shapes of the same storage; scripts are held against the model."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from building import run_clean
from c_library import storage
from kept_objects import objects
from limits import PATIENCE_S
from stream_laws import steps_are_limited

from tablegen.base.resources import c_runtime
from tablegen.verification.c.bench import CUBIC, OWN_SOURCES, CBench, CRecord, defines, macros, script_words, sine_of
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script, compare

SANITIZED = ("-std=c99", "-O1", "-g", "-fsanitize=undefined,address", "-fno-sanitize-recover=all")
COMPILERS = ("gcc", "clang")
FILL = 200  # ticks in one call, at most
_WITHOUT_FAULTS = np.uint64((1 << 56) - 1)


class KeptBench(CBench):
    """The same bench of objects that are kept: ways of playing and files of tests share those of the runtime."""

    def __init__(
        self,
        shape: SequencerShape,
        folder: Path,
        compiler: str,
        options: Sequence[str],
        sources: Sequence[Path] | None = None,
        fill: int = 0,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.shape, self.program = shape, folder / "stream_bench"
        self._constants = 0
        command = [compiler, *options]
        parts = list(c_runtime() if sources is None else sources)
        headers = [path for path in parts if path.suffix == ".h"]
        runtime = objects([*command, *macros(defines(shape))], parts)
        bench = objects([*command, *macros(defines(shape, fill))], [*OWN_SOURCES, *headers])
        run_clean([*command, *runtime, *bench, "-o", self.program])


@dataclass(frozen=True)
class Benches:
    """By compiler, storage and way of playing; ``sources`` as those of ``CBench``.

    What counts lines has objects of its own, not those that are ``kept``.
    """

    folder: Path
    options: tuple[str, ...] = SANITIZED
    sources: tuple[Path, ...] | None = None
    kept: bool = True
    _compiled: dict[tuple[str, int, int, int, bool], CBench] = field(default_factory=dict)

    def compiled(self, shape: SequencerShape, compiler: str = "gcc", fill: int = 0) -> CBench:
        """The bench for a shape, whatever shape it was compiled for."""
        table, output = storage(max(shape.x_word_bits, shape.y_word_bits)), storage(shape.dac_bits)
        spline = CUBIC in (shape.x_interpolated, shape.y_interpolated)
        key = compiler, table, output, fill, spline
        if key not in self._compiled:
            folder = self.folder / f"{compiler}_{table}_{output}_{fill}_{spline}"
            # Each of the two ways of running with another compiler; the processors of the rest have both.
            options = (*self.options, "-DDAC_LONG_MULTIPLY=0") if compiler == "clang" else self.options
            bench = KeptBench if self.kept else CBench
            self._compiled[key] = bench(shape, folder, compiler, options, self.sources, fill)
        return self._compiled[key]

    def play(
        self, script: Script, shape: SequencerShape, compiler: str = "gcc", fill: int = 0, fourier: bool = False
    ) -> CRecord:
        """Play a script and hold it against the model: every tick, and the counts of faults."""
        played = self.compiled(shape, compiler, fill).run(words_of(script, shape, fourier), timeout=PATIENCE_S)
        expected = np.array(script.expected, dtype=np.uint64)
        if fill:
            expected &= _WITHOUT_FAULTS  # a fill tells them at its end
        mismatch = compare(expected.tolist(), played.capture)
        assert mismatch is None, mismatch
        assert played.counts == [*script.counts, 0, 0], (played.counts, script.counts)
        steps_are_limited(played.capture, script.swapped_programs)
        return played


_texts: dict[int, tuple[Script, str]] = {}


def words_of(script: Script, shape: SequencerShape, fourier: bool = False) -> str:
    """The script as the bench reads it. It is written once: writing it lets its last ticks come."""
    if id(script) not in _texts:
        sine = sine_of(shape) if fourier else None
        _texts[id(script)] = script, script_words(script, shape, sine)
    return _texts[id(script)][1]
