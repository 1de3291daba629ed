"""Models of devices for tests of the client: behind a virtual line, a pty or a TCP port."""

import os
import select
import socket
import threading
import time
import tty
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

from client_line import VirtualLine
from editing import Outcome, run
from limits import PATIENCE_S
from link_programs import INFO, SmallScan, make_scan
from replacing import replace

from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.link.device import Device
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import SPLINE_DEGREE, AxisLimits, AxisShape, DeviceInfo, Feature, More, Request, ZInfo
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import LinePlayer
from tablegen.link.prepare import LEFT_ALIGNED, TWOS_COMPLEMENT, PreparedScan
from tablegen.link.program_image import fast_of

BOOT = make_scan(1)
KEY = bytes(range(16))
NEW = make_scan(2, ticks=300, lines=20, index_bits=(8, 7))
TABLE, FOURIER = NEW.image(False), NEW.image(True)
LARGE = make_scan(3, ticks=1250, lines=200, index_bits=(11, 11)).image(False)  # 8384 bytes, as the example has
LARGE_INFO = replace(INFO, x=AxisShape(11, 16, 16, 16), y=AxisShape(11, 16, 16, 16), image_bytes=9000)


def model(info: DeviceInfo = INFO, key: bytes = b"", boot: SmallScan | None = BOOT, **options: object) -> ModelDevice:
    """A device that plays ``boot`` from the start."""
    features = info.features | (Feature.KEY if key else Feature(0))
    boot_hash = bytes.fromhex(boot.digest) if boot is not None else bytes(32)
    player = LinePlayer(None if boot is None else boot.program)
    device = ModelDevice(replace(info, features=features), player, key=key, boot_hash=boot_hash, **options)  # type: ignore[arg-type]
    device.tick(1)
    return device


def client(line: VirtualLine, seed: int = 1, **options: object) -> Device:
    """The client on a virtual line, with chance from a seed."""
    return Device(line.open, random=Random(seed), sleep=line.sleep, **options)  # type: ignore[arg-type]


def info_for(scan: PreparedScan, **changes: object) -> DeviceInfo:
    """A device that was built for a scan."""
    shapes, limits = [], []
    for axis in (scan.program.x, scan.program.y):
        output = axis.output
        converter = output.word_bits
        converter |= TWOS_COMPLEMENT if output.coding == "twos-complement" else 0
        converter |= LEFT_ALIGNED if output.align == "left" else 0
        table = fast_of(axis)
        index_bits = (len(table.words) - 1).bit_length()
        shapes.append(AxisShape(index_bits, table.bits, output.dac_bits, converter))
        limits.append(AxisLimits(output.code_min, output.code_max, output.max_step, 1 << output.dac_bits))
    info = replace(
        INFO,
        harmonics=64,
        image_bytes=1 << 16,
        x=shapes[0],
        y=shapes[1],
        x_limits=limits[0],
        y_limits=limits[1],
        update_rate_hz=round(scan.program.schedule.update_rate_hz),
    )
    if isinstance(scan.program.x, FrameProgram):
        info = replace(info, more=More.SLOW_PARTS, slow_knots=17, slow_index_bits=6, degree=SPLINE_DEGREE)
    return replace(info, **changes)  # type: ignore[arg-type]


def z_info_for(scan: PreparedScan, **changes: object) -> DeviceInfo:
    """A device that was built for a scan with the output z; ``changes`` are of its second sequencer."""
    assert scan.program_of_z is not None
    of_z = info_for(PreparedScan(scan.name, scan.digest, scan.program_of_z, None, None))
    names = ("image_bytes", "slow_knots", "slow_index_bits", "x", "y", "x_limits", "y_limits")
    z = replace(ZInfo(*(getattr(of_z, name) for name in names)), **changes)
    info = info_for(scan)
    return replace(info, more=info.more | More.Z, degree=SPLINE_DEGREE, z=z)


class Watched(VirtualLine):
    """A line that notes the frames of the host as they leave."""

    def __init__(self, *arguments: object, **options: object) -> None:
        super().__init__(*arguments, **options)  # type: ignore[arg-type]
        self.frames: list[Frame] = []
        self._reader = FrameReader()

    def write(self, data: bytes) -> None:
        self.frames += self._reader.feed(data)
        super().write(data)

    def count(self, kind: Request) -> int:
        """Frames of a type."""
        return sum(frame.type == kind for frame in self.frames)


class LoseOnce:
    """Loses the n-th frame of a type, of the host or of the device."""

    def __init__(self, kind: int, which: int) -> None:
        self.kind, self.left = kind, which

    def __call__(self, piece: bytes) -> list[bytes]:
        frames = FrameReader().feed(piece)
        if frames and frames[0].type == self.kind:
            self.left -= 1
            if self.left == 0:
                return []
        return [piece]


class Bench:
    """A device at the port `virtual`, on a new line for every command."""

    def __init__(self, device: ModelDevice, **options: Any) -> None:
        self.device, self.options = device, options
        self.asked: list[tuple[str, int]] = []
        self.line: VirtualLine

    def open(self, url: str, baud: int) -> VirtualLine:
        self.asked.append((url, baud))
        self.line = VirtualLine(self.device, **{"baud": baud, "tick_hz": 500_000, **self.options})
        return self.line

    def run(self, *arguments: str | Path) -> Outcome:
        with patch("tablegen.link.device.open_port", self.open):
            return run(*arguments, "--port", "virtual")


class Served:
    """A model, or a compiled device, that plays in real time in a thread, on a pty or a TCP port.

    ``url`` is for pyserial. ``dies_after``: so many bytes from the host, and it hangs up, once; on TCP it can be
    called again.
    """

    def __init__(self, device: Any, kind: str, tick_hz: int = 20000, dies_after: int | None = None) -> None:
        self.device = device
        self.calls = 0
        self._tick_hz, self._dies_after = tick_hz, dies_after
        self._stop = threading.Event()
        self._ticked = Fraction(0)
        self._start = time.monotonic()
        self._listener: socket.socket | None = None
        self._master = self._slave = -1
        if kind == "pty":
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            self.url = os.ttyname(self._slave)
        else:
            self._listener = socket.create_server(("127.0.0.1", 0))
            self._listener.settimeout(0.05)
            self.url = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> "Served":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(PATIENCE_S)
        for descriptor in {self._master, self._slave} - {-1}:
            os.close(descriptor)
        if self._listener is not None:
            self._listener.close()

    def _run(self) -> None:
        if self._listener is None:
            self._serve(self._master)
            return
        while not self._stop.is_set():
            try:
                connection, _ = self._listener.accept()
            except TimeoutError:
                continue
            with connection:
                self.calls += 1
                self._serve(connection.fileno())

    def _serve(self, descriptor: int) -> None:
        received = 0
        while not self._stop.is_set():
            readable, _, _ = select.select([descriptor], [], [], 0.002)
            self._tick()
            if readable:
                try:
                    data = os.read(descriptor, 4096)
                except OSError:
                    return
                if not data:
                    return
                received += len(data)
                self.device.receive(data)
                if self._dies_after is not None and received > self._dies_after:
                    self._dies_after = None
                    if self._listener is None:
                        os.close(self._master)
                        self._master = -1
                    return
            answer = self.device.transmit()
            while answer:
                answer = answer[os.write(descriptor, answer) :]

    def _tick(self) -> None:
        due = int((Fraction(time.monotonic()) - Fraction(self._start)) * self._tick_hz - self._ticked)
        if due > 0:
            self.device.tick(due)
            self._ticked += due
