"""Tests of the tests of the C link: every mutant is found, the link as it is passes."""

import pytest
from link_mutants import MUTANTS, Mutant, Workshop
from sets import one_of

# By name in the requirements: they have to be among the mutants.
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
    "challenges have no identity",
    "challenges last for ever",
    "a key without random numbers",
    "half a tag is enough",
    "the interlock is ignored",
    "an answer is written over",
    "every upload goes into the same tables",
    "a COMMIT is answered before it is in force",
    "a swap in mid-line",
)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("mutants"))


@pytest.mark.rest
def test_the_link_as_it_is_passes(workshop: Workshop) -> None:
    assert workshop.judge(None) == ""


def test_every_mutant_is_of_the_link_as_it_is() -> None:
    assert set(CONTROLS) <= {each.breaks for each in MUTANTS}
    assert len({(each.file, each.old, each.new) for each in MUTANTS}) == len(MUTANTS) > 100
    assert all(each.source for each in MUTANTS)


@pytest.mark.rest
@pytest.mark.parametrize("mutant", one_of(3, MUTANTS), ids=lambda mutant: mutant.breaks)
def test_every_mutant_is_found(mutant: Mutant, workshop: Workshop) -> None:
    assert workshop.judge(mutant)
