"""Cut the power of a store at every word of every operation, and of its recovery, and compare with what may be."""

import ctypes
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

from c_store import CStore
from cut_flash import MODES, CutFlash

from tablegen.link.messages import AxisShape, ImageInfo
from tablegen.link.program_image import ProgramImage
from tablegen.link.store import NONE, Layout, Store, StoreError

LAYOUT = Layout(base=64, sector_bytes=64, place_sectors=2, slots=3)
SIZE = LAYOUT.place(LAYOUT.slots + 1)
Step = tuple[str, *tuple[int, ...]]


def image_of(number: int) -> ProgramImage:
    """Return bytes that no other number has; short, since the store does not read what they mean."""
    data = bytes((37 * number + 11 * at) % 256 for at in range(40 + number))
    shape = AxisShape(6, 16, 16)
    return ProgramImage(ImageInfo(bytes([number]) * 32, len(data), zlib.crc32(data), shape, shape), data)


@dataclass(frozen=True)
class Kept:
    """What a store keeps, as its user sees it: numbers of images, 0 for none."""

    images: tuple[int, ...] = (0, 0, 0)
    selected: int = NONE
    trial: int = NONE
    started: int = 0

    def start(self) -> "tuple[Kept, int]":
        """Return the state after a start, and the image that plays."""
        selected = 0 if self.selected == NONE else self.images[self.selected]
        if self.trial == NONE:
            return self, selected
        if self.started or not self.images[self.trial]:
            return replace(self, trial=NONE, started=1), selected
        return replace(self, started=1), self.images[self.trial]

    def after(self, step: Step) -> "Kept":
        """Return the state after a step."""
        name, *rest = step
        if name == "start":
            return self.start()[0]
        if name == "confirm":
            return replace(self, selected=self.trial, trial=NONE, started=0)
        slot = rest[0]
        if name == "select":
            return replace(self, selected=slot, trial=NONE, started=0)
        if name == "try":
            return replace(self, trial=slot, started=0)
        images = list(self.images)
        images[slot] = rest[1] if name == "save" else 0
        if name == "save":
            return replace(self, images=tuple(images))
        selected, trial = (NONE if each == slot else each for each in (self.selected, self.trial))
        return Kept(tuple(images), selected, trial, self.started)


def take(store: CStore, step: Step) -> int:
    """Take a step; 0 if it is done."""
    name, *rest = step
    if name == "save":
        return store.save(rest[0], image_of(rest[1]))
    if name in ("select", "try"):
        return store.select(rest[0], name == "try")
    if name == "delete":
        return store.delete(rest[0])
    if name == "confirm":
        return store.confirm()
    store.start()
    return 0


def take_by_model(store: Store, step: Step) -> bool:
    """Take a step other than a start by the model; True if it is done."""
    name, *rest = step
    try:
        if name == "save":
            store.save(rest[0], image_of(rest[1]))
        elif name in ("select", "try"):
            store.select(rest[0], name == "try")
        elif name == "delete":
            store.delete(rest[0])
        else:
            store.confirm()
    except StoreError:
        return False
    return True


def kept(store: CStore) -> Kept:
    """Return what a store keeps; an image that is none of ours is -1."""
    known = {image_of(number).info.pack() + image_of(number).data: number for number in range(1, 9)}
    images = [store.image(slot) for slot in range(LAYOUT.slots)]
    numbers = tuple(0 if each is None else known.get(each, -1) for each in images)
    lost = any(place != NONE and number == 0 for place, number in zip(store.state.place, numbers, strict=False))
    state = store.state
    return Kept((-1,) if lost else numbers, state.selected, state.trial, state.started)


SCRIPT: tuple[Step, ...] = (
    ("save", 0, 1), ("select", 0), ("save", 1, 2), ("try", 1), ("start",), ("start",), ("try", 1), ("start",),
    ("confirm",), ("save", 1, 3), ("save", 0, 4), ("delete", 0), ("save", 0, 5), ("try", 0), ("delete", 1),
)  # fmt: skip
AFTERWARDS: Step = ("save", 2, 8)


def _fault(library: ctypes.CDLL, flash: CutFlash, allowed: set[Kept], second: bool, mode: str) -> str:
    """Start after a cut, go on, and start again; with ``second`` with a cut at each event of that. Empty if good."""
    flash.power_up()
    store = CStore(library, flash, LAYOUT)
    before = kept(store)
    if before not in allowed:
        return f"{before}; may be one of {allowed}"
    untouched = flash.copy()
    slot = store.start()
    expected, plays = before.start()
    played = 0 if slot == NONE else kept(store).images[slot]
    if played != plays:
        return f"plays {played} and not {plays}"
    if take(store, AFTERWARDS) != 0:
        return "cannot be written any more"
    events = flash.events
    flash.power_up()
    final = kept(CStore(library, flash, LAYOUT))
    if final != expected.after(AFTERWARDS):
        return f"{final} in place of {expected.after(AFTERWARDS)}"
    if second:
        begun = {each.start()[0] for each in allowed}
        later = allowed | begun | {each.after(AFTERWARDS) for each in begun}
        for event in range(events):
            again = untouched.copy()
            again.cut(event, mode)
            other = CStore(library, again, LAYOUT)
            other.start()
            take(other, AFTERWARDS)
            fault = _fault(library, again, later, False, mode)
            if fault:
                return f"then at event {event}: {fault}"
    return ""


def faults(library: ctypes.CDLL, script: tuple[Step, ...] = SCRIPT, second: bool = False) -> Iterator[str]:
    """Yield what goes wrong after a cut in each event of each step, for each way in which the cut may read."""
    flash, state = CutFlash(SIZE, LAYOUT.sector_bytes), Kept()
    for number, step in enumerate(script):
        whole = flash.copy()
        whole.power_up()
        store = CStore(library, whole, LAYOUT)
        if take(store, step) != 0 or kept(store) != state.after(step):
            yield f"step {number} {step}: {kept(store)} without a cut"
            return
        for mode in MODES:
            for event in range(whole.events):
                cut = flash.copy()
                cut.power_up()
                other = CStore(library, cut, LAYOUT)
                cut.cut(event, mode)
                take(other, step)
                fault = _fault(library, cut, {state, state.after(step)}, second, mode)
                if fault:
                    yield f"step {number} {step}, {mode}, event {event}: {fault}"
        flash, state = whole, state.after(step)
