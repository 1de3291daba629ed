"""The flash of an nRF51 behind its controller, in unicorn, as strict as Nordic's manual: what it forbids is reported.

QEMU's is always ready, takes an erase of any address in a page, and any number of writes of a word. Here the controller
is busy for some polls of READY after a write and for more after an erase, as code in RAM sees it. Meanwhile nothing
else may be done. A word is written whole, only as CONFIG allows, and once after an erase, as ``dac_store`` does.
"""

from pathlib import Path

import unicorn
from unicorn import arm_const

from tablegen.verification.c.elf import read_executable

PAGE, WORD = 1024, 4
KEPT, KEPT_END = 0x20000, 0x40000
SCRATCH = 0x20002000  # RAM for arguments
_RAM, _RAM_SIZE, _TRAP = 0x20000000, 16 << 10, 0x1FF00
_NVMC, _READY, _CONFIG, _ERASEPAGE = 0x4001E000, 0x400, 0x504, 0x508
_READ_ONLY, _WRITE, _ERASE = 0, 1, 2
_WRITE_POLLS, _ERASE_POLLS = 3, 40
_ENDLESS = 20_000_000  # instructions


class Nrf51Flash:
    """A processor with functions to call, and the region of kept programs.

    ``faults`` is what was done that the manual forbids. ``weak`` are addresses of words that a write leaves as they
    are, ``worn`` are pages that an erase does; ``stuck``: the controller does not become ready any more.
    """

    def __init__(self, executable: Path) -> None:
        program = read_executable(executable)
        self.cells = bytearray(b"\xff" * (KEPT_END - KEPT))
        self.faults: list[str] = []
        self.weak: set[int] = set()
        self.worn: set[int] = set()
        self.stuck = False
        self._symbols = program.symbols
        self._config, self._busy = _READ_ONLY, 0
        self._written: set[int] = set()
        self._uc = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._uc.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M0)
        self._uc.mem_map(0, KEPT)
        self._uc.mem_map(_RAM, _RAM_SIZE)
        self._uc.mmio_map(KEPT, KEPT_END - KEPT, self._read, None, self._write, None)
        self._uc.mmio_map(_NVMC, 0x1000, self._read_register, None, self._write_register, None)
        for segment in program.segments:
            if segment.data:
                self._uc.mem_write(segment.address, segment.data)

    def call(self, function: str, *arguments: int) -> int:
        """Return what a function does; it leaves the controller ready, and flash protected."""
        for number, argument in enumerate(arguments):
            self._uc.reg_write(arm_const.UC_ARM_REG_R0 + number, argument)
        self._uc.reg_write(arm_const.UC_ARM_REG_SP, _RAM + _RAM_SIZE)
        self._uc.reg_write(arm_const.UC_ARM_REG_LR, _TRAP | 1)
        try:
            self._uc.emu_start(self._symbols[function] | 1, _TRAP, count=_ENDLESS)
        except unicorn.UcError as error:
            raise AssertionError(f"{function}: {error}") from error
        assert self._uc.reg_read(arm_const.UC_ARM_REG_PC) == _TRAP, f"{function} does not return"
        if not self.stuck and (self._busy or self._config != _READ_ONLY):
            self.faults.append(f"{function} leaves CONFIG {self._config}, busy {self._busy}")
        return int(self._uc.reg_read(arm_const.UC_ARM_REG_R0))

    def put(self, data: bytes, address: int = SCRATCH) -> int:
        """Write an argument to RAM, and return its address."""
        self._uc.mem_write(address, data)
        return address

    def get(self, count: int, address: int = SCRATCH) -> bytes:
        """Return bytes of RAM."""
        return bytes(self._uc.mem_read(address, count))

    def _check(self, good: bool, what: str, address: int) -> bool:
        if not good:
            self.faults.append(f"{what} at {address:#x}")
        return good

    def _read(self, uc: object, offset: int, size: int, data: object) -> int:
        if not self._check(not self._busy, "a read of a busy flash", KEPT + offset):
            return 0
        return int.from_bytes(self.cells[offset : offset + size], "little")

    def _write(self, uc: object, offset: int, size: int, value: int, data: object) -> None:
        rules = {
            "a write to a busy flash": not self._busy,
            "a write of less than a word": size == WORD and offset % WORD == 0,
            "a write that CONFIG does not allow": self._config == _WRITE,
            "a second write": offset not in self._written,
        }
        if not all(self._check(good, what, KEPT + offset) for what, good in rules.items()):
            return
        self._written.add(offset)
        if KEPT + offset not in self.weak:
            before = int.from_bytes(self.cells[offset : offset + WORD], "little")
            self.cells[offset : offset + WORD] = (before & value).to_bytes(WORD, "little")
        self._busy = _WRITE_POLLS

    def _read_register(self, uc: object, offset: int, size: int, data: object) -> int:
        if offset == _CONFIG:
            return self._config
        self._check(offset == _READY, "a read of no register", offset)
        self._busy -= self._busy > 0 and not self.stuck
        return int(not self._busy)

    def _write_register(self, uc: object, offset: int, size: int, value: int, data: object) -> None:
        if not self._check(not self._busy, "a register of a busy controller is written", offset):
            return
        if offset == _CONFIG:
            if self._check(value in (_READ_ONLY, _WRITE, _ERASE), "no value of CONFIG", value):
                self._config = value
        elif self._check(offset == _ERASEPAGE, "a write to no register", offset):
            self._erase(value)

    def _erase(self, address: int) -> None:
        rules = {
            "an erase that CONFIG does not allow": self._config == _ERASE,
            "an erase that begins in a page": address % PAGE == 0,
            "an erase of the firmware": KEPT <= address < KEPT_END,
        }
        if not all(self._check(good, what, address) for what, good in rules.items()):
            return
        if address not in self.worn:
            start = address - KEPT
            self.cells[start : start + PAGE] = b"\xff" * PAGE
            self._written -= set(range(start, start + PAGE))
        self._busy = _ERASE_POLLS
