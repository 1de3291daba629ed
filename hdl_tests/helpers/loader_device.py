"""A simulated program_loader as the devices of ``tests/dialogues.py`` are: bytes in, bytes out, ticks."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from loader_bridge import Simulation, compile_loader
from replacing import replace

from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import program_words
from tablegen.emit.constants import DEGREES
from tablegen.emit.memory import memory_file
from tablegen.fixedpoint.synthesis import sine_quarter
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import ANSWER, SPLINE_DEGREE, AxisLimits, AxisShape, DeviceInfo, Feature, Request
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.verilog.simulate import CompiledDesign

_LINE_AT = 12  # in a status
_MEMORY_BYTES = 2048
_DEVICE_AT, _MOST_BYTES_AT = 0x100, 0x38  # firmware_templates/loader/memory.s
_FIXED_BYTES = 768  # of the memory: no image


class Loader:
    """A compiled bench for programs of the ``shape`` of ``boot``, which it starts with.

    ``limits`` are code_min, code_max and max_step of x and of y.
    """

    def __init__(
        self,
        folder: Path,
        boot: DualProgram,
        limits: tuple[tuple[int, int, int], tuple[int, int, int]],
        harmonics: int,
        update_rate_hz: int,
        **parameters: int | str,
    ) -> None:
        x, y = boot.x, boot.y
        self.boot, self.shape = boot, SequencerShape.of((x, y))
        top = (1 << x.output.dac_bits) - 1
        self.info = DeviceInfo(
            version=1,
            features=Feature.TABLES
            | Feature.FOURIER
            | Feature.READBACK
            | Feature.INTERLOCK
            | (Feature.COMMIT_MODES if parameters.get("COMMIT_MODES") else Feature(0)),
            window=8,
            data_bytes=240,
            harmonics=harmonics,
            image_bytes=_MEMORY_BYTES - _FIXED_BYTES,
            x=AxisShape(x.index_bits, x.bits, x.output.dac_bits, x.output.dac_bits),
            y=AxisShape(y.index_bits, y.bits, y.output.dac_bits, y.output.dac_bits),
            x_limits=AxisLimits(*limits[0], top),
            y_limits=AxisLimits(*limits[1], top),
            update_rate_hz=update_rate_hz,
            shaping=int(parameters.get("SHAPING", 0)),
            degree=SPLINE_DEGREE if "cubic" in (x.mode, y.mode) else 0,
        )
        folder.mkdir(parents=True, exist_ok=True)
        files = {
            "boot_program.mem": (np.array(program_words(boot.schedule, x, y)), 32),
            "boot_x.mem": (x.words, x.bits),
            "boot_y.mem": (y.words, y.bits),
            "sine.mem": (sine_quarter(max(x.index_bits, y.index_bits)), 32),
        }
        for name, (words, bits) in files.items():
            (folder / name).write_bytes(memory_file(words, bits))
        names = ("CODE_MIN", "CODE_MAX", "MAX_STEP")
        values = {
            f"{axis}_{name}": value
            for axis, own in zip("XY", limits, strict=True)
            for name, value in zip(names, own, strict=True)
        }
        self.compiled: CompiledDesign = compile_loader(
            folder,
            {
                "X_INTERPOLATED": DEGREES[x.mode],
                "X_INDEX_BITS": x.index_bits,
                "X_WORD_BITS": x.bits,
                "Y_INTERPOLATED": DEGREES[y.mode],
                "Y_INDEX_BITS": y.index_bits,
                "Y_WORD_BITS": y.bits,
                "DAC_BITS": x.output.dac_bits,
                "HARMONICS": harmonics,
                "UPDATE_RATE": update_rate_hz,
                "MEMORY_BYTES": _MEMORY_BYTES,
                "SINE_FILE": "sine.mem",
                "BOOT_PROGRAM": "boot_program.mem",
                "BOOT_X": "boot_x.mem",
                "BOOT_Y": "boot_y.mem",
                **values,
                **parameters,
            },
        )


class LoaderDevice:
    """A running one. In its answers the line of the frame is 0, since a model counts it from another moment."""

    def __init__(self, simulation: Simulation, info: DeviceInfo, boot: int, told: DeviceInfo | None = None) -> None:
        """``told``: what HELLO is to say of the device instead of ``info``, which it has to say."""
        self._simulation, self._info, self._told = simulation, info, told or info
        self._reader = FrameReader()
        self._out = b""
        self._permits = True
        simulation.set(boot_count=boot)

    @property
    def permits(self) -> bool:
        """The interlock."""
        return self._permits

    @permits.setter
    def permits(self, value: bool) -> None:
        self._permits = value
        self._simulation.set(permit=int(value))

    def receive(self, data: Sequence[int]) -> None:
        """Bytes from the host."""
        self._heard(self._simulation.talk(data))

    def transmit(self) -> bytes:
        """Bytes to the host."""
        out, self._out = self._out, b""
        return out

    def tick(self, ticks: int) -> None:
        """Samples."""
        if ticks:
            self._simulation.ticks(ticks)
            self._heard(self._simulation.talk())

    def reboot(self) -> None:
        """Not without another simulation."""
        raise NotImplementedError

    def _heard(self, wire: bytes) -> None:
        for frame in self._reader.feed(wire):
            assert self._reader.bad_frames == 0
            payload = frame.payload
            if frame.type == Request.HELLO | ANSWER:
                info = self._info.pack()
                assert payload[: len(info)] == info, (DeviceInfo.unpack(payload), self._info)
                payload = self._told.pack() + payload[len(info) :]
            self._out += without_lines(Frame(frame.type, frame.seq, frame.session, payload)).encode()


def without_lines(frame: Frame) -> Frame:
    """An answer that does not say which line of the frame plays."""
    payload = frame.payload
    at = {
        Request.HELLO | ANSWER: len(payload) - 76 + _LINE_AT,
        Request.STATUS | ANSWER: _LINE_AT,
        Request.COMMIT | ANSWER: 4,
    }
    if frame.type not in at:
        return frame
    start = at[frame.type]
    return Frame(frame.type, frame.seq, frame.session, payload[:start] + bytes(4) + payload[start + 4 :])


def told_to_be(info: DeviceInfo) -> list[tuple[int, int]]:
    """The bytes of the memory that make it a device with this information, as far as it is no matter of hardware."""
    most = enumerate(info.image_bytes.to_bytes(4, "little"), _MOST_BYTES_AT)
    return [*enumerate(info.pack(), _DEVICE_AT), *most]


def limited(info: DeviceInfo, x: AxisLimits, y: AxisLimits) -> tuple[DeviceInfo, list[tuple[int, int]]]:
    """A device with other limits, and the bytes that make it one."""
    info = replace(info, x_limits=x, y_limits=y)
    return info, told_to_be(info)
