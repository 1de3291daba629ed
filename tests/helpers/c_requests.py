"""Requests, banks, status and faults of the C sequencer; checks of ``c_checks``."""

from ctypes import c_uint32

import numpy as np
from c_devices import Libraries, device_for, flat, playing
from c_library import BUSY, CLAMP, LOADED, MARKER, OVERRUN, SLEW, UNDERRUN, same
from replacing import replace

from tablegen.device.schedule import Window as Lines

REQUESTS = 8  # in the queue


def status_of_power_up(libraries: Libraries) -> None:
    """Everything is stated by init, whatever was in memory; the codes at power-up hold, and nothing can be started."""
    device = device_for(libraries.narrow, flat(1), power_up=4711)
    status = device.status()
    assert (status.markers, status.faults, status.swaps, status.line) == (0, 0, 0, 0)
    assert list(status.fault_counts) == [0] * 4
    assert device.idle() == 0
    assert device.writable()
    assert not device.commit()
    assert device.arm(0)
    assert device.trigger()
    for x, y, marks in (device.steps(5)[:3], device.fill(5)):
        assert set(x) == set(y) == {4711}
        assert set(marks) == {MARKER["parked"]}
    assert device.load(flat(1)) == LOADED
    assert device.commit()
    assert device.trigger()  # still armed, and the program waits
    assert device.steps(1)[2][0] & (MARKER["swapped"] | MARKER["playing"]) == MARKER["swapped"] | MARKER["playing"]


def the_first_trigger(libraries: Libraries) -> None:
    """Right after the first commit, before any tick: it starts with the program, unless that is withdrawn."""
    program = flat(1)
    for requests, marks in (
        (("commit", "arm", "trigger"), ("swapped", "playing", "line", "frame")),
        (("arm", "commit", "trigger"), ("swapped", "playing", "line", "frame")),
        (("arm", "trigger", "commit"), ("swapped", "parked")),
        (("commit", "arm", "trigger", "withdraw"), ("parked",)),
        (("commit", "arm", "trigger", "reset"), ("parked",)),
        (("commit", "arm", "trigger", "park"), ("swapped", "parked")),
        (("commit", "arm", "trigger", "withdraw", "commit"), ("swapped", "parked")),
        (("commit", "arm", "withdraw", "commit", "trigger"), ("swapped", "playing", "line", "frame")),
    ):
        device = device_for(libraries.narrow, program)
        assert device.load(program) == LOADED
        for name in requests:
            assert device.arm(0) if name == "arm" else getattr(device, name)()
        first = device.fill(3)[2] if len(requests) % 2 else device.steps(3)[2]
        assert first[0] & ~MARKER["valid"] & ~MARKER["pixel"] == sum(MARKER[name] for name in marks), requests
        assert [bool(each & MARKER["playing"]) for each in first] == ["playing" in marks] * 3, requests


def the_queue(libraries: Libraries) -> None:
    """Takes as many requests as it has places, refuses more without effect, and is empty once they were acted on."""
    program = flat(1)
    for start in (0, 3, 250):
        device = device_for(libraries.narrow, program)
        for _ in range(start):
            assert device.clear_faults()
            device.answer()
        assert device.load(program) == LOADED
        assert all(device.arm(5) for _ in range(REQUESTS - 1))
        assert device.arm(1)
        requests = ("commit", "withdraw", "trigger", "park", "reset", "clear_faults")
        assert not any(getattr(device, name)() for name in requests)
        assert not device.arm(7)
        assert device.writable(), "a commit that was refused waits"
        device.answer()
        assert device.writable()
        assert all((device.commit(), device.trigger(), device.trigger()))
        assert not device.writable()
        device.answer()
        assert not device.writable(), "the program was not taken yet"
        assert device.trigger()  # nobody armed it again
        marks = device.steps(130)[2]
        assert marks[0] & MARKER["swapped"]
        assert device.writable()
        assert np.sum(marks & MARKER["playing"] != 0) == program.schedule.frame_ticks, "the last count of arm is that"


def answers(libraries: Libraries) -> None:
    """Requests act without ticks where the driver asks for it, and in their order."""
    program = flat(1000)
    device = playing(libraries.narrow, program)
    device.steps(8)
    assert device.park()
    device.answer()
    assert device.load(program) == LOADED
    assert device.commit()
    assert device.load(program) == BUSY
    assert device.withdraw()
    assert device.load(program) == BUSY
    device.answer()
    assert device.writable()
    assert device.load(program) == LOADED
    assert device.commit()
    assert device.reset()
    device.answer()
    assert device.writable()
    device.steps(3)
    assert device.status().swaps == 1
    assert device.arm(0)
    assert device.trigger()
    assert device.park()
    assert device.trigger()
    assert device.steps(1)[2][0] & MARKER["playing"] == 0
    assert device.arm(0)
    assert device.reset()
    assert device.trigger()
    assert device.steps(1)[2][0] & MARKER["playing"] == 0


def banks(libraries: Libraries) -> None:
    """The set of tables to write is the one that does not play; a bank can be loaded again until it is committed."""
    device = device_for(libraries.narrow, flat(1))
    for number, expected in enumerate((0, 1, 0, 1)):
        assert device.idle() == expected
        assert device.load(flat(7)) == LOADED
        assert device.load(flat(100 + number)) == LOADED
        assert device.commit()
        assert device.load(flat(8)) == BUSY
        assert device.idle() == expected
        device.steps(1)
        assert device.arm(0)
        assert device.trigger()
        assert set(device.steps(10)[0]) == {100 + number}
        assert device.park()
        device.steps(1)


def commits(libraries: Libraries) -> None:
    """A commit is for what was loaded since the last swap: after it the idle bank has what played before."""
    device = device_for(libraries.narrow, flat(1))
    assert not device.commit(), "nothing was loaded"
    assert device.load(flat(10)) == LOADED
    assert all(device.commit() for _ in range(3))
    device.steps(2)
    assert device.status().swaps == 1
    assert device.writable()
    assert device.commit()
    assert not device.writable(), "not before it was answered"
    assert not device.steps(3)[2][0] & MARKER["swapped"], "the other bank is empty"
    assert device.status().swaps == 1
    assert device.writable()
    assert device.load(flat(20)) == LOADED
    assert device.load(flat(30)) == LOADED
    assert device.commit()
    assert device.withdraw()
    device.steps(2)
    assert device.status().swaps == 1
    assert device.commit(), "a program that was withdrawn is still loaded"
    assert device.steps(1)[2][0] & MARKER["swapped"]
    assert device.arm(0)
    assert device.trigger()
    assert set(device.steps(4)[0]) == {30}
    assert device.commit()
    assert device.load(flat(40)) == BUSY
    device.steps(70)
    assert device.status().swaps == 2
    # Committed before a swap and after it, both in the queue at once: the second is void.
    assert device.load(flat(50)) == LOADED
    assert device.commit()
    assert device.commit()
    device.steps(70)
    assert device.status().swaps == 3
    assert set(device.steps(4)[0]) == {50}


def reports(libraries: Libraries) -> None:
    """Faults that the driver saw are counted, sticky, told and cleared; counts stay at their highest."""
    program = flat(1000, replace(flat(1).schedule, up=Lines(0, 2)))
    device = playing(libraries.narrow, program)
    valid = MARKER["valid"]
    assert np.any(device.steps(64)[2] & valid)
    for fault, counts in ((OVERRUN, [0, 0, 1, 0]), (UNDERRUN, [0, 0, 1, 1]), (OVERRUN | UNDERRUN, [0, 0, 2, 2])):
        device.report(fault)
        assert list(device.status().fault_counts) == counts
    *_, marks, faults = device.steps(64)
    assert not np.any(marks & valid)
    assert set(faults) == {OVERRUN | UNDERRUN} == {device.status().faults}
    assert not np.any(device.fill(64)[2] & valid)
    assert device.clear_faults()
    assert np.any(device.fill(64)[2] & valid)
    assert device.status().faults == 0
    for fault in range(4):
        device.library.dll.probe_set_count(device.state, fault, c_uint32(2**32 - 2))
    for _ in range(3):
        device.report(SLEW | CLAMP | OVERRUN)
    assert list(device.status().fault_counts) == [2**32 - 1] * 3 + [2**32 - 2]
    assert device.reset()
    device.steps(1)
    assert list(device.status().fault_counts) == [0] * 4
    assert device.status().faults == 0


def lines_of_the_status(libraries: Libraries) -> None:
    """The line of the frame that the next tick belongs to."""
    device = playing(libraries.narrow, flat(5))
    seen = []
    for _ in range(130):
        device.steps(1)
        seen.append(device.status().line)
    lines = np.array(seen)
    same("lines", (np.arange(1, 131) // 32) % 2, lines)
