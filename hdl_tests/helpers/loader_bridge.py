"""A simulated program_loader with its sequencer: in lock step with a test, or as a serial port for a client.

``compile_loader`` compiles the bench, ``Simulation`` runs it in a process of its own. The simulation does not move but
for ``talk`` and ``run``, so that everything repeats; inside ``bridged()`` it runs freely, behind a URL of pyserial.
"""

import json
import multiprocessing
import socket
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from building import BENCHES, REPOSITORY
from limits import PATIENCE_S

from tablegen.base.resources import verilog_runtime
from tablegen.verification.verilog.simulate import CompiledDesign, Design, compile_design

sys.path.insert(0, str(REPOSITORY / "firmware_templates" / "loader"))
_before, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # nothing but sources in a folder that ships
import assembler  # noqa: E402

sys.dont_write_bytecode = _before

BENCH = BENCHES / "loader_bench.v"
LINE_LOG = BENCHES / "line_log.v"
LINES = "lines.log"
NO_STOP_BIT, BREAK, PULSE = 1 << 8, 1 << 9, 1 << 10  # of an entry of ``talk``
BOOT_HASH = bytes(range(0xE0, 0x100))
MOST = 512  # entries of a command
CLOCKS_PER_BYTE = 240  # at least, on the way to the loader
AT_MOST = 2_000_000  # clocks, for a request


def compile_loader(
    folder: Path,
    parameters: Mapping[str, int | str] | None = None,
    simulator: str = "verilator",
    sources: Sequence[Path] | None = None,
) -> CompiledDesign:
    """The bench with these parameters; ``sources`` are those of the runtime unless given."""
    names = assembler.program().names
    idle = {"IDLE_FROM": names["main"], "IDLE_TO": names["receive"] + 3}
    values = {"LINES": LINES, **idle, **(parameters or {})}
    files = [BENCH, LINE_LOG, *(sources or verilog_runtime())]
    return compile_design(simulator, Design(files, "loader_bench", values), folder)


class Simulation:
    """A running bench; ends with the block.

    ``words`` are put in the place of the processor's program, ``memory`` are
    addresses and bytes that its memory begins with.
    """

    def __init__(
        self, compiled: CompiledDesign, words: Sequence[int] = (), memory: Sequence[tuple[int, int]] = ()
    ) -> None:
        self._compiled, self._words, self._memory = compiled, words, memory
        self._turn = 0

    def __enter__(self) -> Self:
        self.folder = self._compiled.folder
        (self.folder / LINES).unlink(missing_ok=True)
        with socket.create_server(("127.0.0.1", 0)) as server:
            server.settimeout(PATIENCE_S)
            settings = {"LOADER_PORT": str(server.getsockname()[1])}
            # A process, since the runner waits for the simulator, with an environment of its own.
            self._process = multiprocessing.get_context("fork").Process(
                target=self._compiled.run, args=("cocotb_loader", settings), daemon=True
            )
            self._process.start()
            self._control, _ = server.accept()
        self._control.settimeout(PATIENCE_S)
        self._lines = self._control.makefile("rw", encoding="ascii")
        self._ask({"program": list(self._words), "memory": list(self._memory)})
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lines.close()
        self._control.close()
        self._process.join(PATIENCE_S)
        if self._process.is_alive():
            self._process.kill()

    def set(self, **values: int) -> None:
        """Inputs of the bench: ``permit``, ``tick_every``, ``bit_time``, ``boot_count``, ``reset``, ``underrun``."""
        self._ask({"set": values})

    def ticks(self, ticks: int | None) -> None:
        """So many more ticks, or without end, as the clocks go by."""
        self._turn = 1 - self._turn
        self.set(ticks_left=0xFFFFFFFF if ticks is None else ticks, ticks_set=self._turn)

    def talk(self, data: Sequence[int] = b"") -> bytes:
        """Send bytes, and wait until the loader has nothing more to do; what came back."""
        received = b""
        for at in range(0, max(len(data), 1), MOST):
            part = list(data[at : at + MOST])
            command = {"send": part, "clocks": AT_MOST, "until_idle": at + MOST >= len(data)}
            if not command["until_idle"]:
                command["clocks"] = len(part) * CLOCKS_PER_BYTE
            received += bytes.fromhex(self._ask(command)["received"])
        return received

    def run(self, clocks: int, data: Sequence[int] = b"") -> bytes:
        """Let so many clocks go by, and send bytes meanwhile; what came back."""
        return bytes.fromhex(self._ask({"send": list(data), "clocks": clocks, "until_idle": False})["received"])

    def lines(self) -> list[str]:
        """The log of lines so far."""
        return (self.folder / LINES).read_text("ascii").splitlines()

    @contextmanager
    def bridged(self) -> Iterator[str]:
        """The simulation runs freely, as the serial port of this URL."""
        port = self._ask({"serve": True})["port"]
        try:
            yield f"socket://127.0.0.1:{port}"
        finally:
            self._ask({})

    def _ask(self, command: Mapping[str, object]) -> Any:
        print(json.dumps(command), file=self._lines, flush=True)
        line = self._lines.readline()
        if not line:
            raise ConnectionError(f"the simulation ended: {(self.folder / 'simulation.log').read_text()[-2000:]}")
        return json.loads(line)


@contextmanager
def loader(parameters: Mapping[str, int | str] | None = None) -> Iterator[Simulation]:
    """Compile and run in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder, Simulation(compile_loader(Path(folder), parameters)) as simulation:
        yield simulation
