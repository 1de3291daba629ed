"""A VHDL-93 package: constants, and tables as arrays of integers in the range of their words."""

from tablegen.emit.constants import is_wide, scan_constants
from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.memory import Memory, memories
from tablegen.emit.templates import comment_safe, rows, template_text
from tablegen.fixedpoint.rounding import signed_limits

_PACKAGE = """\
-- {{ name }}: compensated scan waveforms, made by tablegen {{ version }}. Do not edit; change the TOML and build again.
-- Scanner: {{ scanner }}
--
{% for line in summary %}
--{{ " " ~ line if line else "" }}
{% endfor %}
--
-- plan {{ hash }}
--
-- Constants that may need more than 32 bits are signed(63 downto 0). Fourier words come in the order a0, a1..aH,
-- b1..bH, in Q2.30. program_registers are those of dac_sequencer, which the format "verilog" writes; sine_quarter
-- renders its tables.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package {{ name }}_pkg is

  subtype x_word is integer range {{ x_low | literal }} to {{ x_high | literal }};
  subtype y_word is integer range {{ y_low | literal }} to {{ y_high | literal }};
  type x_words is array (natural range <>) of x_word;
  type y_words is array (natural range <>) of y_word;
  type fourier_words is array (natural range <>) of integer;
  type register_words is array (natural range <>) of std_logic_vector(31 downto 0);

  constant HASH : std_logic_vector(255 downto 0) := x"{{ hash }}";

{% for key, value in constants.items() %}
  constant {{ key }} : {{ key | type }} := {{ value | wide if key | is_wide else value | literal }};
{% endfor %}
{% for array in arrays %}

  constant {{ array.name }} : {{ array.type }}(0 to {{ array.last }}) := (
{% for row in array.rows %}
    {{ row }}{{ "," if not loop.last else "" }}
{% endfor %}
  );
{% endfor %}

end package {{ name }}_pkg;
"""
# Memories by their names and types in the package.
_ARRAYS = {
    "x": ("X_TABLE", "x_words"),
    "x_fourier": ("X_FOURIER", "fourier_words"),
    "y": ("Y_TABLE", "y_words"),
    "y_fourier": ("Y_FOURIER", "fourier_words"),
    "program": ("PROGRAM_REGISTERS", "register_words"),
    "sine": ("SINE_QUARTER", "fourier_words"),
}


class Vhdl(Format):
    """The format vhdl: ``NAME_pkg.vhd``."""

    name = "vhdl"
    purpose = "VHDL-93 package: constants, and tables as arrays"
    file_names = "NAME_pkg.vhd"
    comment = "--"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the package."""
        (x_low, x_high), (y_low, y_high) = (signed_limits(axis.program.bits) for axis in content.axes)
        context = {
            "version": content.version,
            "name": content.name,
            "hash": content.hash,
            "scanner": comment_safe(content.scanner),
            "summary": content.summary,
            "x_low": x_low,
            "x_high": x_high,
            "y_low": y_low,
            "y_high": y_high,
            "constants": scan_constants(content),
            "arrays": [_array(memory) for memory in memories(content)],
        }
        package = template_text(_PACKAGE, context, str, type=_type, wide=wide, is_wide=is_wide)
        return {f"{content.name}_pkg.vhd": package}


FORMAT = Vhdl()


def wide(value: int) -> str:
    """Spell an integer as 64 bits: VHDL's own integers end at 2^31 - 1."""
    return f'x"{value & (1 << 64) - 1:016x}"'


def _type(name: str) -> str:
    """Return the type of a constant, by its name alone: the same in every build."""
    return "signed(63 downto 0)" if is_wide(name) else "integer"


def _array(memory: Memory) -> dict[str, object]:
    name, kind = _ARRAYS[memory.name]
    if memory.name == "program":
        words = [f'x"{digits}"' for digits in memory.hexadecimal()]
    else:
        words = [str(word) for word in memory.words]
    if len(words) == 1:  # which would otherwise be a word in parentheses
        words = [f"0 => {words[0]}"]
    return {"name": name, "type": kind, "last": len(memory.words) - 1, "rows": rows(words)}
