"""The registers of dac_axi_lite and dac_wishbone over the integer model: what an access gives, and what it does.

It has no clock: ticks come between accesses, and all that a sequencer does on a tick is done before the next access.
Tables are uploaded; what is rendered is not modelled.
"""

import sys
from dataclasses import dataclass, field

from building import REPOSITORY

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import program_words
from tablegen.device.sequencer import Sequencer, can_keep
from tablegen.verification.play.sequencer_shape import SequencerShape

BUS = REPOSITORY / "firmware_templates" / "verilog" / "bus"
sys.path.insert(0, str(BUS))
import make_registers  # noqa: E402

REGIONS = {
    "program": 0, "x_table": 1, "y_table": 2, "x_fourier": 3, "y_fourier": 4, "x_slow": 5, "y_slow": 6, "pixel_ticks": 7
}  # fmt: skip
PROGRAM_WORDS = 38
PART_BITS = 13  # of the number of a word within a part of a slow part
CAN_KEEP = 1 << 10
COMMANDS = ("commit", "withdraw", "trigger", "park", "clear_faults")
EVENTS = ("writable", "committed", "stopped", "fault", "refused")
UNDERRUN = 3
MAP = make_registers.read_map()
ADDRESSES = {one.name: one.address for one in (*MAP.registers, *MAP.memories)}
_REGISTERS = {one.address: one for one in MAP.registers}


@dataclass(frozen=True)
class Shape:
    """The parameters of the bench that a host can see."""

    dac_bits: int = 16
    index_bits: int = 5
    word_bits: int = 16
    harmonics: int = 5
    fourier: int = 1
    count_bits: int = 5
    commit_modes: int = 1
    pixel_index_bits: int = 4
    slow_index_bits: int = 0  # 0: no slow part

    @property
    def lengths(self) -> dict[str, int]:
        """The words that each memory has."""
        table, fourier = 1 << self.index_bits, self.fourier * (2 * self.harmonics + 1)
        pixels = 1 << self.pixel_index_bits if self.pixel_index_bits else 0
        tables = {"x_table": table, "y_table": table, "x_fourier": fourier, "y_fourier": fourier}
        return {"program": 48, **tables, "pixel_ticks": pixels, "x_slow": 0, "y_slow": 0}

    def has(self, name: str, word: int) -> bool:
        """Whether a memory has a word; the parts of a slow part have gaps between them."""
        if name not in ("x_slow", "y_slow") or not self.slow_index_bits:
            return word < self.lengths[name]
        part, place = divmod(word, 1 << PART_BITS)
        return part < 4 and place < (1 << self.index_bits, 1 << self.slow_index_bits, 65, 65)[part]


SHAPE = Shape()
SEQUENCER = SequencerShape(SHAPE.dac_bits, 1, SHAPE.index_bits, SHAPE.word_bits, 1, SHAPE.index_bits, SHAPE.word_bits)


def bits(values: dict[str, object], names: tuple[str, ...]) -> int:
    """The bits of these names that are true, the first one the lowest."""
    return sum(bool(values.get(name)) << at for at, name in enumerate(names))


@dataclass
class BusModel:
    """What a master may know: ``host`` are the lines of host.txt, ``ticks`` those of ticks.txt."""

    shape: Shape
    sequencer: Sequencer = field(default_factory=lambda: Sequencer(None))
    host: list[str] = field(default_factory=list)
    ticks: list[str] = field(default_factory=list)
    ready: DualProgram | None = None  # stands in the idle bank, whole
    written: int = 0  # program words since the last swap
    refused: bool = False
    clears: bool = False
    underruns: int = 0
    pending: int = 0
    enabled: int = 0
    playing: bool = False
    parked: bool = False

    @property
    def writable(self) -> bool:
        return self.sequencer.idle is None

    @property
    def interrupt(self) -> int:
        return int(self.pending & self.enabled != 0)

    @property
    def may_commit(self) -> bool:
        """Whether the model knows what becomes of a commit."""
        return self.ready is not None or self.written < PROGRAM_WORDS or not self.writable

    def faults(self) -> int:
        return int(self.sequencer.faults) | (self.underruns > 0) << UNDERRUN

    def known(self, address: int) -> int:
        """The bits of a read that the model knows: whether the idle program can keep the frame only if it is whole."""
        keeps = self.sequencer.playing is not None and (self.ready is not None or not self.writable)
        return -1 if keeps or address != ADDRESSES["status"] else ~CAN_KEEP

    def read(self, address: int) -> int | None:
        """What a read gives; None if it fails."""
        register = _REGISTERS.get(address)
        if register is None or not register.readable:
            return None
        return self._value(register.name)

    def _value(self, name: str) -> int:
        shape, model, most = self.shape, self.sequencer, (1 << self.shape.count_bits) - 1
        counts = [*model.fault_counts.values(), 0, self.underruns]
        table = 1 | shape.index_bits << 8 | shape.word_bits << 16
        status = (self.writable, not self.writable, self.refused, model.armed, model.running, self.playing, self.parked)
        values = {
            "identity": int.from_bytes(b"TBLG", "big"),
            "version": 1,
            "features": shape.dac_bits
            | shape.fourier << 12
            | shape.commit_modes << 13
            | (shape.slow_index_bits > 0) << 14
            | shape.fourier * shape.harmonics << 16,
            "memory_shape": shape.pixel_index_bits | shape.slow_index_bits << 8,
            "x_shape": table,
            "y_shape": table,
            "status": sum(bool(bit) << at for at, bit in enumerate(status)) | self._can_keep(),
            "faults": self.faults(),
            "interrupt_pending": self.pending,
            "interrupt_enable": self.enabled,
        }
        for at, fault in enumerate(("slew", "clamp", "overrun", "underrun")):
            values[f"{fault}_count"] = min(counts[at], most)
        return values[name]

    def _can_keep(self) -> int:
        playing, idle = self.sequencer.playing, self.ready or self.sequencer.idle
        known = self.shape.commit_modes and playing is not None and idle is not None
        return CAN_KEEP if known and can_keep(playing, idle) else 0

    def write(self, address: int, data: int, strobes: int = 15) -> bool:
        """Do what a write does; False if it fails."""
        if strobes != 15:
            return False
        for memory in MAP.memories:
            offset = address - memory.address
            if 0 <= offset < 4 * memory.words and offset % 4 == 0 and self.shape.has(memory.name, offset // 4):
                return self._write_word(memory.name, offset // 4, data)
        register = _REGISTERS.get(address)
        if register is None or not register.writable or data & ~register.mask:
            return False
        before = self._levels()
        if register.name == "command":
            mode = data >> 8
            if (data & 1 and not self.writable) or mode == 3 or (mode and not self.shape.commit_modes):
                return False
            self._request(data)
        elif register.name == "arm":
            self.sequencer.arm(data)
            self.host.append(f"a {data}")
        elif register.name == "interrupt_pending":
            self.pending &= ~data
        else:
            self.enabled = data
        self._events(before)
        return True

    def _write_word(self, name: str, word: int, data: int) -> bool:
        if not self.writable:
            return False
        if name in ("x_slow", "y_slow"):
            part, place = divmod(word, 1 << PART_BITS)
            self.host.append(f"w {REGIONS[name]} {part << 14 | place} {data}")
        else:
            self.host.append(f"w {REGIONS[name]} {word} {data}")
        self.ready = None
        self.written += name == "program" and word % 16 < (14 if word < 16 else 12)
        return True

    def _request(self, data: int) -> None:
        mode = CommitMode(data >> 8)
        if data & 31:
            self.host.append(f"r {data & 31:05b} {mode * (data & 1)}")
        asked = {name for at, name in enumerate(COMMANDS) if data >> at & 1}
        if "withdraw" in asked:
            self.sequencer.withdraw()
        if "trigger" in asked:
            self.sequencer.trigger()
        if "park" in asked:
            self.sequencer.park()
        if "clear_faults" in asked:
            self.clears, self.refused = True, False
        if "withdraw" in asked:
            self.ready = None
        elif "commit" in asked:
            self._commit(mode)

    def _commit(self, mode: CommitMode) -> None:
        if self.ready is not None:
            self.sequencer.commit(self.ready, mode)
        else:
            assert self.written < PROGRAM_WORDS
            self.pending |= bits({"refused": not self.refused, "writable": True}, EVENTS)
            self.refused = True

    def _levels(self) -> tuple[bool, bool, int]:
        return self.writable, self.sequencer.running, self.faults()

    def _events(self, before: tuple[bool, bool, int]) -> None:
        writable, running, faults = before
        new = {
            "writable": self.writable and not writable,
            "committed": writable and not self.writable,
            "stopped": running and not self.sequencer.running,
            "fault": self.faults() & ~faults,
        }
        self.pending |= bits(new, EVENTS)

    def underrun(self) -> None:
        """An output has missed a sample."""
        before = self._levels()
        self.underruns += 1
        self._events(before)

    def tick(self) -> None:
        """A tick, and its strobe."""
        before = self._levels()
        if self.clears:
            self.sequencer.clear_faults()
            self.clears, self.underruns = False, 0
        tick = self.sequencer.step()
        if tick.swapped:
            self.ready, self.written = None, 0
        self.playing, self.parked = tick.playing, tick.parked
        marks = (tick.line, tick.frame, tick.pixel, tick.backward, tick.valid and not self.underruns, tick.swapped)
        text = "".join(str(int(mark)) for mark in (*marks, tick.playing, tick.parked))
        self.ticks.append(f"{tick.x} {tick.y} {text}")
        self._events(before)

    def reset(self) -> None:
        """A reset of the bus."""
        self.pending = self.enabled = 0


def upload(program: DualProgram) -> list[tuple[int, int]]:
    """The addresses and words of a program whose tables are uploaded."""
    words = [(ADDRESSES["program"] + 4 * at, word) for at, word in enumerate(flat_words(program))]
    for axis in ("x", "y"):
        table = getattr(program, axis).words
        words += [(ADDRESSES[f"{axis}_table"] + 4 * at, int(word) & 0xFFFFFFFF) for at, word in enumerate(table)]
    pixels = [ticks for window in program.schedule.pixel_table or () for ticks in window]
    return words + [(ADDRESSES["pixel_ticks"] + 4 * at, ticks) for at, ticks in enumerate(pixels)]


def flat_words(program: DualProgram, harmonics: tuple[int, int] = (0, 0)) -> list[int]:
    """The 48 program words."""
    return program_words(program.schedule, program.x, program.y, harmonics)
