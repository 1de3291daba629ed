"""Timing constraints for Vivado, Quartus, Diamond, Radiant and Gowin, and Tcl that adds the files of a build."""

from collections.abc import Iterable
from math import ceil, floor
from pathlib import Path

from tablegen.base.resources import resource_folder
from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.verilog import FORMAT as VERILOG
from tablegen.emit.formats.verilog import packaged_modules

_FIRST = "dac_synchronise_first"  # the first flip-flop of every synchroniser
_NO_CLOCK = "The scan has no [emit] clock_hz: constrain the clock here."
_PORT = "`clock` is the port of your design that drives `clock` of {name}_top: write its name instead, or leave the"
_GENERATED = "constraint out if a PLL makes the clock, and the tool derives it."
_CROSSING = "Signals of other clock domains are not timed up to the first flip-flop of their dac_synchronise."


class Constraints(Format):
    """The format constraints: a file of timing constraints for each tool, and two scripts in Tcl."""

    name = "constraints"
    purpose = "constraints of Vivado, Quartus, Diamond, Radiant and Gowin, two scripts in Tcl, and a synchroniser"
    file_names = "NAME.xdc, NAME.lpf, NAME_*.sdc, NAME_*.tcl, dac_synchronise.v"
    needs = ("verilog",)

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the constraints and the scripts."""
        name = content.name
        texts = {
            f"{name}.xdc": [
                *_create_clock(content),
                *_comments("#", _CROSSING),
                f"set_false_path -quiet -to [get_cells -quiet -hierarchical -filter {{NAME =~ *{_FIRST}_reg*}}]",
            ],
            f"{name}_quartus.sdc": [
                *_create_clock(content),
                "derive_pll_clocks",
                "derive_clock_uncertainty",
                *_comments("#", _CROSSING),
                f"set_false_path -to [get_registers -compatibility_mode {{*{_FIRST}*}}]",
            ],
            f"{name}_radiant.sdc": [
                *_create_clock(content),
                *_comments("#", _CROSSING),
                f"set_false_path -to [get_cells {{*{_FIRST}*}}]",
            ],
            f"{name}_gowin.sdc": [
                *_create_clock(content, "//"),
                *_comments("//", _CROSSING),
                f"set_false_path -to [get_regs {{*{_FIRST}*}}]",
            ],
            f"{name}.lpf": [
                *_frequency(content),
                *_comments("#", _CROSSING),
                f'BLOCK PATH TO CELL "*{_FIRST}*" ;',
            ],
            f"{name}_vivado.tcl": _vivado(content),
            f"{name}_quartus.tcl": _quartus(content),
        }
        return {file: _text(file, f"{name}, build {content.hash}", lines) for file, lines in texts.items()}

    def runtime(self) -> list[Path]:
        """Return the synchroniser, which no other format has."""
        return [resource_folder("firmware_templates") / "verilog" / "cdc" / "dac_synchronise.v"]


FORMAT = Constraints()


def _text(file: str, title: str, lines: list[str]) -> bytes:
    mark = "//" if file.endswith("_gowin.sdc") else "#"
    return "\n".join([f"{mark} {title}", *lines, ""]).encode("ascii")


def _comments(mark: str, *lines: str) -> list[str]:
    return [f"{mark} {line}" for line in lines]


def _create_clock(content: Content, mark: str = "#") -> list[str]:
    """Return the clock of the build in SDC; its period is rounded down to whole ps."""
    if not content.clocks_per_tick:
        return _comments(mark, _NO_CLOCK)
    period_ps = floor(10**12 / (content.clocks_per_tick * content.schedule.update_rate_hz))
    period = f"{period_ps // 1000}.{period_ps % 1000:03d}"
    return [
        *_comments(mark, _PORT.format(name=content.name), _GENERATED),
        f"create_clock -name {content.name}_clock -period {period} [get_ports {{clock}}]",
    ]


def _frequency(content: Content) -> list[str]:
    """Return the clock of the build as a preference of Lattice; its frequency is rounded up to whole Hz."""
    if not content.clocks_per_tick:
        return _comments("#", _NO_CLOCK)
    clock_hz = ceil(content.clocks_per_tick * content.schedule.update_rate_hz)
    return [
        *_comments("#", _PORT.format(name=content.name), _GENERATED),
        f'FREQUENCY PORT "clock" {clock_hz // 10**6}.{clock_hz % 10**6:06d} MHz ;',
    ]


def _build_files(content: Content) -> dict[str, list[str]]:
    """Return the files of the build that a tool reads, by their ending."""
    runtime = [*packaged_modules(content), *(path.name for path in FORMAT.runtime())]
    written = sorted(VERILOG.files(content))
    modules = [*(each for each in written if each.endswith(".v")), *sorted(runtime)]
    return {ending: [each for each in written if each.endswith(ending)] for ending in (".vh", ".mem")} | {".v": modules}


def _tcl_list(variable: str, names: Iterable[str]) -> list[str]:
    return [f"set {variable} {{", *(f"    {each}" for each in names), "}"]


_FOLDER = "set folder [file dirname [file normalize [info script]]]"


def _vivado(content: Content) -> list[str]:
    files = _build_files(content)
    return [
        "# Adds the build to the open project: source it in the Tcl console, or in a script.",
        _FOLDER,
        *_tcl_list("sources", [*files[".v"], *files[".vh"], *files[".mem"]]),
        "foreach name $sources {",
        "    add_files -norecurse -fileset [current_fileset] [file join $folder $name]",
        "}",
        "set_property include_dirs \\",
        "    [concat [get_property include_dirs [current_fileset]] [list $folder]] [current_fileset]",
        f"add_files -norecurse -fileset [current_fileset -constrset] [file join $folder {content.name}.xdc]",
    ]


def _quartus(content: Content) -> list[str]:
    files = _build_files(content)
    return [
        "# Adds the build to the open project: source it in the Tcl console, in a script, or in the .qsf.",
        "# SYNTHESIS tells dac_boot that this is no simulation.",
        _FOLDER,
        *_tcl_list("sources", files[".v"]),
        "foreach name $sources {",
        "    set_global_assignment -name VERILOG_FILE [file join $folder $name]",
        "}",
        *_tcl_list("others", [*files[".vh"], *files[".mem"]]),
        "foreach name $others {",
        "    set_global_assignment -name MISC_FILE [file join $folder $name]",
        "}",
        "set_global_assignment -name SEARCH_PATH $folder",
        'set_global_assignment -name VERILOG_MACRO "SYNTHESIS=1"',
        f"set_global_assignment -name SDC_FILE [file join $folder {content.name}_quartus.sdc]",
    ]
