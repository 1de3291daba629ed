"""The scripts and checks go through every line of the C runtime, and through the fast path in every way."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from building import HELPERS
from c_benches import FILL, Benches
from c_coverage import COVERAGE, Coverage, coverage
from c_library import compile_both
from c_mutants import scripts
from c_scripts import IN_C, LONG, LONG_PERIODS, everything, long_periods, long_play, renderings
from c_shaped_waves import WAVES, shaped_waves
from sets import one_of

from tablegen.base.resources import c_runtime
from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.rest

AXIS = next(path for path in c_runtime() if path.name == "dac_axis.c")
SHAPING = next(path for path in c_runtime() if path.name == "dac_shaping.c")
SEQUENCER = next(path for path in c_runtime() if path.name == "dac_sequencer.c")
RUN = 16  # ticks with one check
SHAPED_WAYS = ((), ("-DDAC_LONG_MULTIPLY=0",), ("-DDAC_LONG_MULTIPLY=0", "-DDAC_FEW_REGISTERS=1"))


@dataclass(frozen=True)
class Measured:
    """Of all runs, and how many ticks the long lines had that were played by fills."""

    coverage: Coverage
    ticks: int


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Measured:
    folder = tmp_path_factory.mktemp("coverage")
    benches = Benches(folder / "benches", COVERAGE, kept=False)
    long = [(long_play(name, 30_000), LONG[name][0]) for name in LONG]
    long += [(long_periods(1 << 16, 3641, 3000), LONG_PERIODS)]
    for script, shape in long:
        benches.play(script, shape, fill=FILL)
    ticks = sum(len(script.expected) for script, _ in long)
    shape = SequencerShape(16, 1, 4, 16, 1, 3, 16)
    benches.play(everything(shape, 1), shape)
    shape = SequencerShape(16, 1, 4, 16, 1, 3, 14)
    benches.play(renderings(shape, 8, 6), shape, fourier=True)
    for name in ("bits_24", "dac_8_words_24_plain"):
        benches.play(IN_C[name].script(name), IN_C[name].shape, fill=FILL)
    paths = compile_both(folder / "libraries", options=COVERAGE)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    for command in ([sys.executable, str(HELPERS / "c_checks.py"), *map(str, paths)],):
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return Measured(coverage([folder], [path.name for path in c_runtime()]), ticks)


def test_every_line_was_run(measured: Measured) -> None:
    assert measured.coverage.lines
    assert measured.coverage.missed() == []


def test_most_branches_were_taken(measured: Measured) -> None:
    """Both ways. What is left over is a table of no length to render, and what two threads meet that one does not."""
    assert measured.coverage.share_of_branches > 0.95, measured.coverage.missed_branches()


def test_the_fast_path_plays_most_of_long_lines(measured: Measured) -> None:
    """Two axes; some programs have no runs, some clamp all along, some are parked."""
    runs = measured.coverage.of(AXIS, "axis->code = code;")
    assert runs * RUN > measured.ticks // 2


def test_every_line_of_shaping_was_run(tmp_path: Path) -> None:
    """With products of 64 bits and without; ``dac_shaping.c`` is empty in a runtime that does not shape."""
    for more in ((), ("-DDAC_LONG_MULTIPLY=0",)):
        benches = Benches(tmp_path / "".join(more), (*COVERAGE, "-DDAC_SHAPING=3", *more), kept=False)
        for script, shape in (*scripts("shaped"), (long_play("bits_24", 12_000, 0, 3), LONG["bits_24"][0])):
            benches.play(script, shape, fill=FILL)
    found = coverage([tmp_path], ["dac_shaping.c"])
    assert found.lines
    assert found.missed() == []


@pytest.mark.parametrize("more", SHAPED_WAYS, ids=" ".join)
@pytest.mark.parametrize("name", one_of(3, WAVES))
def test_the_fast_path_plays_the_second_and_the_third_order(name: str, more: tuple[str, ...], tmp_path: Path) -> None:
    """On converters of other than 16 bits too: ticks that are played one by one are few."""
    script = shaped_waves(WAVES[name])
    Benches(tmp_path, (*COVERAGE, "-DDAC_SHAPING=3", *more), kept=False).play(script, WAVES[name], fill=FILL)
    one_by_one = coverage([tmp_path], ["dac_shaping.c"]).of(SHAPING, "return (int32_t)fed >> bits;")
    assert one_by_one < 2 * len(script.expected) // 100
