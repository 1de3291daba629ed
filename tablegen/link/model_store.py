"""The kept programs of a device as docs/protocol.md has them: what a start begins with, and the requests about them."""

import struct
from collections.abc import Callable

from tablegen.device.dual_program import ScanProgram
from tablegen.link.messages import NO_SLOT, STORES_WHILE_PLAYING, DeviceState, Reason, SlotContent, StoreStatus
from tablegen.link.model_bank import Bank, RequestRefused
from tablegen.link.players import Player
from tablegen.link.program_image import ProgramImage
from tablegen.link.store import Store, StoreError, StoreFault


class ModelStore:
    """The kept programs of a device, from a start on.

    Parameters
    ----------
    store
        The store, opened at this start.
    bank, player
        The memory and the sequencer of the device.
    while_playing
        Whether flash can be written while a scan plays.
    """

    def __init__(self, store: Store, bank: Bank, player: Player, while_playing: bool) -> None:
        self._store, self._bank, self._player, self._while_playing = store, bank, player, while_playing
        self._start, self._reason = NO_SLOT, 0

    def load(self) -> ScanProgram | None:
        """Return the program that is due at a start, or None for that of the firmware."""
        store = self._store
        state = store.state
        due = state.trial if state.trial != NO_SLOT and not state.started else state.selected
        slot = store.start()
        if slot != due:
            self._reason = Reason.IMAGE if store.info(due) is None else Reason.FLASH
        program = self._load(slot)
        return self._load(store.state.selected) if program is None and slot != store.state.selected else program

    def _load(self, slot: int) -> ScanProgram | None:
        image = self._store.image(slot)
        if image is None:
            return None
        try:
            program = self._bank.load(image)
        except RequestRefused as refused:
            self._reason = self._reason or refused.reason
            return None
        self._start = slot
        return program

    def image(self, slot: int) -> ProgramImage | None:
        """Return the image of a slot, if it has one."""
        return self._store.image(slot)

    def slot(self, payload: bytes) -> bytes:
        """Return the answer to SLOT.

        Raises
        ------
        RequestRefused
            If there is no such slot.
        """
        (slot,) = payload
        store, state = self._store, self._store.state
        if slot != NO_SLOT and slot >= store.layout.slots:
            raise self._no_slot()
        info = store.info(slot)
        content = (
            SlotContent.EMPTY if not store.holds(slot) else SlotContent.DAMAGED if info is None else SlotContent.PROGRAM
        )
        flags = STORES_WHILE_PLAYING if self._while_playing else 0
        head = (store.layout.slots, state.selected, state.trial, state.started, self._start, self._reason)
        return StoreStatus(*head, content, flags, store.layout.room).pack() + (info or b"")

    def save(self, payload: bytes) -> bytes:
        """Answer SAVE: keep the active program.

        Raises
        ------
        RequestRefused
            If it cannot be kept.
        """
        slot, generation = struct.unpack_from("<BI", payload)
        self._check_state()
        if slot >= self._store.layout.slots:
            raise self._no_slot()
        image = self._bank.image()
        if generation != self._player.swaps:
            raise RequestRefused(Reason.GENERATION, self._player.swaps)
        self._change(lambda: self._store.save(slot, image))
        self._forget(slot)
        return b""

    def select(self, payload: bytes) -> bytes:
        """Answer SELECT.

        Raises
        ------
        RequestRefused
            If the slot is empty.
        """
        slot, trial = payload[:2]
        self._check_state()
        self._change(lambda: self._store.select(slot, bool(trial)))
        return b""

    def confirm(self) -> bytes:
        """Answer CONFIRM.

        Raises
        ------
        RequestRefused
            If no trial plays since the start.
        """
        self._check_state()
        if self._start != self._store.state.trial:
            raise RequestRefused(Reason.TRIAL)
        self._change(self._store.confirm)
        return b""

    def delete(self, payload: bytes) -> bytes:
        """Answer DELETE.

        Raises
        ------
        RequestRefused
            If the slot is empty.
        """
        slot = payload[0]
        self._check_state()
        self._change(lambda: self._store.delete(slot))
        self._forget(slot)
        return b""

    def _check_state(self) -> None:
        rests = self._player.state not in (DeviceState.PLAYING, DeviceState.PARKING) and not self._player.starts
        if not self._while_playing and not rests:
            raise RequestRefused(Reason.PLAYING)

    def _change(self, change: Callable[[], None]) -> None:
        """Make a change, or raise the refusal that tells why not."""
        try:
            change()
        except StoreError as error:
            layout = self._store.layout
            raise RequestRefused(
                *{
                    StoreFault.NO_SLOT: (Reason.SLOT, layout.slots),
                    StoreFault.TOO_LONG: (Reason.ROOM, layout.room),
                    StoreFault.NO_TRIAL: (Reason.TRIAL, 0),
                }.get(error.fault, (Reason.FLASH, 0))
            ) from None

    def _no_slot(self) -> RequestRefused:
        return RequestRefused(Reason.SLOT, self._store.layout.slots)

    def _forget(self, slot: int) -> None:
        """Forget the slot of the start when its content has changed."""
        if slot == self._start:
            self._start = NO_SLOT
