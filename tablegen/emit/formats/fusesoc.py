"""Core descriptions for FuseSoC, in its CAPI 2, which name the files of the Verilog format.

The modules of the sequencer are cores of their own, of which a design with several scans takes one each.
"""

from collections.abc import Sequence

from tablegen.base.resources import verilog_by_turns, verilog_slow_part
from tablegen.emit.package import VerilogPackage
from tablegen.emit.package_format import PackageOfVerilog


class FuseSoC(PackageOfVerilog):
    """The format fusesoc: ``NAME.core``, which makes ``NAME_top`` a core that others depend on, and those it needs."""

    name = "fusesoc"
    purpose = "core of FuseSoC: NAME_top of the format verilog, with all its files, as tablegen::NAME"
    file_names = "NAME.core, tablegen.dac*.core"
    comment = "#"

    def package_files(self, package: VerilogPackage) -> dict[str, bytes]:
        """Render the core, and those of the modules of the sequencer."""
        name = package.name
        written = package.written
        runtime = _runtime_cores(package.modules)
        lines = [
            "CAPI=2:",
            f"# {name}, tablegen {package.version}, build {package.hash}",
            f"name: tablegen::{name}",
            f"description: Scan {name}, played by its sequencer",
            "filesets:",
            "  rtl:",
            "    files:",
            *(f"      - {each}: {{is_include_file: true}}" for each in written if each.endswith(".vh")),
            *(f"      - {each}" for each in written if each.endswith(".v")),
            "    file_type: verilogSource-2005",
            "    depend:",
            *(f"      - {_vlnv(core, package.version)}" for core in runtime),
            "  # $readmemh looks in the folder where the tool runs.",
            "  memories:",
            "    files:",
            *(f"      - {each}: {{copyto: {each}}}" for each in written if each.endswith(".mem")),
            "    file_type: user",
            "targets:",
            "  default: &default",
            "    filesets: [rtl, memories]",
            f"    toplevel: {name}_top",
            "  lint:",
            "    <<: *default",
            "    flow: lint",
            "    flow_options: {tool: verilator}",
        ]
        cores = {
            f"tablegen.{core}.core": _runtime_core(core, modules, package.version) for core, modules in runtime.items()
        }
        return {f"{name}.core": ("\n".join(lines) + "\n").encode("ascii"), **cores}


def _vlnv(core: str, version: str) -> str:
    """Return the name of a core of the runtime by which others depend on it."""
    return f"tablegen:runtime:{core}:{version}"


def _runtime_cores(modules: Sequence[str]) -> dict[str, list[str]]:
    """Return the modules of the sequencer by the core that has them; each core has the same ones in every build."""
    parts = {"dac_slow": verilog_slow_part(), "dac_pair": verilog_by_turns()}
    core_of = {path.name: core for core, paths in parts.items() for path in paths}
    cores: dict[str, list[str]] = {}
    for module in modules:
        cores.setdefault(core_of.get(module, "dac"), []).append(module)
    return cores


def _runtime_core(core: str, modules: Sequence[str], version: str) -> bytes:
    """Render a core of the runtime."""
    lines = [
        "CAPI=2:",
        f"# tablegen {version}; every build of this version has the same core",
        f"name: {_vlnv(core, version)}",
        "description: Modules of the sequencer that plays scans of tablegen",
        "filesets:",
        "  rtl:",
        "    files:",
        *(f"      - {each}" for each in modules),
        "    file_type: verilogSource-2005",
        "targets:",
        "  default:",
        "    filesets: [rtl]",
    ]
    return ("\n".join(lines) + "\n").encode("ascii")


FORMAT = FuseSoC()
