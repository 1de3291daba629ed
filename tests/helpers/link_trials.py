"""Everything that a compiled device is asked, in order of cost; for mutants. It has words of up to 16 bits."""

import traceback
from collections.abc import Iterator
from pathlib import Path

import link_device
import numpy as np
import test_c_link
import test_c_link_acceptance
import test_c_link_key
import test_c_link_parts
from dialogues import dialogues
from link_device import DeviceLibrary
from link_random import KEY, Dialogue


def golden_trials() -> Iterator[str]:
    """Frames and dialogues that are kept byte by byte."""
    for kind, check in (
        ("good", test_c_link.test_a_good_frame_is_answered_or_is_no_request),
        ("bad", test_c_link.test_what_is_no_frame_is_counted_once),
        ("empty", test_c_link.test_nothing_is_not_counted),
    ):
        for golden in test_c_link.FRAMES[kind]:
            yield f"frame: {golden['name']}"
            check(golden)
    for dialogue in dialogues():
        if test_c_link.golden_shaping(dialogue["device"]):
            continue  # the device of the trials does not shape
        yield f"dialogue: {dialogue['name']}"
        test_c_link.test_golden_dialogues(dialogue)


def trials() -> Iterator[str]:
    """Each by its name, before it is tried."""
    yield from golden_trials()
    parts = test_c_link_parts
    yield "an upload leaves what plays alone"
    parts.test_an_upload_leaves_what_plays_alone()
    yield "a word that changes"
    parts.test_a_word_that_changes_in_memory_is_found(1, True)
    parts.test_a_word_that_changes_in_memory_is_found(0, False)
    yield "tags"
    parts.test_a_tag_serves_one_request()
    parts.test_the_tag_of_a_commit_covers_the_image_in_memory()
    parts.test_every_bit_of_a_tag_counts(parts.Request.ARM)
    parts.test_nonces_are_others_after_each_start()
    key = test_c_link_key
    key.test_nonces_are_of_key_identity_boot_and_count()
    key.test_a_challenge_expires()
    for before in ("used by a request", "used by a commit", "expired"):
        key.test_a_commit_needs_a_challenge_of_its_own(before)
    for how in ({}, {"boot_persists": False, "random": key.urandom}):
        key.test_a_recorded_trigger_is_worth_nothing_after_a_power_cycle(how)
        key.test_it_is_worth_nothing_on_another_instrument(how)
    yield "what is refused at the start"
    key.test_a_configuration_with_one_fault_is_refused()
    key.test_a_key_without_what_it_needs_is_refused(*key.UNSTARTED[0])
    yield "the ring"
    parts.test_no_answer_is_lost_where_nothing_can_leave()
    parts.test_what_the_ring_has_no_room_for_is_counted_and_recovered_from()
    yield "lengths"
    parts.test_a_length_is_known_in_the_middle_of_any_frame()
    parts.test_the_form_of_an_upload_does_not_show_in_what_plays_or_is_read_back()
    yield "BLAKE2s"
    parts.test_blake2s_of_every_length_around_its_blocks(bytes(16))
    yield "while a program is checked"
    parts.test_a_device_that_checks_hears_and_is_busy()
    parts.test_an_interlock_that_opens_during_the_checks_leaves_the_upload()
    parts.test_another_image_of_the_same_bytes_begins_again()
    parts.test_the_line_of_a_commit_is_the_last_of_the_old_program()
    yield "the jump of y"
    test_c_link_acceptance.test_the_jump_of_y_is_the_largest_there_can_be(np.argmax)
    test_c_link_acceptance.test_the_jump_of_y_is_the_largest_there_can_be(np.argmin)
    for name in ("12 bits", "direct"):
        for state in ("playing", "parked"):
            yield f"programs: {name}, {state}"
            shape = test_c_link_acceptance.SHAPES.get(name) or test_c_link_acceptance.SHAPES["16 bits"]
            test_c_link_acceptance.compare(shape, state, 250, 3)
    for seed in range(3):
        for secret in (b"", KEY):
            for name in ("16 bits", "12 bits", "direct"):
                yield f"random dialogue {seed}: {name}"
                Dialogue(test_c_link.SHAPES[name], seed, secret).play(200)
    for seed in range(2):
        yield "programs: 16 bits, playing"
        test_c_link_acceptance.compare(test_c_link_acceptance.SHAPES["16 bits"], "playing", 400, 5 + seed)


def failure(path: Path) -> str:
    """The first trial that a compiled device fails, and why; empty if it passes all of them."""
    library = DeviceLibrary(path)
    for module in (link_device, test_c_link_parts):
        module.device_library = lambda *_: library  # type: ignore[attr-defined]
    name = ""
    try:
        for trial in trials():
            name = trial
    except Exception:
        return f"{name}: {traceback.format_exc().strip().splitlines()[-1][:200]}"
    return ""
