"""Tests of the tests: every mutant of the Verilog is found by the bench that plays it; the Verilog itself is not."""

from pathlib import Path

import pytest
from building import REPOSITORY
from stream_mutants import BENCHES, MUTANTS, Mutant, bench_of, judge, script_of


@pytest.mark.rest
@pytest.mark.parametrize("name", BENCHES)
def test_the_verilog_as_it_is_passes(name: str, tmp_path: Path) -> None:
    played = bench_of(name, tmp_path).play(script_of(name))
    assert played.equal, played


def test_the_documentation_counts_them() -> None:
    page = REPOSITORY / "docs" / "verilog.md"
    assert f"{len(MUTANTS)} faults put into the Verilog" in page.read_text("utf-8")


def test_no_mutant_is_listed_twice() -> None:
    assert len({(mutant.file, mutant.old, mutant.new, mutant.where) for mutant in MUTANTS}) == len(MUTANTS) > 100
    assert all(mutant.source for mutant in MUTANTS)


@pytest.mark.rest
@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: f"{mutant.file}: {mutant.breaks}")
def test_every_mutant_is_found(mutant: Mutant, tmp_path: Path) -> None:
    assert judge(mutant, tmp_path).killed
