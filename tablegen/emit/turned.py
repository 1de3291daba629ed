"""The files of a scan at an angle by format: C99 and Verilog for sequencers with a slow part, and packages of them."""

from collections.abc import Iterable
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.base.resources import c_link, c_runtime, c_store
from tablegen.device.dual_program import ScanProgram
from tablegen.emit.formats import get
from tablegen.emit.formats.c import public_headers
from tablegen.emit.package import CPackage, VerilogPackage
from tablegen.emit.package_format import PackageOfC, PackageOfVerilog
from tablegen.emit.slow_c import slow_c_files, slow_constants, slow_storage
from tablegen.emit.turned_content import TurnedContent
from tablegen.emit.turned_verilog import turned_top_parameters, turned_verilog_files, turned_verilog_runtime


def turned_files(content: TurnedContent, formats: Iterable[str]) -> dict[str, bytes]:
    """Render the files that were made for a scan at an angle in some of ``SEQUENCER_FORMATS``, by name."""
    return {name: text for each in formats for name, text in _files(content, each).items()}


def turned_runtime(formats: Iterable[str]) -> dict[str, bytes]:
    """Read the files of the sequencers in these formats, and what goes with a package, by name."""
    runtimes = {"c": _c_runtime, "verilog": turned_verilog_runtime}
    return {
        path.name: read_bytes(path, BUILD_FILE) for each in formats for path in runtimes.get(each, get(each).runtime)()
    }


def turned_options(program: ScanProgram, z: ScanProgram | None = None) -> dict[str, int]:
    """Return the macros that the runtime and an application are compiled with; ``z`` is what plays beside a scan."""
    return {f"DAC_{key}": value for key, value in _storage(program, z).items()}


def _files(content: TurnedContent, name: str) -> dict[str, bytes]:
    if name == "c":
        return _c_files(content)
    if name == "verilog":
        return turned_verilog_files(content)
    package = get(name)
    if isinstance(package, PackageOfC):
        return package.package_files(_c_package(content))
    assert isinstance(package, PackageOfVerilog)
    return package.package_files(_verilog_package(content))


def _c_files(content: TurnedContent) -> dict[str, bytes]:
    storage = _storage(content.program, content.z)
    contents = [each for each in (content, content.content_of_z) if each is not None]
    return {name: text for each in contents for name, text in slow_c_files(each, storage).items()}


def _c_package(content: TurnedContent) -> CPackage:
    with_z = content.z is not None
    return CPackage(
        content.name,
        content.version,
        content.hash,
        sorted([*_c_files(content), *(path.name for path in _c_runtime())]),
        public_headers(content.name, with_z=with_z),
        turned_options(content.program, content.z),
        slow_constants(content),
        with_z=with_z,
    )


def _verilog_package(content: TurnedContent) -> VerilogPackage:
    x, y = (axis.output for axis in content.axes)
    return VerilogPackage(
        content.name,
        content.version,
        content.hash,
        sorted(turned_verilog_files(content)),
        sorted(path.name for path in turned_verilog_runtime()),
        content.clocks_per_tick,
        content.program.schedule.update_rate_hz,
        turned_top_parameters(content),
        x.dac_bits,
        (x.word_bits, y.word_bits),
    )


def _c_runtime() -> list[Path]:
    return [*c_runtime(), *c_link(), *c_store()]


def _storage(program: ScanProgram, z: ScanProgram | None) -> dict[str, int]:
    return slow_storage([each for each in (program, z) if each is not None])
