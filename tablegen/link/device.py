"""The class ``Device``: an instrument at the end of a serial line, for control software; nothing is printed."""

import math
import random as random_module
import struct
import time
from collections.abc import Callable
from functools import partial
from random import Random
from types import TracebackType
from typing import TYPE_CHECKING, Self

from tablegen.device.commit_mode import CommitMode
from tablegen.link.claims import MAXIMUM_NUMBERS, check_length, check_limits, has_restarted, has_slow_parts, most_bytes
from tablegen.link.errors import NotPlaying, NotUnderstood, OutOfTime, Refused, Unsuitable
from tablegen.link.kept import CHANGE_S, KeptPrograms, change_kept, read_kept, require_store
from tablegen.link.messages import (
    DATA_BYTES,
    NO_SLOT,
    AxisLimits,
    AxisWords,
    DeviceInfo,
    DeviceState,
    DeviceStatus,
    Move,
    Reason,
    Request,
)
from tablegen.link.outcome import MoveResult, PlayResult, ProgressCall, UploadResult, UploadState, restart_count
from tablegen.link.pace import LATENCY_S, Deadline
from tablegen.link.programs import DeviceProgram, play_number, read_programs
from tablegen.link.readback import read_back
from tablegen.link.refusal_reasons import Limits, lacks_move
from tablegen.link.session import LinkSession
from tablegen.link.transport import Opener, Transport, byte_s, open_port
from tablegen.link.upload import Uploader

if TYPE_CHECKING:
    from tablegen.link.program_image import ProgramImage

TIMEOUT_S = 5.0  # timeout of a request
_UPLOAD_MARGIN_S = 15.0  # margin on top of the transfer time of an upload
_UPLOAD_TIME_FACTOR = 4.0  # factor on the transfer time of an upload
_MAX_LATE_S = 5.0  # lateness of answers that time-outs allow for
_MAX_LATE_SUM_S = 900.0  # total lateness of the answers of a transfer that time-outs allow for
_MAX_LINE_S = 600.0  # a device that announces a rate of 1 Hz must not hold the host for months
_MAX_TRIES = 8  # tries that fit into a time-out when answers are late
_MOVE_S = 60.0  # a move waits for the start of a line
_PLAY_S = 60.0  # a program waits for the start of a line
_PLAY_AT_FRAME_S = 600.0  # or of a frame, which may take minutes
_MOVED = struct.Struct("<2I")
_CHECK_FRAMES = 8  # frames that the checks of slow parts may take: a tick is checked slower than it is played
_POLL_S = 0.05
_HELLO_FRESH_S = 0.25  # a HELLO this recent is not repeated: an upload notices a change by itself
_MAX_READINGS = 3
_GENERATION_BYTES = 4
_KEY_BYTES = range(16, 33)
_NO_HASH = bytes(32)


class Device:
    """An instrument that speaks docs/protocol.md. Use it as a context manager, or ``close`` it; one thread at a time.

    Every method ends within its time-out, in a result or a ``LinkError``: ``Refused`` tells what the device objects to,
    ``LinkLost`` that it is gone. A port that vanishes is opened again meanwhile.
    """

    def __init__(
        self,
        port: "str | Opener | Transport",
        *,
        baud: int = 115200,
        key: bytes | None = None,
        latency_s: float = LATENCY_S,
        timeout_s: float = TIMEOUT_S,
        random: Random | None = None,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Open a port and send HELLO.

        Parameters
        ----------
        port
            A port or URL of pyserial, a function that opens a ``Transport`` (again and again), or an open one.
        key
            16 to 32 bytes.
        latency_s
            Latency of bridges between host and device.
        timeout_s
            Bound of a request, to which 8 times the lateness of answers is added, up to 5 s.
        random, sleep
            Replacements for tests.

        Raises
        ------
        NoPort, SerialMissing
            If the port cannot be opened.
        NoAnswer, Refused
            If no device answers, or one of another version.
        ValueError
            If the key has another length.
        """
        if key is not None and len(key) not in _KEY_BYTES:
            raise ValueError(f"a key of {len(key)} bytes; devices have 16 to 32")
        opener: Opener | None = None
        if isinstance(port, str):
            opener = partial(open_port, port, baud)
        elif callable(port):
            opener = port
        transport: Transport = opener() if opener is not None else port  # type: ignore[assignment]
        chance = random if random is not None else random_module.SystemRandom()
        self._session = LinkSession(transport, opener, key, latency_s, chance, sleep)
        self._timeout_s = timeout_s
        self._uploader: Uploader | None = None
        try:
            self._session.hello(self._until(None))
        except BaseException:
            self._session.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the port back; the device goes on as it is."""
        self._session.close()

    @property
    def info(self) -> DeviceInfo:
        """The properties of the device, fixed at its build."""
        return self._session.info

    @property
    def hello(self) -> DeviceStatus:
        """The status at the last HELLO, or at the end of the last upload; ``status`` asks again."""
        return self._session.status

    @property
    def acts(self) -> tuple[Request, ...]:
        """The requests that were sent and change what the device does: it may have carried them out."""
        return tuple(self._session.acts)

    @property
    def upload_state(self) -> UploadState | None:
        """The progress of the last upload, for the time when it is interrupted; None if there was none."""
        return None if self._uploader is None else self._uploader.state

    def status(self) -> DeviceStatus:
        """Ask the device for its status."""
        payload = self._session.ask(Request.STATUS, b"", DeviceStatus.LAYOUT.size, self._until(None))
        return self._session.status_of(payload)

    def needs_key(self) -> bool:
        """Return True if uploads carry a tag; nothing is sent.

        Raises
        ------
        Refused
            If they do and there is no key.
        """
        return self._session.needs_key(Request.COMMIT)

    def upload(
        self,
        image: "ProgramImage",
        progress: ProgressCall | None = None,
        *,
        force: bool = False,
        timeout_s: float | None = None,
        limits: Limits | None = None,
        swap: CommitMode = CommitMode.LINE,
    ) -> UploadResult:
        """Put a new scan into the instrument, which goes on with the old one until a line of the new one starts.

        What a device would refuse, ``tablegen.link.prepare.check`` says before.

        Parameters
        ----------
        progress
            Function that is called with the bytes that the device has, and with all.
        force
            True to send a scan that is already active too.
        timeout_s
            Bound of the whole upload in s; by default ``upload_time_s``.
        limits
            Limits of the device, to explain refusals in more detail.
        swap
            Where in a running scan the new one is swapped in, and on which line it starts: at the next line start from
            line 0; there, and the frame goes on; or at the next frame start.

        Raises
        ------
        Unsuitable
            If the device does not have this mode; nothing was sent.
        Refused, LinkLost, OutOfTime
            If the device refuses, is gone, or takes too long: the old scan plays on, and the device keeps what it has
            received, so that the same upload again goes on from there.
        NotPlaying
            If the device took the upload and plays something else.
        NotUnderstood
            If its answers contradict each other.
        """
        session = self._session
        deadline = Deadline(session.now(), lambda: self.upload_time_s(image, swap) if timeout_s is None else timeout_s)
        if session.now() - session.status_at > _HELLO_FRESH_S:
            session.greet(deadline.at)
        status = session.status
        if status.hash == image.info.hash and not force:
            status = self.status()  # the device may have been reset since
        if status.hash == image.info.hash and not force:
            return UploadResult(True, status.generation, None, len(image.data), 0, 0, 0, 0.0)
        before = status
        session.status_at = -math.inf  # the status changes, whatever becomes of the upload
        self._uploader = Uploader(session, image, deadline, progress, limits, swap)
        result = self._uploader.run()
        hello, playing = session.status, self.status()
        restarted = has_restarted(hello, playing)  # back to the program that it starts with
        session.status, session.status_at = playing, session.now()
        if playing.hash != image.info.hash and (restarted or playing.hash != _NO_HASH):
            why = restart_count(1) if restarted else "did another program upload too?"
            raise NotPlaying(
                f"the device took the upload, and plays {playing.hash.hex()[:12]} instead of "
                f"{image.info.hash.hex()[:12]}; {why}"
            )
        if playing.boot == before.boot and result.generation > playing.generation:
            raise NotUnderstood(
                f"COMMIT: generation is {result.generation}, and that of STATUS after it {playing.generation}"
            )
        return result

    def upload_time_s(self, image: "ProgramImage", swap: CommitMode = CommitMode.LINE) -> float:
        """Return the default time for an upload, in seconds: many times what it takes, and two long lines.

        An upload that waits for a frame start has two frames of the new scan, as the old one's are not known; one with
        slow parts has some more, since a device may play all ticks of a frame to check them.

        Answers that come late, through a long way or a slow line, add to it, each by at most 5 s and all of them by at
        most an hour. A line counts as 10 minutes at most, whatever rate the device announces.
        """
        rate = self.info.update_rate_hz
        line_ticks, lines = struct.unpack_from("<2I", image.data)
        ticks = line_ticks * lines if swap is CommitMode.FRAME else line_ticks
        wait_s = ticks / rate if rate else 0.0
        checks_s = _CHECK_FRAMES * line_ticks * lines / rate if rate and has_slow_parts(image.data) else 0.0
        return self._transfer_time_s(len(image.data)) + 2.0 * min(wait_s, _MAX_LINE_S) + min(checks_s, _MAX_LINE_S)

    def _transfer_time_s(self, size: int) -> float:
        exchange, info = self._session.exchange, self.info
        late_s = min(-(-size // (info.window * DATA_BYTES)) * self._late_s(), _MAX_LATE_SUM_S)
        return _UPLOAD_MARGIN_S + _UPLOAD_TIME_FACTOR * (size * byte_s(exchange.transport.baud) + late_s)

    def readback(self, *, timeout_s: float | None = None) -> bytes:
        """Read back the image of the scan that plays, as bytes.

        Parameters
        ----------
        timeout_s
            Bound in s; by default what the longest image takes.

        Raises
        ------
        Refused
            If the device does not hold it: a scan that came with the firmware, or memory in use.
        OutOfTime
            If the scan changed each time it was read, or the device takes too long.
        """
        size = most_bytes(self.info)
        deadline = Deadline(
            self._session.now(), lambda: self._transfer_time_s(size) if timeout_s is None else timeout_s
        )
        for _ in range(_MAX_READINGS):
            before = self.status()
            reading = read_back(self._session, deadline)
            after = self.status()
            if (before.boot, before.generation) == (after.boot, after.generation):
                return reading.image()
        raise OutOfTime("the scan changed while it was read; is another program uploading?")

    def move(self, x: AxisWords, y: AxisWords, generation: int, timeout_s: float = _MOVE_S) -> MoveResult:
        """Give the program that plays other gain and offset words; its tables stay, and the frame goes on.

        Parameters
        ----------
        x, y
            The words of both axes, with the fraction bits of the program. With a ``factor_word`` those of a program
            with slow parts, with its gains as it was uploaded times ``factor_word / 2^16``.
        generation
            That of the program, as ``UploadResult``, ``MoveResult`` or the status has it.
        timeout_s
            Bound in s; a move waits for the start of a line.

        Raises
        ------
        Unsuitable
            If the device takes no moves (``More.MOVE``), or none of slow parts; nothing was sent.
        Refused
            If another program plays, or the moved one would break a limit; the device plays as before.
        LinkLost
            If the device is gone; the scan plays as before, or moved.
        """
        if why := lacks_move(self.info, x.factor_word is not None):
            raise Unsuitable([why])
        payload, tries = Move(generation, x, y).pack(), _MAX_TRIES + math.ceil(timeout_s)
        session = self._session
        deadline = session.now() + timeout_s
        session.status_at = -math.inf  # the status changes
        answer = session.act(Request.MOVE, payload, _MOVED.size, deadline, tries=tries, one_session=True)
        check_length("MOVE", answer, _MOVED.size)
        return MoveResult(*_MOVED.unpack_from(answer))

    def programs(self) -> tuple[DeviceProgram, ...]:
        """Ask for the programs that the device plays by number: compiled ones, and those that it keeps.

        Raises
        ------
        Unsuitable
            If it plays none (``More.PLAY``).
        """
        return read_programs(self._session, self._until(None))

    def play(self, number: int, *, swap: CommitMode = CommitMode.LINE, timeout_s: float | None = None) -> PlayResult:
        """Play a program that the device has itself; return when it plays.

        It takes the place of the one that plays as an upload would, after the same checks. An upload that the device
        has received in part is forgotten.

        Parameters
        ----------
        number
            As ``programs`` has it.
        swap
            Where in a running scan the program is swapped in, as in ``upload``.
        timeout_s
            Bound in s; by default 1 minute, and 10 for a swap at a frame start.

        Raises
        ------
        ValueError
            If ``number`` does not fit 16 bits.
        Unsuitable
            If the device plays no programs by number, or does not have this mode; nothing was sent.
        Refused
            If there is no such program, or it fails a check; the device plays as before.
        OutOfTime
            If the program still waits; it may become active.
        LinkLost
            If the device is gone.
        """
        if not 0 <= number <= MAXIMUM_NUMBERS:
            raise ValueError(f"number {number}; programs have numbers from 0 to {MAXIMUM_NUMBERS}")
        if timeout_s is None:
            timeout_s = _PLAY_AT_FRAME_S if swap is CommitMode.FRAME else _PLAY_S
        self._session.status_at = -math.inf  # the status changes
        return play_number(self._session, number, swap, timeout_s)

    def park(self) -> None:
        """Park: end the scan, ramp to the park codes and hold them; ``wait_for(State.PARKED)`` waits for the end."""
        self._act(Request.PARK)

    def arm(self, frames: int = 0) -> None:
        """Let the next trigger play so many frames; 0 is without end.

        Raises
        ------
        ValueError
            If ``frames`` does not fit 32 bits.
        Refused
            If the device refuses.
        """
        if not 0 <= frames < 1 << 32:
            raise ValueError(f"{frames} frames; 0 (endless) to 2^32 - 1")
        self._act(Request.ARM, frames.to_bytes(4, "little"))

    def trigger(self) -> None:
        """Start the frames that were armed."""
        self._act(Request.TRIGGER)

    def clear(self) -> None:
        """Clear faults and their counts."""
        self._act(Request.CLEAR)

    def abort(self) -> int:
        """Discard an upload and withdraw a waiting program; return the generation that plays."""
        payload = self._act(Request.ABORT, plain=True)
        check_length("ABORT", payload, _GENERATION_BYTES)
        return int.from_bytes(payload[:_GENERATION_BYTES], "little")

    def slots(self) -> KeptPrograms:
        """Ask for the programs that the device keeps.

        Raises
        ------
        Unsuitable
            If it keeps none (``Feature.STORE``).
        """
        return read_kept(self._session, self._until(None))

    def save(self, slot: int, generation: int | None = None) -> None:
        """Keep the active program in a slot, in place of what the slot has.

        Parameters
        ----------
        slot
            Number of the slot, from 0.
        generation
            That of the program, as ``UploadResult`` has it; by default of the one that is active now.

        Raises
        ------
        Unsuitable
            If the device keeps no programs.
        Refused
            If the scan came with the firmware, the slot is too small, or flash cannot be written now.
        LinkLost
            If the device restarts meanwhile.
        """
        require_store(self._session)
        if generation is None:
            generation = self.status().generation
        self._change(Request.SAVE, struct.pack("<BI", slot, generation))

    def select(self, slot: int | None, trial: bool = False) -> None:
        """Choose the slot whose program plays after a start; None is the program of the firmware.

        With ``trial`` it plays after one start only, unless it is then confirmed.

        Raises
        ------
        Refused
            If the slot is empty, or flash cannot be written now.
        """
        self._change(Request.SELECT, bytes([NO_SLOT if slot is None else slot, trial]))

    def confirm(self) -> None:
        """Select the trial that plays since the start.

        Raises
        ------
        Refused
            If there is none, or flash cannot be written now.
        """
        self._change(Request.CONFIRM, b"")

    def delete(self, slot: int) -> None:
        """Empty a slot; where it was selected, the program of the firmware is.

        Raises
        ------
        Refused
            If it is empty already, or flash cannot be written now.
        """
        self._change(Request.DELETE, bytes([slot]))

    def _change(self, kind: Request, payload: bytes) -> None:
        change_kept(self._session, kind, payload, self._until(max(self._timeout_s, CHANGE_S)))

    def limits(self) -> Limits:
        """Ask for the active limits of x and y.

        Raises
        ------
        Refused
            If the device refuses for another reason than that it has no such request.
        """
        size = 2 * AxisLimits.LAYOUT.size
        try:
            return self._limits(self._session.ask(Request.LIMITS, b"", size, self._until(None)))
        except Refused as refusal:
            if refusal.reason != Reason.TYPE:
                raise
            return self.info.x_limits, self.info.y_limits  # the device has no other limits

    def narrow(self, x: AxisLimits, y: AxisLimits) -> Limits:
        """Narrow the limits until the device's next start, or until this is called again; return the active limits.

        They are cut to those of the device's build.

        Raises
        ------
        Refused
            If the device cannot (``Feature.NARROWS``).
        """
        return self._limits(self._act(Request.LIMITS, x.pack() + y.pack(), 2 * AxisLimits.LAYOUT.size))

    def wait_for(self, state: DeviceState, timeout_s: float) -> DeviceStatus:
        """Wait until the sequencer is in a state; with an output z, until it is parked too where this is ``PARKED``.

        Raises
        ------
        OutOfTime
            If it is not within ``timeout_s`` seconds.
        """
        deadline = self._until(timeout_s)
        while True:
            status = self.status()
            if status.state == state and not (state == DeviceState.PARKED and _z_moves(status)):
                return status
            if self._session.now() >= deadline:
                raise OutOfTime(
                    f"the device is {status.state.name.lower()} and did not become {state.name.lower()} within "
                    f"{timeout_s:g} s"
                )
            self._sleep(min(_POLL_S, deadline - self._session.now()))

    def _sleep(self, seconds: float) -> None:
        """Sleep by the clock of the port, and empty it meanwhile."""
        self._session.exchange.receive(self._session.now() + seconds)

    def _act(self, kind: Request, payload: bytes = b"", answer_bytes: int = 16, plain: bool = False) -> bytes:
        return self._session.act(kind, payload, answer_bytes, self._until(None), tagged=not plain)

    def _until(self, timeout_s: float | None) -> float:
        """Return a deadline. That of a request leaves time for several tries on a slow connection."""
        if timeout_s is None:
            timeout_s = self._timeout_s + _MAX_TRIES * self._late_s()
        return self._session.now() + timeout_s

    def _late_s(self) -> float:
        """Return the time in s by which answers are late."""
        return min(self._session.exchange.pace.late_s, _MAX_LATE_S)

    def _limits(self, payload: bytes) -> Limits:
        size = AxisLimits.LAYOUT.size
        check_length("LIMITS", payload, 2 * size)
        limits = AxisLimits.unpack(payload), AxisLimits.unpack(payload[size:])
        check_limits(limits, self.info)
        return limits


def _z_moves(status: DeviceStatus) -> bool:
    """Return True if the output z is on its way, or plays."""
    return status.z is not None and status.z.state in (DeviceState.PARKING, DeviceState.PLAYING)
