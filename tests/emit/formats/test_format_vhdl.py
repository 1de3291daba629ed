"""The VHDL package against the manifest, as GHDL reads it."""

import re
from pathlib import Path

import pytest
from building import NAME, constants, run_clean
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted
from manifest_integers import memories
from sets import quick

ARRAYS = {
    "x": "X_TABLE",
    "x_fourier": "X_FOURIER",
    "y": "Y_TABLE",
    "y_fourier": "Y_FOURIER",
    "program": "PROGRAM_REGISTERS",
    "sine": "SINE_QUARTER",
}
WIDE = ("UPDATE_RATE_MILLIHZ", "X_PHASE_STEP", "Y_PHASE_STEP", "X_OFFSET_WORD", "Y_OFFSET_WORD")
# Prints every constant and every word.
BENCH = """
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
use work.{name}_pkg.all;

entity bench is
end entity;

architecture printing of bench is
  procedure tell(name : string; value : string) is
    variable text : line;
  begin
    write(text, name & " " & value);
    writeline(output, text);
  end procedure;
  function bits(value : std_logic_vector) return string is
    variable found : string(1 to value'length);
    variable at : positive := 1;
  begin
    for i in value'range loop
      if value(i) = '1' then
        found(at) := '1';
      else
        found(at) := '0';
      end if;
      at := at + 1;
    end loop;
    return found;
  end function;
begin
  process
  begin
{statements}
    wait;
  end process;
end architecture;
"""


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("vhdl"), request.param, "vhdl")


def printed(built: Formatted, folder: Path, standard: str) -> dict[str, list[str]]:
    """What GHDL says of each constant and word."""
    manifest = built.manifest
    statements = ['tell("HASH", bits(HASH));']
    for key in constants(manifest):
        value = f"bits(std_logic_vector({key}))" if key in WIDE else f"integer'image({key})"
        statements.append(f'tell("{key}", {value});')
    for memory in memories(manifest):
        array = ARRAYS[memory]
        value = f"bits({array}(i))" if memory == "program" else f"integer'image({array}(i))"
        statements.append(f'for i in {array}\'range loop tell("{array}", {value}); end loop;')
    (folder / "bench.vhd").write_text(BENCH.format(name=NAME, statements="\n".join(statements)), "ascii")
    options = [f"--std={standard}", f"--workdir={folder}"]
    for file in (built.folder / f"{NAME}_pkg.vhd", folder / "bench.vhd"):
        assert run_clean(["ghdl", "-a", *options, file], folder) == ""
    run_clean(["ghdl", "-e", *options, "bench"], folder)
    found: dict[str, list[str]] = {}
    for line in run_clean(["ghdl", "-r", *options, "bench"], folder).splitlines():
        name, value = line.split()
        found.setdefault(name, []).append(value)
    return found


@pytest.mark.rest
@pytest.mark.parametrize("standard", ["93", "08"])
def test_ghdl_reads_the_numbers_of_the_manifest(built: Formatted, tmp_path: Path, standard: str) -> None:
    found, manifest = printed(built, tmp_path, standard), built.manifest
    assert f"{int(found.pop('HASH')[0], 2):064x}" == manifest["hash"]
    for key, value in constants(manifest).items():
        (text,) = found.pop(key)
        assert (int(text, 2) - (int(text[0]) << 64) if key in WIDE else int(text)) == value, key
    for name, (words, _) in memories(manifest).items():
        assert [int(text, 2 if name == "program" else 10) for text in found.pop(ARRAYS[name])] == words, name
    assert found == {}


def test_a_word_has_the_range_of_its_bits(built: Formatted) -> None:
    text = built.file("_pkg.vhd").decode("ascii")
    for axis in "xy":
        half = 2 ** (built.manifest["axes"][axis]["table"]["bits"] - 1)
        assert f"subtype {axis}_word is integer range -{half} to {half - 1};" in text


def test_a_table_of_one_word_is_still_a_table() -> None:
    from tablegen.emit.formats.vhdl import _array
    from tablegen.emit.memory import Memory

    assert _array(Memory("y", [-3], 16, ""))["rows"] == ["0 => -3"]


def test_no_line_is_too_long_for_a_tool(built: Formatted) -> None:
    assert max(map(len, built.file("_pkg.vhd").splitlines())) <= 160


def test_the_hash_of_the_plan_is_in_it(built: Formatted) -> None:
    text = built.file("_pkg.vhd").decode("ascii")
    assert re.findall(r'constant HASH : .*x"(\w+)"', text) == [built.manifest["hash"]]


def test_a_changed_word_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "vhdl"), "vhdl", [f"{NAME}_pkg.vhd"])
