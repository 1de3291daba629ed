"""The files of a scan at an angle by format: C99 and Verilog for the sequencers with a slow part."""

from collections.abc import Iterable

from tablegen.base.input_errors import Unphysical
from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.base.resources import c_link, c_runtime, c_store
from tablegen.device.dual_program import ScanProgram
from tablegen.emit.slow_c import slow_c_files, slow_storage
from tablegen.emit.turned_content import TurnedContent
from tablegen.emit.turned_verilog import turned_verilog_files, turned_verilog_runtime

TURNED_FORMATS = ("c", "verilog")


def require_format(format_name: str, program: ScanProgram) -> None:
    """Check that a format of ``TURNED_FORMATS`` can hold a scan at an angle.

    Raises
    ------
    Unphysical
        If it is Verilog, and the output is shaped.
    """
    if format_name == "verilog" and max(axis.output.shaping.order for axis in (program.x, program.y)):
        raise Unphysical(
            "the Verilog sequencer shapes no scan at an angle; take the format c, or leave shaping out of the dac"
        )


def turned_files(content: TurnedContent, formats: Iterable[str]) -> dict[str, bytes]:
    """Render the files that were made for a scan at an angle in some of ``TURNED_FORMATS``, by name."""
    makers = {"c": _c_files, "verilog": turned_verilog_files}
    return {name: text for each in formats for name, text in makers[each](content).items()}


def turned_runtime(formats: Iterable[str]) -> dict[str, bytes]:
    """Read the files of the sequencers in these formats, by name."""
    runtimes = {"c": lambda: (*c_runtime(), *c_link(), *c_store()), "verilog": turned_verilog_runtime}
    return {path.name: read_bytes(path, BUILD_FILE) for each in formats for path in runtimes[each]()}


def _c_files(content: TurnedContent) -> dict[str, bytes]:
    storage = _storage(content.program, content.z)
    contents = [each for each in (content, content.content_of_z) if each is not None]
    return {name: text for each in contents for name, text in slow_c_files(each, storage).items()}


def turned_options(program: ScanProgram, z: ScanProgram | None = None) -> dict[str, int]:
    """Return the macros that the runtime and an application are compiled with; ``z`` is what plays beside a scan."""
    return {f"DAC_{key}": value for key, value in _storage(program, z).items()}


def _storage(program: ScanProgram, z: ScanProgram | None) -> dict[str, int]:
    return slow_storage([each for each in (program, z) if each is not None])
