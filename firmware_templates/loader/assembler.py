"""Assemble the program of the loader's processor into ``firmware_templates/verilog/dac_loader_program.v``.

``python firmware_templates/loader/assembler.py`` prints how long it is, ``--write`` writes the module. The instructions
are those of ``dac_loader_core.v``; a line is ``label: instruction operand ; comment``, ``.equ name, value``,
``.at address`` or ``.var name bytes``.
"""

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).parent
MODULE = HERE.parent / "verilog" / "dac_loader_program.v"
SOURCES = ("memory.s", "frames.s", "requests.s", "upload.s", "checks.s", "refusals.s")
MOST_WORDS = 1024
CALLS = 3  # that the processor remembers
ENDS = "refusals.s"  # whoever jumps into it has done with his callers
INPUTS = 0xE0

_COMPUTES = ("ld", "add", "sub", "cmp", "and", "xor", "st", "inc")
_JUMPS = {"jmp": 0, "jz": 1, "jnz": 2, "jc": 3, "jnc": 4, "call": 5}
_CONTROLS = {
    "ret": 1 << 0,
    "setp": 1 << 1,
    "restore": 1 << 2,
    "saveq": 1 << 3,
    "exchange": 1 << 2 | 1 << 3,
    "crc": 1 << 4,
    "write": 1 << 5,
    "setregion": 1 << 6,
    "request": 1 << 7,
    "send": 1 << 8,
}
_COMPUTE = re.compile(rf"({'|'.join(_COMPUTES)})(s?)([1-4]?)")


class Wrong(Exception):
    """A line cannot be assembled; says which and why."""


@dataclass
class Program:
    """``lines`` are instructions as they stand in the source, by address; ``names`` are labels, places and numbers."""

    lines: list[tuple[str, str]] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=dict)

    def words(self) -> list[int]:
        """Return the instructions, 16 bits each."""
        return [_encode(line, self.names, place) for line, place in self.lines]


def read(sources: Mapping[str, str]) -> Program:
    """Return the program of these sources, in their order."""
    program = Program()
    at = 0
    for source, text in sources.items():
        for number, whole in enumerate(text.splitlines(), 1):
            place = f"{source}:{number}"
            line = whole.partition(";")[0].strip()
            if label := re.match(r"(\w+):\s*", line):
                _define(program.names, label[1], len(program.lines), place)
                line = line[label.end() :]
            if directive := re.fullmatch(r"\.(equ|var|at)\s+(\w+)(?:,?\s*(\w+))?", line):
                kind, name, number_text = directive.groups()
                if kind == "at":
                    at = int(name, 0)
                elif kind == "equ":
                    _define(program.names, name, int(number_text, 0), place)
                else:
                    size = int(number_text, 0)
                    if at % min(size, 4):
                        raise Wrong(f"{place}: {name} crosses a word")
                    _define(program.names, name, at, place)
                    at += size
                    if at > INPUTS:
                        raise Wrong(f"{place}: no room for {name}")
            elif line:
                program.lines.append((line, place))
    return program


def _define(names: dict[str, int], name: str, value: int, place: str) -> None:
    if name in names:
        raise Wrong(f"{place}: {name} twice")
    names[name] = value


def _encode(line: str, names: Mapping[str, int], place: str) -> int:
    mnemonic, _, operand = line.partition(" ")
    operand = operand.strip()
    if mnemonic in _CONTROLS and not operand:
        return 0xE000 | _CONTROLS[mnemonic]
    if mnemonic in _JUMPS:
        return 0x8000 | _JUMPS[mnemonic] << 12 | _number(operand, names, place, MOST_WORDS)
    if mnemonic == "ldp":
        return 0xF000 | _number(operand, names, place, 1 << 12)
    found = _COMPUTE.fullmatch(mnemonic)
    if not found or not operand:
        raise Wrong(f"{place}: what is {line}?")
    operation, signed, size = _COMPUTES.index(found[1]), found[2], found[3]
    word = operation << 12
    if size == "":
        if signed or found[1] in ("st", "inc"):
            raise Wrong(f"{place}: how many bytes?")
        return word | (1 << 10 if operand == "a" else _number(operand.removeprefix("#"), names, place, 256))
    word |= (int(size) - 1) << 10
    if operand == "[p]":
        return word | (3 if signed else 2) << 8
    address = _number(operand, names, place, 256)
    if signed or (address >= INPUTS and found[1] in ("st", "inc")) or address % 4 + int(size) > 4:
        raise Wrong(f"{place}: not there: {line}")
    return word | 1 << 8 | address


def _number(text: str, names: Mapping[str, int], place: str, end: int) -> int:
    value = 0
    for part in text.split("+"):
        value += names[part] if part in names else _literal(part, place)
    if not 0 <= value < end:
        raise Wrong(f"{place}: {text} is {value}, beyond {end}")
    return value


def _literal(text: str, place: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise Wrong(f"{place}: what is {text}?") from None


def depth(program: Program) -> int:
    """How many calls are remembered at most, over every way through the program from its beginning."""
    names = program.names
    deepest: dict[int, int] = {}  # of calls at each instruction, at most
    ways = [(0, 0)]
    while ways:
        at, calls = ways.pop()
        if deepest.get(at, -1) >= calls:
            continue
        deepest[at] = calls
        mnemonic, _, operand = program.lines[at][0].partition(" ")
        if calls > 2 * CALLS:
            raise Wrong(f"{program.lines[at][1]}: calls without end")
        if mnemonic in _JUMPS:
            target = names[operand.strip()]
            # who ends there never returns
            ends = mnemonic != "call" and program.lines[target][1].startswith(ENDS)
            ways.append((target, 0 if ends else calls + (mnemonic == "call")))
        if mnemonic not in ("jmp", "ret"):
            ways.append((at + 1, calls))
    return max(deepest.values())


def module(words: list[int]) -> str:
    """Return the Verilog module."""
    rows = [words[at : at + 11] for at in range(0, len(words), 11)]
    text = ",\n".join("        " + ", ".join(f"16'h{word:04x}" for word in row) for row in rows)
    return f"""\
// The program of dac_loader_core. Made by firmware_templates/loader/assembler.py from the sources beside it.

`default_nettype none

module dac_loader_program #(
    parameter TARGET_BITS = 10
) (
    input  wire                   clock,
    input  wire                   enable,
    input  wire [TARGET_BITS-1:0] address,
    output reg  [15:0]            instruction
);
    localparam WORDS = {len(words)};
    localparam [16*WORDS-1:0] PROGRAM = {{
{text}
    }};

    reg [15:0] words [0:(1<<TARGET_BITS)-1];
    integer i;
    initial begin
        for (i = 0; i < 1 << TARGET_BITS; i = i + 1)
            words[i] = i < WORDS ? PROGRAM[16*(WORDS-1-i) +: 16] : 16'd0;
        instruction = 16'd0;
    end

    always @(posedge clock) if (enable) instruction <= words[address];

    // An illegal parameter stops the elaboration, by a module that does not exist: its name is the reason.
    generate
        if (TARGET_BITS != 10) begin : guard_0
            dac_loader_program_TARGET_BITS_is_not_10 stop ();
        end
    endgenerate
endmodule

`default_nettype wire
"""


def program() -> Program:
    """Read the sources as they are."""
    return read({name: (HERE / name).read_text("ascii") for name in SOURCES})


def assemble() -> str:
    """Return the module of the sources as they are."""
    made = program()
    words = made.words()
    if len(words) > MOST_WORDS:
        raise Wrong(f"{len(words)} instructions; at most {MOST_WORDS}")
    if (calls := depth(made)) > CALLS:
        raise Wrong(f"{calls} calls deep; at most {CALLS}")
    print(f"{len(words)} instructions, {calls} calls deep", file=sys.stderr)
    return module(words)


if __name__ == "__main__":
    text = assemble()
    if "--write" in sys.argv[1:]:
        MODULE.write_text(text, "ascii")
