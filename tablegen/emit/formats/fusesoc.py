"""A core description for FuseSoC, in its CAPI 2, which names the files of the Verilog format."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.verilog import FORMAT as VERILOG
from tablegen.emit.formats.verilog import packaged_modules


class FuseSoC(Format):
    """The format fusesoc: ``NAME.core``, which makes ``NAME_top`` a core that others depend on."""

    name = "fusesoc"
    purpose = "core of FuseSoC: NAME_top of the format verilog, with all its files, as tablegen::NAME"
    file_names = "NAME.core"
    needs = ("verilog",)
    comment = "#"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the core."""
        name = content.name
        written = sorted(VERILOG.files(content))
        sources = [*(each for each in written if each.endswith(".v")), *packaged_modules(content)]
        lines = [
            "CAPI=2:",
            f"# {name}, tablegen {content.version}, build {content.hash}",
            f"name: tablegen::{name}",
            f"description: Scan {name}, played by its sequencer",
            "filesets:",
            "  rtl:",
            "    files:",
            *(f"      - {each}: {{is_include_file: true}}" for each in written if each.endswith(".vh")),
            *(f"      - {each}" for each in sources),
            "    file_type: verilogSource-2005",
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
        return {f"{name}.core": ("\n".join(lines) + "\n").encode("ascii")}


FORMAT = FuseSoC()
