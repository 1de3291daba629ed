"""Make the address decoder, the constants for Verilog and C, IP-XACT, the TOML of hdl-registers, and the page.

All are made of dac_registers.rdl.

``python firmware_templates/verilog/bus/make_registers.py`` names the files that are not up to date, ``--write`` writes
them. SystemRDL is read by systemrdl-compiler, which is in the extra ``test``.
"""

import json
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from systemrdl import RDLCompiler
from systemrdl.node import AddrmapNode, FieldNode, MemNode, RegNode

HERE = Path(__file__).parent
SOURCE = HERE / "dac_registers.rdl"
PAGE = HERE.parents[2] / "docs" / "registers.md"
BEGIN, END = "<!-- registers -->\n", "<!-- /registers -->\n"
MADE = f"Made by make_registers.py from {SOURCE.name}: do not edit."
ADDRESS_BITS = 20
WORD_BYTES = 4
IP_XACT = "http://www.accellera.org/XMLSchema/IPXACT/1685-2014"


@dataclass(frozen=True)
class Field:
    """Bits ``high`` to ``low`` of a register; ``constant`` is what they always read, None if hardware decides."""

    name: str
    text: str
    high: int
    low: int
    constant: int | None
    clears: bool

    @property
    def bits(self) -> int:
        """The number of bits."""
        return self.high - self.low + 1

    @property
    def mask(self) -> int:
        """The bits of the field in its register."""
        return (1 << self.bits) - 1 << self.low


@dataclass(frozen=True)
class Register:
    """A register at a byte address, with its fields from the lowest bit up."""

    name: str
    text: str
    address: int
    readable: bool
    writable: bool
    fields: tuple[Field, ...]

    @property
    def mask(self) -> int:
        """The bits that a field has."""
        return sum(field.mask for field in self.fields)

    @property
    def access(self) -> str:
        """The access, as the page names it."""
        if any(field.clears for field in self.fields):
            return "read, 1 clears"
        return {(True, False): "read", (False, True): "write", (True, True): "read, write"}[
            self.readable, self.writable
        ]


@dataclass(frozen=True)
class Memory:
    """``words`` words of 32 bits from a byte address on, which are only written."""

    name: str
    text: str
    address: int
    words: int

    @property
    def index_bits(self) -> int:
        """The bits of the number of a word."""
        return (self.words - 1).bit_length()


@dataclass(frozen=True)
class Map:
    """All registers and memories, in order of address."""

    registers: tuple[Register, ...]
    memories: tuple[Memory, ...]


def read_map(source: Path = SOURCE) -> Map:
    """Read the SystemRDL file.

    Raises
    ------
    ValueError
        If the map has what the RTL does not serve.
    """
    compiler = RDLCompiler()
    compiler.compile_file(str(source))
    top = compiler.elaborate().top
    assert isinstance(top, AddrmapNode)
    nodes = list(top.children(unroll=True))
    registers = tuple(_register(node) for node in nodes if isinstance(node, RegNode))
    memories = tuple(_memory(node) for node in nodes if isinstance(node, MemNode))
    if len(registers) + len(memories) != len(nodes):
        raise ValueError(f"{source.name}: has more than registers and memories")
    return Map(registers, memories)


def _text(node: RegNode | MemNode | FieldNode) -> str:
    return " ".join(str(node.get_property("desc")).split())


def _register(node: RegNode) -> Register:
    fields = tuple(_field(field) for field in node.fields())
    if node.get_property("regwidth") != 8 * WORD_BYTES or node.absolute_address % WORD_BYTES:
        raise ValueError(f"{node.inst_name}: is no register of 32 bits at a multiple of 4")
    readable = {field.is_sw_readable for field in node.fields()}
    writable = {field.is_sw_writable for field in node.fields()}
    if len(readable) != 1 or len(writable) != 1:
        raise ValueError(f"{node.inst_name}: has fields of different access")
    return Register(node.inst_name, _text(node), node.absolute_address, readable.pop(), writable.pop(), fields)


def _field(node: FieldNode) -> Field:
    reset = node.get_property("reset")
    constant = int(reset) if reset is not None and not node.is_hw_writable and not node.is_sw_writable else None
    clears = node.get_property("onwrite") is not None and node.get_property("onwrite").name == "woclr"
    return Field(node.inst_name, _text(node), node.high, node.low, constant, clears)


def _memory(node: MemNode) -> Memory:
    memory = Memory(node.inst_name, _text(node), node.absolute_address, int(node.get_property("mementries")))
    if memory.address % (WORD_BYTES << memory.index_bits):
        raise ValueError(f"{memory.name}: does not begin at a multiple of its size")
    if node.is_sw_readable or node.get_property("memwidth") != 8 * WORD_BYTES:
        raise ValueError(f"{memory.name}: has to be of 32 bits, and written only")
    return memory


def verilog_header(registers: Map) -> str:
    """Return ``dac_registers.vh``: byte addresses, numbers of words, bits and widths of fields."""
    lines = [f"// Registers of dac_axi_lite and dac_wishbone, for test benches. {MADE}"]
    lines += [f"localparam {name} = {width}'h{value:0{width // 4}X};" for name, value, width in _constants(registers)]
    return "\n".join(lines) + "\n"


def c_header(registers: Map) -> str:
    """Return ``dac_registers.h``: the same constants as unsigned numbers of 32 bits."""
    lines = [
        f"/* Registers of dac_axi_lite and dac_wishbone. {MADE}",
        " * Addresses are in bytes from the base of the device; every access is one of 32 bits. */",
        "#ifndef DAC_REGISTERS_H",
        "#define DAC_REGISTERS_H",
        "",
    ]
    lines += [f"#define {name} 0x{value:0{width // 4}X}u" for name, value, width in _constants(registers)]
    return "\n".join([*lines, "", "#endif"]) + "\n"


def _constants(registers: Map) -> Iterator[tuple[str, int, int]]:
    """Yield the name, the value and the bits of each constant."""
    for register in registers.registers:
        name = f"DAC_{register.name.upper()}"
        yield f"{name}_ADDRESS", register.address, 32
        for field in register.fields:
            if len(register.fields) > 1 or field.bits < 32:
                yield f"{name}_{field.name.upper()}_SHIFT", field.low, 32
                yield f"{name}_{field.name.upper()}_MASK", field.mask, 32
            if field.constant is not None:
                yield f"{name}_{field.name.upper()}", field.constant, 32
    for memory in registers.memories:
        yield f"DAC_{memory.name.upper()}_ADDRESS", memory.address, 32
        yield f"DAC_{memory.name.upper()}_WORDS", memory.words, 32


def verilog_map(registers: Map) -> str:
    """Return ``dac_bus_map.v``: the decoder of addresses, and what a read gives."""
    read = [register for register in registers.registers if register.readable]
    written = [register for register in registers.registers if register.writable]
    ports = [
        f"input  wire [{ADDRESS_BITS - 1}:0] address,",
        "input  wire        write,        // or a read",
        "input  wire [31:0] data,         // of a write",
    ]
    ports += [f"input  wire {_range(field)} {_port(one, field)}," for one in read for field in _variable(one)]
    ports += [f"output wire        write_{one.name}," for one in written]
    ports += [f"output wire        in_{memory.name}," for memory in registers.memories]
    ports += [
        "output wire [15:0] word,         // number of a word in its memory",
        "output wire        legal,        // the map has this access",
        "output reg  [31:0] value         // of a register; 0 if the map has no such read",
    ]
    lines = [
        "// The address decoder of dac_bus.",
        f"// {MADE}",
        "",
        "`default_nettype none",
        "",
        "module dac_bus_map (",
        *(f"    {port}" for port in ports),
        ");",
    ]
    for register in written:
        unused = 0xFFFFFFFF & ~register.mask
        reserved = f" && (data & 32'h{unused:08X}) == 32'd0" if unused else ""
        lines.append(f"    assign write_{register.name} = write && address == {_address(register.address)}{reserved};")
    for memory in registers.memories:
        lines += _window(memory)
    largest = max(memory.index_bits for memory in registers.memories)
    terms = [f"write_{one.name}" for one in written] + [f"in_{memory.name}" for memory in registers.memories]
    lines += [
        f"    assign word ={_numbers(registers.memories, largest)};",
        "    reg readable;",
        "    assign legal = (!write && readable) ||",
        *_joined(terms),
        "",
        "    always @* begin",
        "        readable = 1'b1;",
        "        case (address)",
        *(f"            {_address(one.address)}: value = {_value(one)};" for one in read),
        "            default: begin",
        "                value = 32'd0;",
        "                readable = 1'b0;",
        "            end",
        "        endcase",
        "    end",
        "endmodule",
        "",
        "`default_nettype wire",
    ]
    return "\n".join(lines) + "\n"


def _variable(register: Register) -> list[Field]:
    return [field for field in register.fields if field.constant is None]


def _range(field: Field) -> str:
    return ("" if field.bits == 1 else f"[{field.bits - 1}:0]").ljust(6)


def _port(register: Register, field: Field) -> str:
    return register.name if len(register.fields) == 1 else f"{register.name}_{field.name}"


def _address(address: int) -> str:
    return f"{ADDRESS_BITS}'h{address:0{ADDRESS_BITS // 4}X}"


def _window(memory: Memory) -> list[str]:
    """Return the comparison of an address with a memory; addresses are multiples of 4."""
    low = memory.index_bits + 2
    high = f"address[{ADDRESS_BITS - 1}:{low}] == {ADDRESS_BITS - low}'d{memory.address >> low}"
    tests = ["write", "address[1:0] == 2'd0", high]
    if memory.words != 1 << memory.index_bits:
        tests.append(f"address[{low - 1}:2] < {memory.index_bits}'d{memory.words}")
    return [f"    assign in_{memory.name} = {' && '.join(tests)};"]


def _numbers(memories: Sequence[Memory], largest: int) -> str:
    """Return the number of a word: the bits of the address below its memory."""
    parts = [
        f"in_{memory.name} ? {{{16 - memory.index_bits}'d0, address[{memory.index_bits + 1}:2]}} :"
        for memory in memories
        if memory.index_bits != largest
    ]
    separator = "\n        "
    return separator + separator.join([*parts, f"address[{largest + 1}:2]"])


def _joined(terms: Sequence[str]) -> list[str]:
    lines = [f"        {' || '.join(terms[at : at + 4])}" for at in range(0, len(terms), 4)]
    return [f"{line} ||" for line in lines[:-1]] + [f"{lines[-1]};"]


def _value(register: Register) -> str:
    """Return the concatenation of the fields of a register, and 0 between them."""
    parts, at = [], 0
    for field in register.fields:
        if field.low > at:
            parts.append(f"{field.low - at}'d0")
        known = field.constant is not None
        parts.append(f"{field.bits}'h{field.constant:X}" if known else _port(register, field))
        at = field.high + 1
    if at < 32:
        parts.append(f"{32 - at}'d0")
    if len(parts) == 1:
        return parts[0]
    text = ", ".join(reversed(parts))
    if len(text) < 80:
        return f"{{{text}}}"
    half = len(parts) // 2
    upper, lower = ", ".join(reversed(parts[half:])), ", ".join(reversed(parts[:half]))
    return f"{{\n                {upper},\n                {lower}\n            }}"


def ip_xact(registers: Map) -> str:
    """Return ``dac_registers.xml``: a component of IEEE 1685-2014 with the registers and the memories as its map."""
    component = ET.Element("ipxact:component", {"xmlns:ipxact": IP_XACT})
    _texts(component, vendor="piezo-tablegen", library="dac", name="dac_registers", version=_version(registers))
    memory_map = ET.SubElement(ET.SubElement(component, "ipxact:memoryMaps"), "ipxact:memoryMap")
    _texts(memory_map, name="dac_registers")
    span = max(one.address for one in registers.registers) + WORD_BYTES
    block = _block(memory_map, "registers", "Registers.", 0, span)
    _texts(block, usage="register")
    for register in registers.registers:
        _ip_xact_register(block, register)
    for memory in registers.memories:
        block = _block(memory_map, memory.name, memory.text, memory.address, WORD_BYTES * memory.words)
        _texts(block, usage="memory", access="write-only")
    _texts(memory_map, addressUnitBits="8")
    _texts(component, description=MADE)
    ET.indent(component)
    return ET.tostring(component, "unicode", xml_declaration=True) + "\n"


def _texts(parent: ET.Element, **texts: str) -> None:
    for name, text in texts.items():
        ET.SubElement(parent, f"ipxact:{name}").text = text


def _version(registers: Map) -> str:
    (field,) = next(one.fields for one in registers.registers if one.name == "version")
    return str(field.constant)


def _block(parent: ET.Element, name: str, text: str, address: int, span: int) -> ET.Element:
    block = ET.SubElement(parent, "ipxact:addressBlock")
    _texts(block, name=name, description=text, baseAddress=f"'h{address:X}", range=f"'h{span:X}", width="32")
    return block


def _ip_xact_register(block: ET.Element, register: Register) -> None:
    element = ET.SubElement(block, "ipxact:register")
    _texts(element, name=register.name, description=register.text, addressOffset=f"'h{register.address:X}", size="32")
    access = {(True, False): "read-only", (False, True): "write-only", (True, True): "read-write"}
    _texts(element, access=access[register.readable, register.writable])
    for field in register.fields:
        own = ET.SubElement(element, "ipxact:field")
        _texts(own, name=field.name, description=field.text, bitOffset=str(field.low))
        if field.constant is not None:
            reset = ET.SubElement(ET.SubElement(own, "ipxact:resets"), "ipxact:reset")
            _texts(reset, value=f"'h{field.constant:X}")
        _texts(own, bitWidth=str(field.bits))
        if field.clears:
            _texts(own, modifiedWriteValue="oneToClear")


def hdl_registers(registers: Map) -> str:
    """Return ``dac_registers.toml``: the registers for the package hdl-registers, and the memories as constants.

    It gives each register the next address, so that the registers of the map have to stand without a gap.

    Raises
    ------
    ValueError
        If there is a gap between two registers.
    """
    lines = [f"# Registers of dac_axi_lite and dac_wishbone, for hdl-registers. {MADE}"]
    for at, register in enumerate(registers.registers):
        if register.address != WORD_BYTES * at:
            raise ValueError(f"{register.name}: hdl-registers has no gap before a register")
        lines += _table(register.name, mode=_mode(register), description=register.text)
        unused = 0
        for field in register.fields:
            if field.low > unused:
                lines += _vector(f"{register.name}.unused_{unused}", field.low - unused, "No field.")
            unused = field.high + 1
            name = f"{register.name}.{field.name}"
            if field.bits == 1:
                lines += _table(name, type="bit", description=field.text)
            else:
                lines += _vector(name, field.bits, field.text, field.constant)
    for memory in registers.memories:
        lines += _table(f"{memory.name}_address", type="constant", value=memory.address, description=memory.text)
        lines += _table(f"{memory.name}_words", type="constant", value=memory.words, description="Words of 32 bits.")
    return "\n".join(lines) + "\n"


def _mode(register: Register) -> str:
    """Return the mode: a bit that 1 clears, and a request, are pulses."""
    if any(field.clears for field in register.fields):
        return "r_wpulse"
    if not register.readable:
        return "wpulse"
    return "r_w" if register.writable else "r"


def _vector(name: str, bits: int, text: str, default: int | None = None) -> list[str]:
    known = {} if default is None else {"default_value": default}
    return _table(name, type="bit_vector", width=bits, description=text, **known)


def _table(name: str, **values: str | int) -> list[str]:
    return ["", f"[{name}]", *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items())]


def page_tables(registers: Map) -> str:
    """Return the tables of the page."""
    lines = ["| address | register | access | purpose |", "|---|---|---|---|"]
    for one in registers.registers:
        lines.append(f"| 0x{one.address:05X} | [`{one.name}`](#{one.name}) | {one.access} | {one.text} |")
    lines += ["", "| addresses | memory | access | purpose |", "|---|---|---|---|"]
    for memory in registers.memories:
        last = memory.address + WORD_BYTES * memory.words - WORD_BYTES
        lines.append(f"| 0x{memory.address:05X} to 0x{last:05X} | `{memory.name}` | write | {memory.text} |")
    for one in registers.registers:
        lines += ["", f"### {one.name}", "", f"0x{one.address:05X}, {one.access}.", ""]
        lines += ["| bits | field | meaning |", "|---|---|---|"]
        for field in one.fields:
            bits = f"{field.low}" if field.bits == 1 else f"{field.high}:{field.low}"
            constant = f" 0x{field.constant:08X}." if field.constant is not None else ""
            lines.append(f"| {bits} | `{field.name}` | {field.text}{constant} |")
    return "\n".join(lines) + "\n"


def made_files(registers: Map) -> dict[Path, str]:
    """Return the text of every file that is made of the map, by path."""
    before, begin, rest = PAGE.read_text("utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"{PAGE.name}: has no place for the tables")
    return {
        HERE / "dac_bus_map.v": verilog_map(registers),
        HERE / "dac_registers.vh": verilog_header(registers),
        HERE / "dac_registers.h": c_header(registers),
        HERE / "dac_registers.xml": ip_xact(registers),
        HERE / "dac_registers.toml": hdl_registers(registers),
        PAGE: f"{before}{begin}{page_tables(registers)}{end}{after}",
    }


def main() -> int:
    """Compare the files with the map, or write them."""
    old = {
        path: text
        for path, text in made_files(read_map()).items()
        if not path.is_file() or path.read_text("utf-8") != text
    }
    for path, text in old.items():
        if "--write" in sys.argv[1:]:
            path.write_text(text, "utf-8")
        print(path.name)
    return int(bool(old) and "--write" not in sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
