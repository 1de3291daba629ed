"""A SystemVerilog package: constants, and tables as unpacked arrays of signed words."""

from tablegen.emit.constants import is_wide, scan_constants
from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.memory import Memory, memories
from tablegen.emit.templates import comment_safe, rows, template_text

_PACKAGE = """\
// {{ name }}: compensated scan waveforms, made by tablegen {{ version }}. Do not edit; change the TOML and build again.
// Scanner: {{ scanner }}
//
{% for line in summary %}
//{{ " " ~ line if line else "" }}
{% endfor %}
//
// plan {{ hash }}
//
// Use it as {{ name }}_pkg::X_TABLE[i]. Fourier words come in the order a0, a1..aH, b1..bH, in Q2.30. PROGRAM_REGISTERS
// are the 48 registers of dac_sequencer, which the format "verilog" writes; SINE_QUARTER renders its tables.

package {{ name }}_pkg;

  localparam logic [255:0] HASH = 256'h{{ hash }};

{% for key, value in constants.items() %}
  localparam {{ key | type }} {{ key }} = {{ value | literal }};
{% endfor %}
{% for array in arrays %}

  localparam {{ array.type }} {{ array.name }} [0:{{ array.last }}] = '{
{% for row in array.rows %}
    {{ row }}{{ "," if not loop.last else "" }}
{% endfor %}
  };
{% endfor %}

endpackage
"""
# Memories by their names in the package.
ARRAYS = {
    "x": "X_TABLE",
    "x_fourier": "X_FOURIER",
    "y": "Y_TABLE",
    "y_fourier": "Y_FOURIER",
    "program": "PROGRAM_REGISTERS",
    "sine": "SINE_QUARTER",
}


class SystemVerilog(Format):
    """The format systemverilog: ``NAME_pkg.sv``."""

    name = "systemverilog"
    purpose = "SystemVerilog package: constants, and tables as arrays"
    file_names = "NAME_pkg.sv"
    comment = "//"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the package."""
        context = {
            "version": content.version,
            "name": content.name,
            "hash": content.hash,
            "scanner": comment_safe(content.scanner),
            "summary": content.summary,
            "constants": scan_constants(content),
            "arrays": [_array(memory) for memory in memories(content)],
        }
        return {f"{content.name}_pkg.sv": template_text(_PACKAGE, context, literal, type=_type)}


FORMAT = SystemVerilog()


def literal(value: int) -> str:
    """Spell an integer, with a size where it needs more than 32 bits."""
    if -0x7FFFFFFF <= value <= 0x7FFFFFFF:
        return str(value)
    return f"64'sd{value}" if value >= 0 else f"-64'sd{-value}"


def _type(name: str) -> str:
    """Return the type of a constant, by its name alone: the same in every build."""
    return "longint" if is_wide(name) else "int"


def _array(memory: Memory) -> dict[str, object]:
    signed = memory.name != "program"
    prefix = f"{memory.bits}'{'s' if signed else ''}h"
    return {
        "name": ARRAYS[memory.name],
        "type": f"logic {'signed ' if signed else ''}[{memory.bits - 1}:0]",
        "last": len(memory.words) - 1,
        "rows": rows([prefix + digits for digits in memory.hexadecimal()]),
    }
