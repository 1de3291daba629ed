"""Tests of the tests: every mutant of the Verilog is found by the bench that plays it; the Verilog itself is not."""

from pathlib import Path

import pytest
from building import REPOSITORY
from mutants import Verdict, judge_all
from stream_mutants import BENCHES, MUTANTS, Mutant, bench_of, judge, script_of


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory: pytest.TempPathFactory) -> dict[Mutant, Verdict]:
    return dict(judge_all(judge, MUTANTS, tmp_path_factory.mktemp("mutants")))


@pytest.mark.parametrize("name", BENCHES)
def test_the_verilog_as_it_is_passes(name: str, tmp_path: Path) -> None:
    played = bench_of(name, tmp_path).play(script_of(name))
    assert played.equal, played


def test_the_documentation_counts_them() -> None:
    page = REPOSITORY / "docs" / "verilog.md"
    assert f"{len(MUTANTS)} faults put into the Verilog" in page.read_text("utf-8")


def test_no_mutant_is_listed_twice() -> None:
    assert len({(mutant.file, mutant.old, mutant.new, mutant.where) for mutant in MUTANTS}) == len(MUTANTS) > 100


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: f"{mutant.file}: {mutant.breaks}")
def test_every_mutant_is_found(mutant: Mutant, verdicts: dict[Mutant, Verdict]) -> None:
    assert mutant.source != ""
    assert verdicts[mutant].killed
