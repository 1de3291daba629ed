"""The C sequencer on emulated processors: compiled for them, run in process by unicorn.

``CortexMBench`` plays scripts as ``CBench`` does on this machine. ``Processor`` calls single functions of an
executable, and says how many instructions and how much stack they took.
"""

import shlex
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.base.installation import install_advice
from tablegen.base.resources import c_runtime
from tablegen.verification.c.bench import BENCH, OPTIONS, CRecord, constants_written, defines, script_words, sine_of
from tablegen.verification.c.elf import Executable, read_executable
from tablegen.verification.failures import SimulationFailed, ToolMissing
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script

_HERE = Path(__file__).parent
MEMORY, LAYOUT = _HERE / "stream_bench_memory.c", _HERE / "emulated.ld"
FREESTANDING = ("-ffreestanding", "-static", "-ffunction-sections", "-fdata-sections")
_RAM, _RAM_SIZE, _STACK = 0x20000000, 1 << 24, 1 << 16
_FLASH, _FLASH_SIZE = 0x00010000, 1 << 24
TRAP = _FLASH + _FLASH_SIZE - 16  # return address of a called function, where no code is
_STACK_PAINT = 0xA5
_ARRAY_WORDS = 8192  # words of the arrays in stream_bench_memory.c
_SLICE_US = 500_000  # short enough that an interruption is noticed


@dataclass(frozen=True)
class Core:
    """A processor by its names in gcc and unicorn; ``model`` is a model of Arm, a mode of RISC-V."""

    architecture: Literal["arm", "riscv"]
    options: tuple[str, ...]
    model: str | None = None


CORES = {
    name: Core("arm", (f"-mcpu={name}", "-mthumb"), model)
    for name, model in (
        ("cortex-m0plus", "UC_CPU_ARM_CORTEX_M0"),
        ("cortex-m3", "UC_CPU_ARM_CORTEX_M3"),
        ("cortex-m4", "UC_CPU_ARM_CORTEX_M4"),
        ("cortex-m7", "UC_CPU_ARM_CORTEX_M7"),
        ("cortex-m33", "UC_CPU_ARM_CORTEX_M33"),
    )
} | {
    "riscv32": Core("riscv", ("-march=rv32imac", "-mabi=ilp32"), "UC_MODE_RISCV32"),
    "riscv64": Core("riscv", ("-march=rv64imac", "-mabi=lp64", "-mcmodel=medany"), "UC_MODE_RISCV64"),
}
COMPILERS = {"arm": "arm-none-eabi-gcc", "riscv": "riscv64-unknown-elf-gcc"}
_PACKAGES = {"arm-none-eabi-gcc": "gcc-arm-none-eabi", "riscv64-unknown-elf-gcc": "gcc-riscv64-unknown-elf"}


def require_emulator(compiler: str = COMPILERS["arm"]) -> list[str]:
    """Return the words of a cross compiler's command.

    Raises
    ------
    ToolMissing
        If the compiler, unicorn or elftools is not installed.
    """
    try:
        import elftools  # noqa: F401
        import unicorn  # noqa: F401
    except ImportError as error:
        raise ToolMissing(f"{error.name} is not installed: {install_advice('cortex-m')}") from None
    command = shlex.split(compiler)
    if not command or shutil.which(command[0]) is None:
        name = command[0] if command else compiler
        raise ToolMissing(f"{name} is not installed: apt-get install {_PACKAGES.get(name, name)}")
    return command


def compile_bare(
    program: Path,
    sources: Sequence[Path],
    core: str = "cortex-m4",
    compiler: str | None = None,
    options: Sequence[str] = OPTIONS,
    macro_values: Mapping[str, int] | None = None,
    layout: Path = LAYOUT,
) -> Executable:
    """Compile and link for a bare processor; headers are found beside the sources, which may list them.

    Parameters
    ----------
    compiler
        Command, by default gcc for the core; one that is not gcc has the processor in its own command.
    macro_values
        Macros by name, for ``-D``.

    Raises
    ------
    SimulationFailed
        If the compiler fails or warns.
    ToolMissing
        If the compiler or the emulator is not installed.
    """
    architecture = CORES[core].architecture
    command = require_emulator(compiler or COMPILERS[architecture])
    own = command[0].endswith("gcc")
    program.parent.mkdir(parents=True, exist_ok=True)
    line = [
        *command,
        *(CORES[core].options if own else ()),
        *options,
        *FREESTANDING,
        *(f"-D{name}={value}" for name, value in (macro_values or {}).items()),
        *(f"-I{place}" for place in sorted({str(path.parent) for path in sources})),
        *(str(path) for path in sources if path.suffix == ".c"),
        "-T",
        str(layout),
        "-Wl,-e,bench_main",
        *(("-nostdlib", "-lgcc") if own else ()),  # others find their run-time library by themselves
        "-o",
        str(program),
    ]
    process = subprocess.run(line, capture_output=True, text=True, check=False)
    if process.returncode or process.stderr:
        raise SimulationFailed(f"{' '.join(line)}\n{process.stdout}{process.stderr}".strip())
    return read_executable(program)


@dataclass(frozen=True)
class CallCost:
    """The cost of a call of a function; ``result`` is its first word."""

    result: int
    instructions: int
    stack: int


class Processor:
    """An executable in memory, its stack at the end of RAM."""

    def __init__(self, executable: Executable, core: str = "cortex-m4") -> None:
        require_emulator(COMPILERS[CORES[core].architecture])
        self.executable, self.core = executable, CORES[core]
        self.uc = self._processor()
        self.uc.mem_map(_RAM, _RAM_SIZE)  # one region each, since every further one slows down all accesses
        self.uc.mem_map(_FLASH, _FLASH_SIZE)
        for segment in executable.segments:
            self.uc.mem_write(segment.address, segment.data)
        self.stack_top = _RAM + _RAM_SIZE - 64

    def _processor(self) -> Any:
        import unicorn
        from unicorn import arm_const, riscv_const

        if self.core.architecture == "riscv":
            uc = unicorn.Uc(unicorn.UC_ARCH_RISCV, getattr(unicorn, str(self.core.model)))
            self._sp, self._lr, self._pc = (getattr(riscv_const, f"UC_RISCV_REG_{name}") for name in ("SP", "RA", "PC"))
            self._arguments = [getattr(riscv_const, f"UC_RISCV_REG_A{number}") for number in range(8)]
            self._thumb = 0
            return uc
        uc = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        uc.ctl_set_cpu_model(getattr(arm_const, str(self.core.model)))
        self._sp, self._lr, self._pc = (getattr(arm_const, f"UC_ARM_REG_{name}") for name in ("SP", "LR", "PC"))
        self._arguments = [getattr(arm_const, f"UC_ARM_REG_R{number}") for number in range(4)]
        self._thumb = 1
        return uc

    def symbol(self, name: str) -> int:
        """Return the address of a symbol, without the Thumb bit.

        Raises
        ------
        SimulationFailed
            If the executable has no such symbol.
        """
        try:
            address = self.executable.symbols[name]
        except KeyError:
            raise SimulationFailed(f"the executable has no {name}") from None
        return address & ~self._thumb

    def read(self, name: str, count: int | None = None, offset: int = 0) -> bytes:
        """Read the bytes of a variable, all or ``count`` of them."""
        size = self.executable.sizes[name] if count is None else count
        return bytes(self.uc.mem_read(self.symbol(name) + offset, size))

    def text(self, address: int) -> str:
        """Read a string that ends with 0, of at most 32 characters."""
        return bytes(self.uc.mem_read(address, 32)).split(b"\0")[0].decode("ascii", "replace")

    def write(self, name: str, data: bytes) -> None:
        """Write bytes into a variable."""
        self.uc.mem_write(self.symbol(name), data)

    def word(self, name: str) -> int:
        """Read a 32-bit variable."""
        return int.from_bytes(self.read(name, 4), "little")

    def run(self, start: int, stop: int) -> None:
        """Run until the processor is about to execute the instruction at ``stop``.

        Raises
        ------
        SimulationFailed
            If the processor stops before.
        """
        from unicorn import UcError

        while True:
            try:
                self.uc.emu_start(start | self._thumb, stop, timeout=_SLICE_US)
            except UcError as error:
                raise SimulationFailed(f"the processor stopped at {self.uc.reg_read(self._pc):#x}: {error}") from None
            start = int(self.uc.reg_read(self._pc))
            if start == stop:
                return

    def start(self, function: str, stop: str) -> None:
        """Enter a function, with the stack empty, and run until another one is about to be entered."""
        self.uc.reg_write(self._sp, self.stack_top)
        self.uc.reg_write(self._lr, TRAP | self._thumb)
        self.run(self.symbol(function), self.symbol(stop))

    def resume(self, stop: str) -> None:
        """Return from the function at whose entry the processor stands, until the next one."""
        self.run(int(self.uc.reg_read(self._lr)) & ~self._thumb, self.symbol(stop))

    def call(self, function: str, *arguments: int) -> CallCost:
        """Call a function; instructions are counted, and the stack that was written to, in bytes."""
        from unicorn import UC_HOOK_BLOCK

        floor = self.stack_top - _STACK
        self.uc.mem_write(floor, bytes([_STACK_PAINT]) * _STACK)
        counts: dict[tuple[int, int], int] = {}

        def block(uc: Any, address: int, size: int, data: object) -> None:
            counts[address, size] = counts.get((address, size), 0) + 1

        for register, value in zip(self._arguments, arguments, strict=False):
            self.uc.reg_write(register, value)
        self.uc.reg_write(self._sp, self.stack_top)
        self.uc.reg_write(self._lr, TRAP | self._thumb)
        hook = self.uc.hook_add(UC_HOOK_BLOCK, block)
        try:
            self.run(self.symbol(function), TRAP)
        finally:
            self.uc.hook_del(hook)
        used = bytes(self.uc.mem_read(floor, _STACK))
        untouched = len(used) - len(used.lstrip(bytes([_STACK_PAINT])))
        executed = sum(times * self._instructions(at, size) for (at, size), times in counts.items() if at != TRAP)
        return CallCost(int(self.uc.reg_read(self._arguments[0])), executed, _STACK - untouched)

    def _instructions(self, address: int, size: int) -> int:
        """Count the instructions of a block, whose lengths their first half-words tell."""
        code = np.frombuffer(bytes(self.uc.mem_read(address, size)), dtype="<u2")
        count = at = 0
        while at < len(code):
            long = code[at] & 3 == 3 if self.core.architecture == "riscv" else code[at] >> 11 >= 0b11101
            at += 2 if long else 1
            count += 1
        return count


class CortexMBench:
    """The bench, compiled once for programs of one shape and a Cortex-M; ``core`` is one of ``CORES``.

    ``sources`` in place of the shipped runtime; ``macro_values`` in place of those that suit the shape.
    """

    def __init__(
        self,
        shape: SequencerShape,
        folder: Path,
        compiler: str | None = None,
        options: Sequence[str] = OPTIONS,
        sources: Sequence[Path] | None = None,
        fill: int = 0,
        macro_values: Mapping[str, int] | None = None,
        core: str = "cortex-m4",
    ) -> None:
        runtime = list(c_runtime() if sources is None else sources)
        self.shape, self.core = shape, core
        self._constants = constants_written(macro_values)
        self.executable = compile_bare(
            folder / "stream_bench.elf",
            [*runtime, *BENCH, MEMORY],
            core,
            compiler,
            options,
            defines(shape, fill) if macro_values is None else macro_values,
        )

    def play(self, script: Script, fourier: bool = False) -> CRecord:
        """Run a script; raises ``SimulationFailed`` where the bench ends before its script."""
        return self.run(script_words(script, self.shape, sine_of(self.shape) if fourier else None))

    def run(self, words: str) -> CRecord:
        """Play a script in the form of ``script_words``."""
        script = np.frombuffer(bytes.fromhex(words), dtype=">u8").astype("<u8")
        processor = Processor(self.executable, self.core)
        captures = []
        at = 0
        processor.start("bench_main", "bench_exchange")
        while True:
            written = processor.word("bench_records_written")
            captures.append(np.frombuffer(processor.read("bench_records", 8 * written), dtype="<u8"))
            processor.write("bench_records_written", bytes(4))
            if processor.word("bench_done"):
                break
            self._check(processor)
            if not processor.word("bench_script_words"):  # it has stopped for more of the script
                part = script[at : at + _ARRAY_WORDS]
                at += len(part)
                processor.write("bench_script", part.tobytes())
                processor.write("bench_script_words", len(part).to_bytes(4, "little"))
            processor.resume("bench_exchange")
        capture = np.concatenate(captures).astype(np.uint64)
        return CRecord.of(capture, words, self._constants)

    def _check(self, processor: Processor) -> None:
        at = int.from_bytes(processor.read("bench_refused"), "little")
        if at:
            raise SimulationFailed(f"refused: {processor.text(at)}")
