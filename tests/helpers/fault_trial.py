"""A device, a line with faults, the real client and the check of every line played, put together."""

from collections.abc import Callable
from random import Random

from line_log import LineCheck, PlayedLine
from link_device import DeviceLibrary, HostDevice
from link_faults import Chances
from link_line import Line
from link_programs import INFO, LIMITS, make_scan

from tablegen.link.device import Device
from tablegen.link.errors import LinkError, NoPort, Refused

UPLOAD_S = 8.0  # the deadline of an upload
_LATE_S = 2.0  # a client may be late by: the last wait for a port, and STATUS after the upload
_BOOT = make_scan(0)


class Instrument:
    """A device whose lines are checked as they are played: the far end of a ``Line``."""

    def __init__(self, key: bytes = b"", library: DeviceLibrary | None = None) -> None:
        self.check = LineCheck(_BOOT.program)
        self.device = HostDevice(
            _BOOT.program,
            _BOOT.program,
            library=library,
            limits=(LIMITS, LIMITS),
            index_bits=(INFO.x.index_bits, INFO.y.index_bits),
            harmonics=INFO.harmonics,
            window=6,
            update_rate_hz=INFO.update_rate_hz,
            key=key,
            boot_hash=bytes.fromhex(_BOOT.digest),
        )
        self.receive, self.transmit = self.device.receive, self.device.transmit

    def tick(self, ticks: int) -> None:
        """Samples; each line is looked at when it has ended."""
        self.device.tick(ticks)
        self.settle()

    def settle(self) -> None:
        """Look at what was played. Raises ``WrongLine``."""
        self.check.follow(PlayedLine(*line) for line in self.device.lines())

    def reboot(self) -> None:
        """Start again."""
        self.settle()
        self.check.reboot()
        self.device.reboot()


class Trial:
    """Uploads to one instrument over one line, from a seed.

    ``on_frame`` sees what arrives, before the device does. ``outcomes`` are "in force" and names of errors.
    """

    def __init__(
        self,
        seed: int,
        chances: Chances,
        *,
        key: bytes = b"",
        library: DeviceLibrary | None = None,
        on_frame: Callable[[Instrument, bytes], None] | None = None,
    ) -> None:
        self.seed, self.instrument = seed, Instrument(key, library)
        self._key = key
        self._random = Random(seed)

        def arrives(frame: bytes) -> None:
            if on_frame is not None:
                on_frame(self.instrument, frame)

        self.line = Line(self.instrument, chances=chances, seed=seed, on_frame=arrives)
        self.outcomes: list[str] = []

    def client(self) -> Device:
        """A new one, once the port is there."""
        while True:
            try:
                return Device(self.line.open, key=self._key or None, random=self._random, sleep=self.line.sleep)
            except NoPort:
                self.line.sleep(0.1)

    def upload(self, number: int) -> None:
        """One upload while a scan plays, by a client of its own; it ends well, or with an error in time."""
        scan = make_scan(1000 * self.seed + number + 1)
        self.instrument.check.offer(scan.digest, scan.program)
        start, resets, error = self.line.now_s, self.line.resets, None
        try:
            with self.client() as device:
                device.arm()
                device.trigger()
                start = self.line.now_s
                result = device.upload(scan.image(fourier=(self.seed + number) % 2 == 0), timeout_s=UPLOAD_S)
        except LinkError as raised:
            error = raised
        assert self.line.now_s - start < UPLOAD_S + _LATE_S, error
        if error is not None:
            assert not isinstance(error, Refused), error  # there is nothing to object to
            assert str(error), type(error)
            self.outcomes.append(type(error).__name__)
            return
        self.outcomes.append("in force")
        self.play_a_line()
        if self.line.resets == resets:
            assert self.instrument.check.taken[result.generation] == scan.digest

    def play_a_line(self) -> None:
        """Time for more than one."""
        self.line.sleep(0.03)

    def end(self) -> None:
        """On a line without faults the device takes an upload and plays it."""
        self.line.heal()
        scan = make_scan(1000 * self.seed + 999)
        self.instrument.check.offer(scan.digest, scan.program)
        with self.client() as device:
            device.arm()
            device.trigger()
            generation = device.upload(scan.image(fourier=self.seed % 2 == 0), timeout_s=UPLOAD_S).generation
            self.play_a_line()
            now = device.status()
        assert (now.generation, now.hash.hex(), now.faults) == (generation, scan.digest, 0)
        assert self.instrument.check.taken[generation] == scan.digest
