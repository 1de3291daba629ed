"""Tests of the tests of the C link: every mutant is found, the link as it is passes."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from link_mutants import MUTANTS, Mutant, Workshop, judge_all

# By name in the requirements; the others are slow.
CONTROLS = (
    "the CRC of a frame is not checked",
    "the CRC of the image is not checked",
    "the CRC is that of what came, not of memory",
    "schedules are not checked",
    "periods are not checked",
    "outputs are not checked",
    "code limits of the device are not checked",
    "the step is not checked",
    "sums of Fourier words are not checked",
    "the words of a table are not checked",
    "ranges are not checked",
    "slew of advances is not checked",
    "slew of segments is not checked",
    "jumps are not checked",
    "the sequence is ignored",
    "a repeated request acts again",
    "the offset of DATA is ignored",
    "a nonce is used again",
    "half a tag is enough",
    "the interlock is ignored",
    "an answer is written over",
    "every upload goes into the same tables",
    "a COMMIT is answered before it is in force",
    "a swap in mid-line",
)
QUICK = [each for each in MUTANTS if each.breaks in CONTROLS]
SLOW = [each for each in MUTANTS if each.breaks not in CONTROLS]


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory: pytest.TempPathFactory) -> Mapping[Mutant, str]:
    return dict(judge_all(tmp_path_factory.mktemp("mutants"), QUICK))


@pytest.fixture(scope="module")
def slow_verdicts(tmp_path_factory: pytest.TempPathFactory) -> Mapping[Mutant, str]:
    return dict(judge_all(tmp_path_factory.mktemp("mutants"), SLOW))


def test_the_link_as_it_is_passes(tmp_path: Path) -> None:
    assert Workshop(tmp_path).judge(None) == ""


def test_every_mutant_is_of_the_link_as_it_is() -> None:
    assert {each.breaks for each in QUICK} == set(CONTROLS)
    assert len({(each.file, each.old, each.new) for each in MUTANTS}) == len(MUTANTS) > 100
    assert all(each.source for each in MUTANTS)


@pytest.mark.parametrize("mutant", QUICK, ids=lambda mutant: mutant.breaks)
def test_a_control_is_found(mutant: Mutant, verdicts: Mapping[Mutant, str]) -> None:
    assert verdicts[mutant]


@pytest.mark.slow
@pytest.mark.parametrize("mutant", SLOW, ids=lambda mutant: mutant.breaks)
def test_every_mutant_is_found(mutant: Mutant, slow_verdicts: Mapping[Mutant, str]) -> None:
    assert slow_verdicts[mutant]
