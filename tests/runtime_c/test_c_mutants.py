"""Tests of the tests of the C sequencer: every mutant is found in its place; the runtime and its equals are not."""

from pathlib import Path

import pytest
from building import REPOSITORY
from c_faults import Mutant
from c_mutants import EQUIVALENT, MUTANTS, PLACES, judge
from mutants import Verdict
from sets import one_of

# By name in the requirements: they have to be among the mutants.
CONTROLS = (
    "a swap in mid-line",
    "a swap in mid-line by steps",
    "nothing is held at code_min",
    "nothing is held at code_max",
    "words are not saturated",
    "the code is rounded down",
    "ties of the code are rounded down",
    "the sample is rounded down",
)


@pytest.mark.rest
@pytest.mark.parametrize("where", one_of(5, PLACES))
def test_the_runtime_as_it_is_passes(where: str, tmp_path: Path) -> None:
    assert judge(None, tmp_path, where) == Verdict(False, "")


def test_the_documentation_counts_them() -> None:
    page = " ".join((REPOSITORY / "docs" / "c.md").read_text("utf-8").split())
    assert f"{len(MUTANTS)} faults put into the C" in page
    assert f"{len(EQUIVALENT)} more" in page


def test_no_mutant_is_listed_twice() -> None:
    assert len({(each.file, each.old, each.new, each.where) for each in MUTANTS}) == len(MUTANTS) > 200
    assert all(each.source for each in (*MUTANTS, *EQUIVALENT))
    assert {each.where for each in MUTANTS} == set(PLACES)
    assert set(CONTROLS) <= {each.breaks for each in MUTANTS}


@pytest.mark.rest
@pytest.mark.parametrize("mutant", one_of(8, MUTANTS), ids=lambda mutant: f"{mutant.file}: {mutant.breaks}")
def test_every_mutant_is_found(mutant: Mutant, tmp_path: Path) -> None:
    assert judge(mutant, tmp_path).killed


@pytest.mark.long
@pytest.mark.timeout(86_400)
@pytest.mark.parametrize("mutant", EQUIVALENT, ids=lambda mutant: f"{mutant.file}: {mutant.breaks}")
def test_what_is_named_equivalent_is_not_found(mutant: Mutant, tmp_path: Path) -> None:
    """Each has its reason beside it; a test that finds one has found a wrong reason, or more than what is promised."""
    assert EQUIVALENT[mutant] != ""
    assert not judge(mutant, tmp_path).killed
