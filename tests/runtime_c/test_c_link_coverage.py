"""Dialogues go through every line of the C link."""

from pathlib import Path
from typing import Any

import pytest
import test_c_link
import test_c_link_acceptance
import test_c_link_parts as parts
from c_coverage import COVERAGE, coverage
from dialogues import dialogues
from link_device import HostDevice
from link_replay import compile_replay, random_replay, replay, replay_of

from tablegen.base.resources import c_link

pytestmark = pytest.mark.rest

# A program that passes every check and is not loaded all the same; a source of random numbers, which no notes have.
UNREACHABLE = ("DAC_LINK_REFUSED, (uint32_t)loaded", "c->random(some)")


def test_every_line_was_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = test_c_link.SHAPES
    replays = [random_replay(shapes["16 bits"], 1, keyed=True), random_replay(shapes["direct"], 2)]
    devices: list[HostDevice] = []
    made = HostDevice.__init__

    def noted(self: HostDevice, *arguments: Any, **options: Any) -> None:
        made(self, *arguments, **options)
        self.take_notes()
        devices.append(self)

    monkeypatch.setattr(HostDevice, "__init__", noted)
    for dialogue in dialogues():
        test_c_link.test_golden_dialogues(dialogue)
    for check in (
        parts.test_what_the_ring_has_no_room_for_is_counted_and_recovered_from,
        parts.test_an_abort_withdraws_a_program_that_is_checked,
        parts.test_an_interlock_that_opens_during_the_checks_leaves_the_upload,
        parts.test_a_table_of_no_words,
        parts.test_an_abort_too_many,
        parts.test_a_commit_where_nobody_asks_for_samples,
    ):
        check()
    for state in test_c_link_acceptance.STATES:
        test_c_link_acceptance.compare(shapes["16 bits"], state, 100, 77)
    replays += [replay_of(device, b"") for device in devices]
    for number, slices in enumerate((64, 5)):
        program = compile_replay(tmp_path / f"replay_{number}", 16, options=(*COVERAGE, f"-DDAC_LINK_SLICE={slices}"))
        for each in replays:
            assert replay(program, each).returncode == 0
    found = coverage([tmp_path], [path.name for path in c_link()])
    missed = [line for line in found.missed() if not any(text in _text(line) for text in UNREACHABLE)]
    assert not missed, " ".join(missed)
    assert found.share_of_branches > 0.9, found.missed_branches()


def _text(line: str) -> str:
    name, number = line.split(":")
    path = next(path for path in c_link() if path.name == name)
    return path.read_text("utf-8").splitlines()[int(number) - 1]
