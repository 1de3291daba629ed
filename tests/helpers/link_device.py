"""The C link and sequencer as a whole device on this machine: bytes in, bytes out, ticks, and the lines that it plays.

``HostDevice`` is firmware without wires: ``tests/link_device.c`` around the shipped runtime, compiled once a process.
"""

import atexit
import ctypes
import shutil
import tempfile
from collections.abc import Callable, Iterable, Sequence
from ctypes import (
    CFUNCTYPE,
    POINTER,
    Structure,
    c_bool,
    c_char_p,
    c_int32,
    c_size_t,
    c_uint8,
    c_uint16,
    c_uint32,
    c_void_p,
)
from enum import IntEnum
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from building import REPOSITORY
from c_library import OPTIONS, Converter, Library, compile_library, converter_of
from c_store import c_flash
from cut_flash import CutFlash
from link_talk import IDENTITY, Talk, derived_nonce

from tablegen.base.resources import c_link, c_runtime, c_store
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram, ScanProgram
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.synthesis import sine_periods
from tablegen.link.messages import AxisLimits
from tablegen.link.program_image import fast_of, make_image
from tablegen.link.store import Layout

HERE = Path(__file__).parent
LINES = REPOSITORY / "examples" / "firmware" / "cortex_m"
SANITIZED = ("-std=c99", "-O1", "-g", "-fsanitize=undefined,address", "-fno-sanitize-recover=all")
SLOW_KNOTS, SLOW_INDEX_BITS = 65, 7  # of every device with slow parts
TABLE_PIXELS = 16  # of every device with tables of pixels
_UNTIL_IDLE = 0xFFFFFFFF


class Line(NamedTuple):
    """A line that was played. ``crc`` is CRC-32 over x u32, y u32, markers u8 of every tick; ``markers`` are or-ed."""

    generation: int
    line: int
    ticks: int
    crc: int
    markers: int
    faults: int


class Listing(Structure):
    """A program of a device: ``dac_link_listing``."""

    _fields_ = (("name", c_char_p), ("hash", c_uint8 * 32))


class Started(IntEnum):
    """Why a link was not started: ``dac_link_started``."""

    STARTED = 0
    BAD_AXIS = 1
    BAD_FOURIER = 2
    BAD_KEY = 3
    NO_IDENTITY = 4
    NO_RANDOM = 5
    NO_CLOCK = 6
    BAD_SLOW = 7
    BAD_PIXEL_TABLE = 8
    BAD_Z = 9


class _Record(Structure):
    _fields_ = (
        *((name, c_uint32) for name in ("generation", "line", "ticks", "crc")),
        *((name, c_uint8) for name in ("markers", "faults")),
    )


class CompiledProgram(NamedTuple):
    """A program that comes with the firmware: its name and the digits of its hash."""

    name: bytes
    hash: bytes
    program: DualProgram


_Random = CFUNCTYPE(None, POINTER(c_uint8))


class _Setup(Structure):
    _fields_ = (
        ("x_converter", Converter),
        ("y_converter", Converter),
        ("x_limits", c_uint32 * 4),
        ("y_limits", c_uint32 * 4),
        *((name, c_uint8) for name in ("x_word_bits", "x_index_bits", "y_word_bits", "y_index_bits")),
        ("harmonics", c_uint16),
        ("sine_index_bits", c_uint8),
        ("window", c_uint8),
        ("update_rate_hz", c_uint32),
        ("key_bytes", c_uint8),
        ("key", c_uint8 * 32),
        ("knows_hash", c_uint8),
        ("hash", c_uint8 * 32),
        ("has_interlock", c_uint8),
        ("identity_bytes", c_uint8),
        ("identity", c_uint8 * 32),
        ("boot_persists", c_uint8),
        ("random", _Random),
        ("sine", POINTER(c_int32)),
        ("boot_program", c_void_p),
    )


def compile_device(
    path: Path,
    bits: int = 16,
    options: Sequence[str] = OPTIONS,
    compiler: Sequence[str] = ("gcc",),
    sources: Iterable[Path] | None = None,
    more: Sequence[str] = (),
) -> Path:
    """The device as a shared library; ``bits`` of storage, ``sources`` in place of the shipped runtime and link.

    ``options=SANITIZED`` needs the sanitizer's runtime in LD_PRELOAD of the process that loads it.
    """
    runtime = list(sources) if sources is not None else [*c_runtime(), *c_link()]
    probe = HERE / "link_device.c"
    return compile_library(
        path, bits, bits, compiler=compiler, options=options, runtime=runtime, more=[f"-I{LINES}", probe, *more]
    )


class DeviceLibrary(Library):
    """A compiled device."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.dll.device_new.restype = c_void_p
        for name in ("device_feed", "device_take", "device_records", "device_sizes"):
            getattr(self.dll, name).restype = c_size_t
        if hasattr(self.dll, "device_add_z"):
            self.dll.device_z_records.restype = c_size_t
            self.dll.device_apart.restype = self.dll.device_stops.restype = c_uint32
            self.dll.device_request.restype = c_bool
        self.dll.device_run.restype = self.dll.device_lost.restype = c_uint32
        self.dll.device_table.restype = c_int32
        if hasattr(self.dll, "device_play"):
            self.dll.device_play.restype = self.dll.device_list.restype = c_bool
            if hasattr(self.dll, "device_play_at"):
                self.dll.device_play_at.restype = c_bool
            self.dll.device_numbers.restype, self.dll.device_find.restype = c_uint32, c_int32
        assert self.dll.device_sizes(0) == ctypes.sizeof(_Record)
        assert self.dll.device_sizes(1) == ctypes.sizeof(_Setup)

    @property
    def ring(self) -> int:
        """Bytes that wait for the main loop."""
        return int(self.dll.device_sizes(3))


@cache
def device_library(
    bits: int = 16,
    shaping: int = 0,
    spline: bool = False,
    modes: bool = False,
    store: bool = False,
    moves: bool = False,
    slow: bool = False,
    pixels: bool = False,
    plays: bool = False,
    z: bool = False,
) -> DeviceLibrary:
    """The device as it ships, compiled once a process; for words of up to 16 bits, or of up to 24 (``bits=32``).

    ``shaping`` is its highest order; with ``modes`` a COMMIT has a mode, with ``store`` programs may be kept and played
    by number, with ``slow`` they may have slow parts, with ``pixels`` a table of pixels; one that ``moves`` takes MOVE,
    one that ``plays`` LIST and PLAY. It may have a second sequencer with ``z``.
    """
    folder = Path(tempfile.mkdtemp(prefix="link_device_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    more = [f"-DDAC_SHAPING={shaping}"] if shaping else []
    more += ["-DDAC_SPLINE=1"] if spline else []
    more += ["-DDAC_COMMIT_MODES=1"] if modes or moves else []
    more += ["-DDAC_MOVE=1"] if moves else []
    more += ["-DDAC_STORE=1"] if store else []
    more += [f"-DDAC_LIBRARY={1 + plays}"] if store or plays else []
    more += ["-DDAC_SLOW_PART=1"] if slow else []
    more += ["-DDAC_PIXEL_TABLE=1"] if pixels else []
    more += ["-DDAC_LINK_Z=1"] if z else []
    sources = [*c_runtime(), *c_link(), *(c_store() if store else [])]
    return DeviceLibrary(compile_device(folder / "device.so", bits, sources=sources, more=more))


def widest(output: Output) -> AxisLimits:
    """Limits that let every program of a converter pass."""
    return AxisLimits(0, (1 << output.dac_bits) - 1, (1 << 24) - 1, (1 << 24) - 1)


class HostDevice:
    """A device whose converters are those of ``like`` and which boots into ``boot``, if that is not None.

    ``index_bits`` of the longest tables of x and y default to those of ``like``, ``limits`` to all that its converters
    can do, ``library`` to that of ``device_library`` with the order ``shaping``, ``modes`` of a COMMIT, or ``moves``,
    ``slow`` parts, tables of ``pixels``, and LIST and PLAY where it ``plays``. Nonces are those of ``derived_nonce``,
    changed by what ``random`` gives, or ``nonces``; ``started`` is why the link was not.
    ``permits`` is the input of the interlock, if it has one. It keeps programs in ``flash``, with a layout; its library
    has the programs ``compiled``. A second sequencer, whose x is z, is like ``z``, and boots into ``z_boot``.
    """

    def __init__(
        self,
        like: ScanProgram,
        boot: ScanProgram | None = None,
        *,
        library: DeviceLibrary | None = None,
        limits: tuple[AxisLimits, AxisLimits] | None = None,
        index_bits: tuple[int, int] | None = None,
        harmonics: int = 64,
        window: int = 0,
        update_rate_hz: int = 0,
        key: bytes = b"",
        boot_hash: bytes | None = None,
        interlock: bool = False,
        boot_count: int = 0,
        power_up: tuple[int, int] = (0, 0),
        nonces: Callable[[], bytes] | None = None,
        identity: bytes = IDENTITY,
        random: Callable[[], bytes] | None = None,
        boot_persists: bool = True,
        shaping: int = 0,
        modes: bool = False,
        moves: bool = False,
        slow: bool = False,
        pixels: bool = False,
        plays: bool = False,
        flash: tuple[CutFlash, Layout] | None = None,
        stores_while_playing: bool = False,
        compiled: Sequence[CompiledProgram] = (),
        z: ScanProgram | None = None,
        z_boot: ScanProgram | None = None,
        z_limits: tuple[AxisLimits, AxisLimits] | None = None,
    ) -> None:
        x, y = fast_of(like.x), fast_of(like.y)
        tables = [x, y] if z is None else [x, y, fast_of(z.x), fast_of(z.y)]
        bits = 16 if max(max(table.bits, table.output.word_bits) for table in tables) <= 16 else 32
        spline, store = "cubic" in (table.mode for table in tables), flash is not None
        self.library = library or device_library(
            bits, shaping, spline, modes, store, moves, slow, pixels, plays, z is not None
        )
        self._dll = self.library.dll
        self.boot_count = boot_count
        self._permits = True
        self._boot = boot
        self.notes: list[str] | None = None
        x_limits, y_limits = limits or (widest(like.x.output), widest(like.y.output))
        x_index, y_index = index_bits or (x.index_bits, y.index_bits)
        sine_bits = max(x_index, y_index, 3)
        sine = sine_periods(sine_bits)
        self._sine = (c_int32 * len(sine))(*sine.tolist())
        setup = _Setup(
            x_converter=converter_of(like.x.output, power_up[0]),
            y_converter=converter_of(like.y.output, power_up[1]),
            x_limits=_four(x_limits),
            y_limits=_four(y_limits),
            x_word_bits=x.bits,
            x_index_bits=x_index,
            y_word_bits=y.bits,
            y_index_bits=y_index,
            harmonics=harmonics,
            sine_index_bits=sine_bits,
            window=window,
            update_rate_hz=update_rate_hz,
            key_bytes=len(key),
            knows_hash=boot_hash is not None,
            has_interlock=interlock,
            sine=self._sine,
        )
        setup.key[: len(key)] = key
        if boot_hash is not None:
            setup.hash[:] = boot_hash
        if boot is not None:
            self._boot_program, self._axes = self.library.program(boot)
            setup.boot_program = ctypes.addressof(self._boot_program)
        setup.identity_bytes, setup.boot_persists = len(identity), boot_persists
        setup.identity[: len(identity)] = identity
        if nonces is not None:
            counter = count(1)  # of this boot: what makes the wanted nonce of the derived one

            def random() -> bytes:
                derived = derived_nonce(key, self.boot_count, next(counter), identity)
                return bytes(a ^ b for a, b in zip(derived, nonces(), strict=True))

        if random is not None:
            self._random = setup.random = _Random(lambda to: ctypes.memmove(to, random(), 16))
        self._setup = setup
        self._device = c_void_p(self._dll.device_new(ctypes.byref(setup), c_uint32(boot_count)))
        self._layout, self._while_playing = None if flash is None else flash[1], stores_while_playing
        if flash is not None:
            self._flash = c_flash(*flash)
            self._dll.device_keep(self._device, ctypes.byref(self._flash), c_bool(stores_while_playing))
        self.started = Started(self._dll.device_started(self._device))
        if z is not None:
            self.started = self._add_z(z, z_boot, z_limits)
        self._compiled = [(*each, self.library.program(each.program)) for each in compiled]
        for name, digest, _, (program, _) in self._compiled:
            self._dll.device_compile(self._device, c_char_p(name), c_char_p(digest), ctypes.byref(program))

    def _add_z(
        self, like: ScanProgram, boot: ScanProgram | None, limits: tuple[AxisLimits, AxisLimits] | None
    ) -> Started:
        """Give it a second sequencer with the converters of ``like``."""
        x, y = fast_of(like.x), fast_of(like.y)
        x_limits, y_limits = limits or (widest(like.x.output), widest(like.y.output))
        setup = _Setup(
            x_converter=converter_of(like.x.output, 0),
            y_converter=converter_of(like.y.output, 0),
            x_limits=_four(x_limits),
            y_limits=_four(y_limits),
            x_word_bits=x.bits,
            x_index_bits=x.index_bits,
            y_word_bits=y.bits,
            y_index_bits=y.index_bits,
        )
        if boot is not None:
            self._z_boot_program, self._z_axes = self.library.program(boot)
            setup.boot_program = ctypes.addressof(self._z_boot_program)
        return Started(self._dll.device_add_z(self._device, ctypes.byref(setup), c_bool(boot is not None)))

    def z_lines(self) -> list[Line]:
        """The lines of the second sequencer that ended since the last call."""
        return self._records(self._dll.device_z_records)

    @property
    def apart(self) -> int:
        """Ticks since the start on which the markers of z were not those of x and y, or z did not rest."""
        return int(self._dll.device_apart(self._device))

    @property
    def stops(self) -> int:
        """How often the link has stopped the ticks of a device of this library."""
        return int(self._dll.device_stops())

    def request(self, name: str, frames: int = 0) -> bool:
        """The application parks, arms or triggers both sequencers."""
        number = ("park", "arm", "trigger").index(name)
        return bool(self._dll.device_request(self._device, c_uint32(number), c_uint32(frames)))

    def z_refusal(self, fault: int) -> Started:
        """Why a link gets no z whose configuration has a fault; 0 is none."""
        return Started(self._dll.device_z_refusal(self._device, c_uint32(fault)))

    def __del__(self) -> None:
        if hasattr(self, "_device"):
            self._dll.device_delete(self._device)

    def receive(self, data: bytes) -> None:
        """Bytes from the line, each of them with time enough for the main loop."""
        for at in range(0, len(data), 256):
            part = data[at : at + 256]
            assert self._feed(part) == len(part)
            self._work()
            self._note(f"r {part.hex()}")

    def feed(self, data: bytes) -> int:
        """Bytes from the line while the main loop is elsewhere; returns how many the ring had room for."""
        self._note(f"f {data.hex()}")
        return self._feed(data)

    def work(self, most: int = _UNTIL_IDLE) -> int:
        """The main loop, until it has nothing to do or has gone round so often; returns how often."""
        self._note(f"w {most}")
        return self._work(most)

    def stall(self, stalled: bool) -> None:
        """Whether nothing can leave."""
        self._note(f"s {int(stalled)}")
        self._dll.device_stall(self._device, c_bool(stalled))

    def _feed(self, data: bytes) -> int:
        return int(self._dll.device_feed(self._device, data, c_size_t(len(data))))

    def _work(self, most: int = _UNTIL_IDLE) -> int:
        return int(self._dll.device_run(self._device, c_uint32(most)))

    def _note(self, what: str) -> None:
        if self.notes is not None:
            self.notes.append(what)

    def take_notes(self) -> None:
        """From now on write down what is done with the device, in ``notes``, as ``link_replay.c`` reads it."""
        setup = self._setup
        numbers: list[int] = []
        for name, *_ in _Setup._fields_[:-3]:
            value = getattr(setup, name)
            fields = [getattr(value, each) for each, *_ in value._fields_] if isinstance(value, Structure) else value
            numbers += [fields] if isinstance(fields, int) else list(fields)
        self.notes = [
            " ".join(map(str, ["S", *map(int, numbers), self.boot_count])),
            " ".join(map(str, ["Q", *self._sine])),
        ]
        # In front of the program of the boot, while nothing waits for a tick.
        for name, digest, program, _ in self._compiled:
            self.notes.append(f"N {name.decode()}")
            talk = Talk()
            upload = b"".join([talk.hello(), *talk.upload(make_image(program, digest.decode()))])
            self.notes.append(f"L {upload.hex()}")
        if self._boot is not None:
            talk = Talk()
            upload = b"".join([talk.hello(), *talk.upload(make_image(self._boot, bytes(32).hex()))])
            self.notes.append(f"B {upload.hex()}")
        if self._layout is not None:
            layout = self._layout
            numbers = [layout.base, layout.sector_bytes, layout.place_sectors, layout.slots, self._while_playing]
            self.notes.append(" ".join(map(str, ["F", *map(int, numbers)])))

    def transmit(self) -> bytes:
        """What has left since the last call."""
        buffer = ctypes.create_string_buffer(max(int(self._dll.device_take(self._device, None)), 1))
        count = int(self._dll.device_take(self._device, buffer))
        return buffer.raw[:count]

    def tick(self, ticks: int = 1, work: int = _UNTIL_IDLE) -> None:
        """So many samples, after each of them the main loop."""
        self._note(f"t {ticks} {work}")
        self._dll.device_tick(self._device, c_uint32(ticks), c_uint32(work))

    def refuse_slow(self) -> None:
        """Leave no memory for slow parts to the link."""
        self._dll.device_refuse_slow(self._device)

    def played(self, ticks: int) -> dict[str, Any]:
        """Words of x, y and z, and the markers of both sequencers, of so many samples from now on; uint32 each."""
        names = ("x", "y", "z", "markers", "z_markers")
        records = np.zeros((ticks, len(names)), dtype=np.uint32)
        self._dll.device_watch(self._device, records.ctypes.data_as(c_void_p))
        self.tick(ticks)
        self._dll.device_watch(self._device, None)
        return dict(zip(names, records.T, strict=True))

    def take_requests(self) -> None:
        """The requests that wait act, and no tick follows."""
        self._dll.device_answer(self._device)

    def lines(self) -> list[Line]:
        """The lines that ended since the last call."""
        return self._records(self._dll.device_records)

    def _records(self, take: Any) -> list[Line]:
        count = int(take(self._device, None))
        records = (_Record * max(count, 1))()
        take(self._device, records)
        return [Line(*(getattr(record, name) for name in Line._fields)) for record in records[:count]]

    def refusal(self, fault: int) -> Started:
        """Why a link does not start that has a fault in its configuration; 0 is none."""
        return Started(self._dll.device_refusal(self._device, c_uint32(fault)))

    def set_clock(self, milliseconds: int) -> None:
        """The time of all devices of the library."""
        self._note(f"c {milliseconds}")
        self._dll.device_set_clock(c_uint32(milliseconds))

    def reboot(self) -> None:
        """Reset: nothing is left but what is in the firmware, and the next boot count."""
        self.boot_count = (self.boot_count + 1) & 0xFFFFFFFF
        self._note(f"b {self.boot_count}")
        self._dll.device_start(self._device, c_uint32(self.boot_count))

    def poke(self, axis: int, word: int, value: int) -> None:
        """Damage a word of the upload in hand: of its table, or of its Fourier words."""
        self._note(f"k {axis} {word} {value}")
        self._dll.device_poke(self._device, axis, c_uint32(word), c_int32(value))

    @property
    def permits(self) -> bool:
        """The input of the interlock."""
        return self._permits

    @permits.setter
    def permits(self, permits: bool) -> None:
        self._permits = permits
        self._note(f"p {int(permits)}")
        self._dll.device_permit(self._device, c_bool(permits))

    def play(self, number: int, mode: CommitMode = CommitMode.LINE) -> bool:
        """The application plays a program of the device; whether it is on its way. Other modes have no note."""
        if mode is CommitMode.LINE:
            begun = bool(self._dll.device_play(self._device, c_uint32(number)))
        else:
            begun = bool(self._dll.device_play_at(self._device, c_uint32(number), c_uint32(mode)))
        self._work()
        self._note(f"P {number}")
        return begun

    def numbers(self) -> int:
        """How many compiled programs and slots there are."""
        return int(self._dll.device_numbers(self._device))

    def listing(self, number: int) -> tuple[str | None, str] | None:
        """Name and hash of a program; None for a number without one."""
        listing = Listing()
        if not self._dll.device_list(self._device, c_uint32(number), ctypes.byref(listing)):
            return None
        return None if listing.name is None else listing.name.decode(), bytes(listing.hash).hex()

    def find(self, name: str) -> int:
        """The number of a program by its name, or by the first digits of its hash; -1 for none."""
        return int(self._dll.device_find(self._device, c_char_p(name.encode())))

    def report(self, fault: int) -> None:
        """A fault that the driver of the converters saw."""
        self._dll.device_report(self._device, c_uint8(fault))

    @property
    def lost(self) -> int:
        """Bytes that the ring had no room for."""
        return int(self._dll.device_lost(self._device))


def _four(limits: AxisLimits) -> Any:
    return (c_uint32 * 4)(*np.array([limits.code_min, limits.code_max, limits.max_step, limits.max_jump]).tolist())
