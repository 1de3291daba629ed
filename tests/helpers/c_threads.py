"""The sequencer between two threads: how it is compiled, with ThreadSanitizer or without, and run."""

import os
from collections.abc import Sequence
from pathlib import Path
from subprocess import CompletedProcess, run

from building import run_clean
from limits import within

from tablegen.base.resources import c_runtime

_PLAY_S = 300  # of CPU time; it takes five
HERE = Path(__file__).parent
# Accesses to volatile words are calls, to c_fences.c.
DISTINGUISH = {
    "gcc": ("--param", "tsan-distinguish-volatile=1"),
    "clang": ("-mllvm", "-tsan-distinguish-volatile=1"),
}
FENCES = (
    "-DFENCES", "-DDAC_RELEASE()=fence_release()", "-DDAC_ACQUIRE()=fence_acquire()", "-include", HERE / "c_fences.h",
)  # fmt: skip


def compile_threads(
    folder: Path, compiler: str, sanitized: bool, runtime: Sequence[Path] | None = None, options: Sequence[str] = ()
) -> Path:
    """The program ``c_threads.c``; sanitized it knows the memory order that C11 promises, and no more."""
    files = c_runtime() if runtime is None else list(runtime)
    folder.mkdir(parents=True, exist_ok=True)
    program, fences = folder / "threads", folder / "fences.o"
    common = [compiler, "-std=gnu99", "-g", *options]
    sources = [*(f"-I{path.parent}" for path in files[:1]), *(path for path in files if path.suffix == ".c")]
    sources += [HERE / "c_threads.c"]
    if sanitized:
        run_clean([*common, "-O1", "-c", HERE / "c_fences.c", "-o", fences])
        common += ["-O1", "-fsanitize=thread", *DISTINGUISH[compiler], *map(str, FENCES)]
        sources += [fences]
    run_clean([*common, *sources, "-pthread", "-o", program])
    return program


def play(program: Path, programs: int, seed: int) -> CompletedProcess[str]:
    """Run it; a race is an exit status of 66, as are too many of them, and ``ENDED`` tells that it hangs."""
    environment = {**os.environ, "TSAN_OPTIONS": "halt_on_error=1 exitcode=66"}
    command = within(_PLAY_S, [program, str(programs), str(seed)])
    return run(command, env=environment, capture_output=True, text=True, check=False)
