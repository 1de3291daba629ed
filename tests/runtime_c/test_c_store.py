"""Kept programs: the C equals the model on every operation of the flash, and no cut of the power makes a mixture."""

from ctypes import CDLL
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest
from c_store import CStore, compile_store
from cut_flash import CutFlash
from hypothesis import given, settings
from hypothesis import strategies as st
from sets import LONG_TEST
from store_cuts import LAYOUT, SCRIPT, SIZE, Step, faults, image_of, kept, take, take_by_model

from tablegen.link.store import NONE, Layout, Store

SLOT = st.integers(0, LAYOUT.slots)  # one more than there are
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("save"), SLOT, st.integers(1, 8)),
        st.tuples(st.sampled_from(["select", "try", "delete"]), SLOT),
        st.tuples(st.sampled_from(["confirm", "start", "reset", "broken"])),
    ),
    min_size=5,
    max_size=14,
)
# What a fault replaces in dac_store.c; each has to be found.
MUTANTS = {
    "the CRC of a record is not checked": (" || dac_link_get(line + 28) != crc_of(line, 28)", ""),
    "the counter is not raised": ("state->counter = s->state.counter + 1;", "state->counter = s->state.counter;"),
    "the least counter counts": ("state.counter > s->state.counter)", "state.counter < s->state.counter)"),
    "the record goes over itself": (
        "(s->sector + 1u) % DAC_STORE_RECORDS", "(s->sector % DAC_STORE_RECORDS)"),
    "the copy goes over the record": ("write_record(s, oldest(s), &copy)",
                                      "write_record(s, (s->sector + 3u * oldest(s)) % DAC_STORE_RECORDS, &copy)"),
    "the copy goes over the record before": ("if (counter < least) {",
                                             "if (counter >= least || least == UINT32_MAX) {"),
    "what was read counts as certain": ("    s->certain = false;\n    s->state.counter = 0;",
                                        "    s->certain = true;\n    s->state.counter = 0;"),
    "the place of the slot itself is written": (
        "const unsigned place = free_place(s);",
        "const unsigned place = s->state.place[slot] < DAC_STORE_NONE ? s->state.place[slot] : free_place(s);"),
    "the first place counts as free": ("    return place;\n}\n\nstatic bool write_image",
                                       "    return 0 * place;\n}\n\nstatic bool write_image"),
    "the record comes before the image": (
        "    dac_link_put(header, PLACE_MAGIC);",
        "    dac_store_state early = s->state;\n    early.place[slot] = (uint8_t)place;\n    (void)change(s, &early);\n"
        "    dac_link_put(header, PLACE_MAGIC);"),
    "a trial is not reverted": ("if (!first)\n            state.trial = DAC_STORE_NONE;", ""),
    "a trial is played before it is marked": ("if (make_certain(s) && change(s, &state) == DAC_STORE_DONE && first)",
                                              "if (first)"),
    "a deleted slot stays selected": ("if (state.selected == slot)", "if (state.selected == 254)"),
}  # fmt: skip
BY_TWO_CUTS = (  # one cut does not show these
    "the copy goes over the record before",
    "what was read counts as certain",
)
# These show where a bit of the flash turns over.
BY_DAMAGE = {
    "the CRC of an image is not checked": ("return ~crc == dac_link_get(header + 8 + IMAGE_CRC);", "return crc != 1;"),
    "the CRC of a header is not checked": (" || dac_link_get(header + 60) != crc_of(header, 60)", ""),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> CDLL:
    return compile_store(tmp_path_factory.mktemp("store"))


@settings(max_examples=15)
@given(steps=STEPS)
def test_the_c_is_the_model_on_every_operation_of_the_flash(library: CDLL, steps: list[Step]) -> None:
    ours, theirs = CutFlash(SIZE, LAYOUT.sector_bytes), CutFlash(SIZE, LAYOUT.sector_bytes)
    model, c = Store(ours, LAYOUT), CStore(library, theirs, LAYOUT)
    for step in steps:
        if step[0] in ("start", "reset"):
            for flash in (ours, theirs):
                flash.power_up()
            model, c = Store(ours, LAYOUT), CStore(library, theirs, LAYOUT)
            if step[0] == "start":
                assert model.start() == c.start()
        elif step[0] == "broken":  # a word fails, without a cut of the supply
            for flash in (ours, theirs):
                flash.cut(3, "mixed")
            assert take_by_model(model, ("save", 0, 3)) == (take(c, ("save", 0, 3)) == 0)
            for flash in (ours, theirs):
                flash.on = True
        else:
            assert take_by_model(model, step) == (take(c, step) == 0), step
        assert ours.trace == theirs.trace
        assert bytes(c.state.place) == model.state.places
        state = model.state
        assert (c.state.selected, c.state.trial, c.state.started) == (state.selected, state.trial, state.started)
        assert [model.info(slot) for slot in range(LAYOUT.slots)] == [
            each and each[:48] for each in (c.image(slot) for slot in range(LAYOUT.slots))
        ]
        ours.trace.clear()
        theirs.trace.clear()  # the images were read by the test


def test_an_empty_flash_plays_the_program_of_the_firmware_and_is_not_written(library: CDLL) -> None:
    flash = CutFlash(SIZE, LAYOUT.sector_bytes)
    assert CStore(library, flash, LAYOUT).start() == NONE
    assert {name for name, *_ in flash.trace} == {"read"}


@pytest.mark.parametrize(
    "layout",
    [
        Layout(0, 64, 2, 0), Layout(0, 64, 2, 16), Layout(0, 64, 0, 3), Layout(0, 32, 2, 3), Layout(0, 80, 2, 3),
        Layout(0, 1 << 20, 1 << 10, 3),
    ],
)  # fmt: skip
def test_sizes_out_of_range_are_refused(library: CDLL, layout: Layout) -> None:
    bad_flash = 1
    assert CStore(library, CutFlash(SIZE, 64), layout).opened == bad_flash


def test_refusals_leave_the_flash_as_it_is(library: CDLL) -> None:
    flash = CutFlash(SIZE, LAYOUT.sector_bytes)
    store = CStore(library, flash, LAYOUT)
    long = image_of(1)
    long = replace(long, info=replace(long.info, image_bytes=LAYOUT.room + 1))
    no_slot, too_long, no_trial = 2, 3, 5
    assert [store.save(3, image_of(1)), store.save(0, long)] == [no_slot, too_long]
    assert [store.select(0), store.select(NONE, True), store.delete(1), store.confirm()] == [no_slot] * 3 + [no_trial]
    assert bytes(flash.cells) == b"\xff" * SIZE


def test_an_image_of_another_crc_is_not_kept(library: CDLL) -> None:
    flash = CutFlash(SIZE, LAYOUT.sector_bytes)
    store = CStore(library, flash, LAYOUT)
    image = image_of(2)
    bad_image = 4
    assert store.save(0, image_of(1)) == 0
    assert store.save(0, replace(image, data=image.data[::-1])) == bad_image
    assert kept(store).images == (1, 0, 0)


def wrong_plays(library: CDLL) -> list[int]:
    """Return the bytes of a kept image and its header after whose damage the image plays nevertheless."""
    whole = CutFlash(SIZE, LAYOUT.sector_bytes)
    store = CStore(library, whole, LAYOUT)
    assert (store.save(0, image_of(1)), store.select(0)) == (0, 0)
    first = LAYOUT.place(0)
    plays = []
    for at in range(first, first + 64 + len(image_of(1).data)):
        flash = whole.copy()
        flash.cells[at] ^= 4
        if CStore(library, flash, LAYOUT).start() != NONE:
            plays.append(at)
    return plays


def test_an_image_with_a_damaged_bit_does_not_play(library: CDLL) -> None:
    assert wrong_plays(library) == []


@pytest.mark.rest
@pytest.mark.parametrize("name", BY_DAMAGE)
def test_a_crc_that_is_not_checked_is_found_by_damage(name: str, tmp_path: Path) -> None:
    assert wrong_plays(compile_store(tmp_path, (BY_DAMAGE[name],)))


@pytest.mark.common
def test_no_cut_makes_a_mixture(library: CDLL) -> None:
    assert list(islice(faults(library, SCRIPT[:6]), 3)) == []


@pytest.mark.rest
def test_no_second_cut_during_the_recovery_makes_a_mixture(library: CDLL) -> None:
    assert list(islice(faults(library, SCRIPT[:3], second=True), 3)) == []


@pytest.mark.long
def test_no_second_cut_of_the_whole_script_makes_a_mixture(library: CDLL) -> None:
    assert list(islice(faults(library, second=True), 3)) == []


@pytest.mark.rest
@pytest.mark.parametrize("name", [pytest.param(one, marks=LONG_TEST if one in BY_TWO_CUTS else ()) for one in MUTANTS])
def test_every_fault_put_into_the_store_is_found(name: str, tmp_path: Path) -> None:
    mutant = compile_store(tmp_path, (MUTANTS[name],))
    assert next(faults(mutant, second=name in BY_TWO_CUTS), "")
