"""The result of an upload, its progress, and the error at the end of its time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tablegen.link.errors import OutOfTime
from tablegen.link.messages import Upload

_LONG_SILENCE_S = 2.0

ProgressCall = Callable[[int, int], None]  # (bytes that the device has, all bytes)


@dataclass(frozen=True, slots=True)
class UploadResult:
    """The result of an upload.

    ``line`` is the last line of the old frame, None where the answer was lost. ``bytes`` are those of the image,
    ``wire_bytes`` those that were sent for it, ``resumed`` those that the device had before. ``slow_baud`` is about the
    rate at which answers came, None where it was not far below that of the port. ``restarts`` are those of the device
    in mid-upload, by its boot count: each ends the scan that plays, and loses what was received.
    """

    already_running: bool
    generation: int
    line: int | None
    bytes: int
    wire_bytes: int
    resumed: int
    retransmissions: int
    seconds: float
    slow_baud: int | None = None
    restarts: int = 0


@dataclass(frozen=True, slots=True)
class MoveResult:
    """The result of a move: the generation that it has begun, and the last line before it."""

    generation: int
    line: int


@dataclass(frozen=True, slots=True)
class PlayResult:
    """The result of a request for a program by number: the generation that it has begun, and the last line before."""

    generation: int
    line: int


@dataclass(frozen=True, slots=True)
class UploadState:
    """The progress of an upload: the bytes that the device confirmed, all bytes, and whether a COMMIT was sent."""

    confirmed: int
    total: int
    committed: bool


def out_of_time(
    state: UploadState,
    upload: Upload | None,
    busy: bool,
    silence_s: float,
    slow_baud: int | None,
    causes: Sequence[str] = (),
) -> OutOfTime:
    """Return the error when the time of an upload is over: what the device said last, and what to do.

    ``upload`` is what the last STATUS said of this upload, None if there was none. ``busy``: another upload is in the
    way. ``silence_s`` is the time since the last answer, ``causes`` are what else is known of the line and the device.
    """
    if busy:
        what = "the device is busy with another upload; try again when that is active"
    elif upload in (Upload.CHECKING, Upload.WAITING):
        waits = "not reached the start of a line" if upload == Upload.WAITING else "not ended its checks"
        what = f"the device has received everything, but has {waits}; see `tablegen status`"
    else:
        what = f"by its last answer the device has {state.confirmed} of {state.total} bytes"
        if not state.committed:
            what += " and keeps them: repeat the upload to continue"
        elif state.confirmed < state.total:
            what += ": repeat the upload to continue (if more has arrived, the scan may become active)"
        else:
            what += ", and the scan may become active: see `tablegen status`"
    if silence_s >= _LONG_SILENCE_S:
        what = f"no answer for {silence_s:.0f} s; {what}"
    if slow_baud:
        what += f"; the line is slow, answers come at about {slow_baud} baud: give --baud {slow_baud}"
    what = "; ".join([*causes, what])
    return OutOfTime(f"timeout: {what}, or increase --timeout")


def restart_count(restarts: int) -> str:
    """Say that a device restarted so many times, and what to look at."""
    times = "once" if restarts == 1 else f"{restarts} times"
    return f"the device restarted {times} meanwhile: was its power cut, or does its supply or its watchdog reset it?"
