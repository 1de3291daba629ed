"""Keep programs in flash: the specification of ``dac_store.c``, equal to it on every operation of the flash."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Protocol

from tablegen.link.messages import ImageInfo
from tablegen.link.program_image import ProgramImage

RECORDS = 3  # sectors of records
SLOTS = 15  # at most
NONE = 255  # no slot: the program of the firmware
LINE = 32  # bytes of a write
HEADER = 64  # bytes in front of the image in its place
INFO = 48  # bytes of the announcement of an image
_RECORD_MAGIC, _PLACE_MAGIC = 0x31525354, 0x31505354
_RECORD = struct.Struct("<II4B16s")


class Flash(Protocol):
    """Flash of equal sectors. An erased byte reads as 0xFF; a line is written once after an erase."""

    def erase(self, address: int) -> bool:
        """Erase the sector that begins at an address; return whether that succeeded."""

    def write(self, address: int, line: bytes) -> bool:
        """Write a line of 32 bytes; return whether that succeeded."""

    def read(self, address: int, count: int) -> bytes | None:
        """Return bytes, or None if they cannot be read."""


class StoreFault(IntEnum):
    """Why a store does not do what was requested: ``dac_store_result``."""

    NO_SLOT = 2
    TOO_LONG = 3
    BAD_IMAGE = 4
    NO_TRIAL = 5
    FAILED = 6


class StoreError(Exception):
    """Report that the store does not do what was requested; the message says why."""

    def __init__(self, fault: StoreFault, message: str) -> None:
        super().__init__(message)
        self.fault = fault


@dataclass(frozen=True, slots=True)
class Layout:
    """The places in flash: records at ``base``, then a place more than there are slots.

    Attributes
    ----------
    base
        Address of the first sector.
    sector_bytes
        Bytes of a sector, a multiple of 32, at least 64.
    place_sectors
        Sectors of a place, which has room for an image and 64 bytes.
    slots
        Slots, 1 to 15.
    """

    base: int
    sector_bytes: int
    place_sectors: int
    slots: int

    def record(self, sector: int) -> int:
        """Return the address of a record."""
        return self.base + sector * self.sector_bytes

    def place(self, place: int) -> int:
        """Return the address of a place."""
        return self.record(RECORDS + place * self.place_sectors)

    @property
    def room(self) -> int:
        """The bytes of the largest image."""
        return self.place_sectors * self.sector_bytes - HEADER


@dataclass(frozen=True, slots=True)
class State:
    """The content of a record.

    Attributes
    ----------
    counter
        Number of the record; the largest counts.
    selected, trial
        Slots, or ``NONE``.
    started
        1 if the trial has been started, otherwise 0.
    places
        The place of each of 16 slots, or ``NONE``.
    """

    counter: int = 0
    selected: int = NONE
    trial: int = NONE
    started: int = 0
    places: bytes = bytes([NONE]) * (SLOTS + 1)

    def pack(self) -> bytes:
        """Return the 32 bytes of the record."""
        body = _RECORD.pack(_RECORD_MAGIC, self.counter, self.selected, self.trial, self.started, 0, self.places)
        return body + struct.pack("<I", zlib.crc32(body))

    @classmethod
    def unpack(cls, line: bytes | None) -> "State | None":
        """Return the state of a record, or None if it is not valid."""
        if line is None or struct.unpack("<I", line[28:])[0] != zlib.crc32(line[:28]):
            return None
        magic, counter, selected, trial, started, _, places = _RECORD.unpack(line[:28])
        return cls(counter, selected, trial, started, places) if magic == _RECORD_MAGIC else None


class Store:
    """The kept programs of a device, from a start on."""

    def __init__(self, flash: Flash, layout: Layout) -> None:
        """Read the state; nothing is written."""
        self.flash, self.layout = flash, layout
        self.state = State()
        self.sector = NONE
        self.certain = False
        for sector in range(RECORDS):
            state = State.unpack(flash.read(layout.record(sector), LINE))
            if state and (self.sector == NONE or state.counter > self.state.counter):
                self.state, self.sector = state, sector

    def start(self) -> int:
        """Return the slot to play after a start, or ``NONE``; a trial is started once."""
        if self.state.trial != NONE:
            first = not self.state.started and self.info(self.state.trial) is not None
            state = replace(self.state, started=1, trial=self.state.trial if first else NONE)
            try:
                self._change(state)
            except StoreError:
                first = False
            if first:
                return state.trial
        return self.state.selected if self.info(self.state.selected) is not None else NONE

    def save(self, slot: int, image: ProgramImage) -> None:
        """Keep an image in a slot, in place of what the slot has.

        Raises
        ------
        StoreError
            If there is no such slot or no room, the CRC is not that of the image, or flash failed.
        """
        if slot >= self.layout.slots:
            raise StoreError(StoreFault.NO_SLOT, f"slot {slot}; the store has slots 0 to {self.layout.slots - 1}")
        if len(image.data) > self.layout.room:
            message = f"an image of {len(image.data)} bytes; a place has room for {self.layout.room}"
            raise StoreError(StoreFault.TOO_LONG, message)
        self._make_certain()
        place = next(place for place in range(SLOTS + 1) if place not in self.state.places[: self.layout.slots])
        address = self.layout.place(place)
        info = image.info.pack()
        body = struct.pack("<II", _PLACE_MAGIC, slot) + info + struct.pack("<I", self.state.counter)
        header = body + struct.pack("<I", zlib.crc32(body))
        for sector in range(self.layout.place_sectors):
            self._require(self.flash.erase(address + sector * self.layout.sector_bytes))
        for at in range(0, len(image.data), LINE):
            self._write(address + HEADER + at, image.data[at : at + LINE].ljust(LINE, b"\xff"))
        for at in (0, LINE):
            self._write(address + at, header[at : at + LINE])
        if self._good_place(place, slot) is None:
            raise StoreError(StoreFault.BAD_IMAGE, "the bytes of the image do not have its CRC")
        self._change(self._with_place(slot, place))

    def select(self, slot: int, trial: bool = False) -> None:
        """Choose the slot that plays after a start; with ``trial`` only once, until it is confirmed.

        Raises
        ------
        StoreError
            If the slot is empty, or flash failed.
        """
        if (slot != NONE or trial) and self.info(slot) is None:
            raise StoreError(StoreFault.NO_SLOT, f"nothing is kept in slot {slot}")
        if trial:
            self._change(replace(self.state, trial=slot, started=0))
        else:
            self._change(replace(self.state, selected=slot, trial=NONE, started=0))

    def confirm(self) -> None:
        """Select the trial that was started.

        Raises
        ------
        StoreError
            If there is none, or flash failed.
        """
        if self.state.trial == NONE or not self.state.started:
            raise StoreError(StoreFault.NO_TRIAL, "no trial has been started")
        self._change(replace(self.state, selected=self.state.trial, trial=NONE, started=0))

    def delete(self, slot: int) -> None:
        """Empty a slot; where it was selected, the program of the firmware is.

        Raises
        ------
        StoreError
            If it is empty, or flash failed.
        """
        if self._place(slot) == NONE:
            raise StoreError(StoreFault.NO_SLOT, f"nothing is kept in slot {slot}")
        state = self._with_place(slot, NONE)
        selected, trial = (NONE if each == slot else each for each in (state.selected, state.trial))
        self._change(replace(state, selected=selected, trial=trial))

    def info(self, slot: int) -> bytes | None:
        """Return the announcement of the image of a slot, 48 bytes, or None without an image of the right CRC."""
        place = self._place(slot)
        return None if place == NONE else self._good_place(place, slot)

    def image(self, slot: int) -> ProgramImage | None:
        """Return the image of a slot, or None without an image of the right CRC."""
        announcement = self.info(slot)
        if announcement is None:
            return None
        info = ImageInfo.unpack(announcement)
        address = self.layout.place(self._place(slot)) + HEADER
        return ProgramImage(info, b"".join(self._lines(address, info.image_bytes)))

    def holds(self, slot: int) -> bool:
        """Return True if a slot has an image, which may be damaged."""
        return self._place(slot) != NONE

    def _lines(self, address: int, size: int) -> Iterator[bytes]:
        for at in range(0, size, LINE):
            line = self.flash.read(address + at, min(LINE, size - at))
            self._require(line is not None)
            yield line or b""

    def _place(self, slot: int) -> int:
        place = self.state.places[slot] if slot < self.layout.slots else NONE
        return place if place <= self.layout.slots else NONE

    def _with_place(self, slot: int, place: int) -> State:
        places = bytearray(self.state.places)
        places[slot] = place
        return replace(self.state, places=bytes(places))

    def _good_place(self, place: int, slot: int) -> bytes | None:
        address = self.layout.place(place)
        header = self.flash.read(address, HEADER)
        if header is None or struct.unpack("<II", header[:8]) != (_PLACE_MAGIC, slot):
            return None
        if struct.unpack("<I", header[60:])[0] != zlib.crc32(header[:60]):
            return None
        info = header[8 : 8 + INFO]
        size, image_crc = struct.unpack("<II", info[32:40])
        if size > self.layout.room:
            return None
        crc = 0
        for at in range(0, size, LINE):
            line = self.flash.read(address + HEADER + at, min(LINE, size - at))
            if line is None:
                return None
            crc = zlib.crc32(line, crc)
        return info if crc == image_crc else None

    def _require(self, success: bool) -> None:
        if not success:
            message = "the flash was not erased, or not written, or reads otherwise than it was written"
            raise StoreError(StoreFault.FAILED, message)

    def _write(self, address: int, line: bytes) -> None:
        self._require(self.flash.write(address, line) and self.flash.read(address, LINE) == line)

    def _write_record(self, sector: int, state: State) -> None:
        self.certain = False
        self._require(self.flash.erase(self.layout.record(sector)))
        self._write(self.layout.record(sector), state.pack())
        self.state, self.sector, self.certain = state, sector, True

    def _oldest(self) -> int:
        """Return the sector for a copy of the record, of those without it the one of the lowest counter."""
        counters = {}
        for sector in range(RECORDS):
            if sector != self.sector:
                state = State.unpack(self.flash.read(self.layout.record(sector), LINE))
                counters[sector] = state.counter if state else 0
        return min(counters, key=lambda sector: counters[sector])

    def _make_certain(self) -> None:
        """Write the record again, and erase all others, before the first change after a start."""
        if self.certain:
            return
        self._write_record(self._oldest(), replace(self.state, counter=self.state.counter + 2))
        for sector in range(RECORDS):
            if sector != self.sector and not self.flash.erase(self.layout.record(sector)):
                self.certain = False
                self._require(False)

    def _change(self, state: State) -> None:
        """Make a change, by one record."""
        self._make_certain()
        self._write_record((self.sector + 1) % RECORDS, replace(state, counter=self.state.counter + 1))
