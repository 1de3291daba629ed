"""The kept programs in C, by ctypes, on a flash in Python."""

import ctypes
from ctypes import CFUNCTYPE, POINTER, Structure, byref, c_bool, c_uint8, c_uint32, c_void_p
from pathlib import Path

from building import run_clean
from cut_flash import CutFlash

from tablegen.base.resources import c_link, c_store
from tablegen.link.program_image import ProgramImage
from tablegen.link.store import INFO, LINE, SLOTS, Layout

Bytes = POINTER(c_uint8)
_Erase = CFUNCTYPE(c_bool, c_uint32)
_Write = CFUNCTYPE(c_bool, c_uint32, Bytes)
_Read = CFUNCTYPE(c_bool, c_uint32, Bytes, c_uint32)
_Source = CFUNCTYPE(None, c_void_p, c_uint32, Bytes, c_uint32)


class _Flash(Structure):
    _fields_ = (
        ("erase", _Erase),
        ("write", _Write),
        ("read", _Read),
        ("base", c_uint32),
        ("sector_bytes", c_uint32),
        ("place_sectors", c_uint32),
        ("slots", c_uint8),
    )


class CState(Structure):
    _fields_ = (
        ("counter", c_uint32),
        ("selected", c_uint8),
        ("trial", c_uint8),
        ("started", c_uint8),
        ("place", c_uint8 * (SLOTS + 1)),
    )


class _Store(Structure):
    _fields_ = (("flash", c_void_p), ("state", CState), ("sector", c_uint8), ("certain", c_bool))


def compile_store(folder: Path, changes: tuple[tuple[str, str], ...] = ()) -> ctypes.CDLL:
    """Compile the store as a library, with pieces of the text of ``dac_store.c`` replaced."""
    sources = []
    for path in [*c_store(), *(path for path in c_link() if path.stem == "dac_link_frame")]:
        text = path.read_text("utf-8")
        if path.name == "dac_store.c":
            for old, new in changes:
                assert text.count(old) == 1, old
                text = text.replace(old, new)
        (folder / path.name).write_text(text, "utf-8")
        sources.append(folder / path.name)
    target = folder / "store.so"
    files = [path for path in sources if path.suffix == ".c"]
    options = ["-DDAC_STORE=1", f"-I{c_store()[0].parent}"]
    run_clean(["cc", "-std=c99", *options, "-O1", "-fPIC", "-shared", "-Wall", "-Wextra", *files, "-o", target])
    library = ctypes.CDLL(str(target))
    library.dac_store_start.restype = c_uint8
    library.dac_store_info.restype = library.dac_store_read.restype = c_bool
    return library


def c_flash(flash: CutFlash, layout: Layout) -> Structure:
    """The ``dac_store_flash`` of a flash in Python, which has to live as long as it is used."""

    def write(address: int, line: "ctypes._Pointer[c_uint8]") -> bool:
        return flash.write(address, ctypes.string_at(line, LINE))

    def read(address: int, to: "ctypes._Pointer[c_uint8]", count: int) -> bool:
        found = flash.read(address, count)
        if found is not None:
            ctypes.memmove(to, found, count)
        return found is not None

    return _Flash(
        _Erase(flash.erase), _Write(write), _Read(read),
        layout.base, layout.sector_bytes, layout.place_sectors, layout.slots,
    )  # fmt: skip


class CStore:
    """A ``dac_store``, opened on a flash."""

    def __init__(self, library: ctypes.CDLL, flash: CutFlash, layout: Layout) -> None:
        self.library = library
        self.flash = c_flash(flash, layout)
        self.store = _Store()
        self.opened = library.dac_store_open(byref(self.store), byref(self.flash))

    @property
    def state(self) -> CState:
        return self.store.state

    def start(self) -> int:
        return int(self.library.dac_store_start(byref(self.store)))

    def save(self, slot: int, image: ProgramImage) -> int:
        def source(_: int, at: int, to: "ctypes._Pointer[c_uint8]", count: int) -> None:
            ctypes.memmove(to, image.data[at : at + count], count)

        info = image.info.pack()
        return int(self.library.dac_store_save(byref(self.store), slot, info, _Source(source), None))

    def select(self, slot: int, trial: bool = False) -> int:
        return int(self.library.dac_store_select(byref(self.store), slot, trial))

    def confirm(self) -> int:
        return int(self.library.dac_store_confirm(byref(self.store)))

    def delete(self, slot: int) -> int:
        return int(self.library.dac_store_delete(byref(self.store), slot))

    def image(self, slot: int) -> bytes | None:
        """Return announcement and image of a slot, or None."""
        info = (c_uint8 * INFO)()
        if not self.library.dac_store_info(byref(self.store), slot, info):
            return None
        size = int.from_bytes(bytes(info)[32:36], "little")
        data = (c_uint8 * size)()
        assert self.library.dac_store_read(byref(self.store), slot, 0, data, size)
        return bytes(info) + bytes(data)
