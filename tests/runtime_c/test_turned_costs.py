"""``[cost]`` against the C that is emitted: whole builds at an angle and at 0 degrees, counted in emulation."""

import importlib
import sys
from collections.abc import Iterator
from types import ModuleType

import pytest
from building import REPOSITORY
from sets import LONG_TEST

from tablegen.planning.frame_costs import slow_counts
from tablegen.planning.played_table import MeasuredRun
from tablegen.planning.table_costs import counts, sample_costs
from tablegen.planning.turned_plan import played_frame

pytestmark = pytest.mark.rest

# Scans of the benchmark by name; percent by which what is told may differ; whether runs are played.
BUILDS = [
    ("cortex-m4", "words of 11 bits", 1.0, False),
    pytest.param(*("cortex-m0plus", "lines of 313 ticks, of 60 nm", 1.0, True), marks=LONG_TEST),
    ("riscv32", "a converter in two's complement", 1.0, True),
    pytest.param(*("cortex-m4", "no `max_slew_v_per_s`", 1.0, True), marks=LONG_TEST),
]


@pytest.fixture(scope="module")
def benchmark() -> Iterator[ModuleType]:
    """The benchmark, which is no package."""
    sys.path.insert(0, str(REPOSITORY / "benchmarks"))
    try:
        yield importlib.import_module("turned_costs")
    finally:
        sys.path.remove(str(REPOSITORY / "benchmarks"))


@pytest.mark.parametrize(("core", "name", "percent", "runs"), BUILDS)
def test_a_build_takes_what_it_is_told(benchmark: ModuleType, core: str, name: str, percent: float, runs: bool) -> None:
    """The cells of another coding, of runs in place of ticks, or of the fast table alone would be told apart."""
    build = benchmark.built(benchmark.SCANS[name])
    counted = benchmark.counted(build, core)

    def agrees(told: float) -> bool:
        return abs(told - counted) <= 0.01 * percent * counted

    assert agrees(benchmark.told(build, core))
    run = MeasuredRun(16, 16, "complement" in name)
    other = slow_counts()[run._replace(coded=not run.coded)][core] if runs else slow_counts()[run][core]
    assert not agrees(other.in_runs)
    assert not agrees(sample_costs([played_frame(build.setup, build.plan.straight, build.plan.x)], core)[0])


@pytest.mark.parametrize(
    ("core", "name", "percent"),
    [
        ("cortex-m4", "the example", 1.0),
        ("cortex-m4", "no `max_slew_v_per_s`", 1.0),
        pytest.param("cortex-m4", "lines of 313 ticks", 3.0, marks=LONG_TEST),
        ("cortex-m0plus", "lines of 313 ticks", 4.0),
    ],
)
def test_a_straight_build_takes_what_it_is_told(benchmark: ModuleType, core: str, name: str, percent: float) -> None:
    """That runs are refused would be seen: it makes seven of one."""
    build = benchmark.straight(benchmark.STRAIGHT[name], core)
    counted, told = benchmark.counted(build, core), benchmark.told_straight(build)
    assert abs(told - counted) <= 0.01 * percent * counted
    in_runs = counts()[MeasuredRun(16, 16, False)]["interpolated"][core].in_runs
    assert counted < 1.1 * in_runs
