"""``build_many``: many setups to builds, in processes of their own, as they complete, with errors as values."""

import gc
import os
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest
from editing import edited, write_pair
from libraries import BASE, write_library

import tablegen
from tablegen.base.workers import SHARE, WorkerDied, default_jobs, results

SIZES = (150.0, 5000.0, 200.0, 250.0)


def test_outcomes_are_builds_or_errors(tmp_path: Path) -> None:
    scans = tablegen.variants(write_pair(tmp_path, BASE), {"x.size_nm": SIZES})
    sources = [*scans, tablegen.load(tmp_path / "scan.toml"), tmp_path / "none.toml"]
    outcomes = list(tablegen.build_many(sources, jobs=1))
    assert [one.number for one in outcomes] == list(range(6))
    assert [one.build is not None for one in outcomes] == [True, False, True, True, True, False]
    assert [one.error is None for one in outcomes] == [one.build is not None for one in outcomes]
    assert isinstance(outcomes[1].error, tablegen.Rejected)
    assert outcomes[1].error.problems[0].key == "x.size_nm"
    assert isinstance(outcomes[5].error, tablegen.Rejected)
    assert [one.name for one in outcomes[:2]] == ["lines_size_nm_150", "lines_size_nm_5000"]
    assert outcomes[0].source is scans[0]
    assert "lines_size_nm_150" in repr(outcomes[0])
    assert "5000 nm" in repr(outcomes[1])


def test_a_limit_that_is_broken_is_an_error_too(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(BASE, "+ [limits]\nmax_error_lsb = 1e-3"))
    (outcome,) = tablegen.build_many([path], jobs=1)
    assert isinstance(outcome.error, tablegen.BrokenLimit)


@pytest.mark.common
def test_processes_give_the_builds_of_this_one(tmp_path: Path) -> None:
    """Whole: plans, arrays and files; errors too, with their problems."""
    scans = tablegen.variants(write_pair(tmp_path, BASE), {"x.size_nm": SIZES})
    here = {one.number: one for one in tablegen.build_many(scans, jobs=1)}
    there = {one.number: one for one in tablegen.build_many(scans, tmp_path / "out", jobs=2)}
    assert here.keys() == there.keys()
    for number, one in here.items():
        other = there[number]
        assert str(one.error) == str(other.error)
        assert type(one.error) is type(other.error)
        if one.build is not None:
            assert other.build is not None
            assert one.build.files == other.build.files
            assert (one.build.x.codes == other.build.x.codes).all()
            assert one.build.warnings == other.build.warnings
            written = {path.name: path.read_bytes() for path in (tmp_path / "out" / one.name).iterdir()}
            assert written == one.build.files
    assert isinstance(there[1].error, tablegen.Rejected)
    assert there[1].error.problems == here[1].error.problems  # type: ignore[union-attr]
    assert len(list((tmp_path / "out").iterdir())) == 3


@pytest.mark.common
@pytest.mark.parametrize("jobs", [1, 2])
def test_sources_are_taken_as_they_are_needed(tmp_path: Path, jobs: int) -> None:
    setup = tablegen.load(write_pair(tmp_path, BASE))
    taken = 0

    def endless() -> Iterator[tablegen.Setup]:
        nonlocal taken
        while True:
            taken += 1
            yield setup

    outcomes = tablegen.build_many(endless(), jobs=jobs)
    for _ in range(3):
        assert next(outcomes).build is not None
    outcomes.close()  # type: ignore[attr-defined]
    assert taken <= 3 + 2 * jobs


@pytest.mark.rest
def test_memory_does_not_grow_with_their_number(tmp_path: Path) -> None:
    setup = tablegen.load(write_pair(tmp_path, BASE))
    sizes = []
    tracemalloc.start()
    try:
        for outcome in tablegen.build_many([setup] * 8, jobs=1):
            assert outcome.build is not None
            assert outcome.build.files
            del outcome
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert sizes[-1] - sizes[3] < 20_000, sizes


def _doubled(number: int) -> int:
    if number == 3:
        raise ValueError("three")
    if number == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 6:
        print("a format of somebody else that prints")
    return 2 * number


@pytest.mark.common
def test_a_worker_that_dies_is_an_error_of_its_task_alone() -> None:
    found = dict(results(_doubled, ((number,) for number in range(9)), 2))
    assert {number: value for number, value in found.items() if number not in (3, 4)} == {
        number: 2 * number for number in (0, 1, 2, 5, 6, 7, 8)
    }
    assert repr(found[3]) == "ValueError('three')"
    assert isinstance(found[4], WorkerDied)
    assert "-9" in str(found[4])


@pytest.mark.common
def test_what_cannot_travel_is_an_error_and_not_a_wait() -> None:
    def local(number: int) -> int:
        return number

    found = dict(results(local, [(1,), (2,)], 2))
    assert all(isinstance(one, Exception) for one in found.values())
    unsent = dict(results(_doubled, [((n for n in ()),), (1,)], 2))
    assert isinstance(unsent[0], Exception)
    assert unsent[1] == 2


@pytest.mark.common
def test_a_script_needs_no_guard(tmp_path: Path) -> None:
    """A worker imports the package, not the program that asked for it."""
    scan = write_library(tmp_path)
    script = tmp_path / "script.py"
    script.write_text(
        "import tablegen\n"
        f"print(*sorted(one.name for one in tablegen.build_many(tablegen.variants({str(scan)!r}), jobs=2)))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("broad even narrow\n", "")


def test_nine_tenths_of_the_cores_and_at_least_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert SHARE == 0.9
    for cores, jobs in ((1, 1), (2, 1), (3, 2), (10, 9), (64, 57)):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _pid, cores=cores: set(range(cores)))
        assert default_jobs() == jobs
