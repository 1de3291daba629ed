"""Names of scans against the languages in which they become parts of identifiers.

The lists below are the keyword tables of the standards: C11 (6.4.1) with C23's additions, C++17 (lex.key, lex.digraph)
with C++20's, Verilog-2005 and SystemVerilog-2017 (annex B), VHDL-2008 (15.10). Real compilers vouch for the lists, and
for the names that are accepted.
"""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from building import run
from sets import by_tool

from tablegen.base.resources import c_link, c_runtime, c_store, verilog_runtime
from tablegen.config.names import of_the_runtime, why_not_a_name

C = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
"""
C23 = "alignas alignof bool constexpr false nullptr static_assert thread_local true typeof typeof_unqual"
CPP = """
alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t class compl const
const_cast constexpr continue decltype default delete do double dynamic_cast else enum explicit export extern false
float for friend goto if inline int long mutable namespace new noexcept not not_eq nullptr operator or or_eq private
protected public register reinterpret_cast return short signed sizeof static static_assert static_cast struct switch
template this thread_local throw true try typedef typeid typename union unsigned using virtual void volatile wchar_t
while xor xor_eq
"""
CPP20 = "char8_t co_await co_return co_yield concept consteval constinit requires"
VERILOG = """
always and assign automatic begin buf bufif0 bufif1 case casex casez cell cmos config deassign default defparam design
disable edge else end endcase endconfig endfunction endgenerate endmodule endprimitive endspecify endtable endtask
event for force forever fork function generate genvar highz0 highz1 if ifnone incdir include initial inout input
instance integer join large liblist library localparam macromodule medium module nand negedge nmos nor noshowcancelled
not notif0 notif1 or output parameter pmos posedge primitive pull0 pull1 pulldown pullup pulsestyle_ondetect
pulsestyle_onevent rcmos real realtime reg release repeat rnmos rpmos rtran rtranif0 rtranif1 scalared showcancelled
signed small specify specparam strong0 strong1 supply0 supply1 table task time tran tranif0 tranif1 tri tri0 tri1
triand trior trireg unsigned use uwire vectored wait wand weak0 weak1 while wire wor xnor xor
"""
SYSTEM_VERILOG = """
accept_on alias always_comb always_ff always_latch assert assume before bind bins binsof bit break byte chandle checker
class clocking const constraint context continue cover covergroup coverpoint cross dist do endchecker endclass
endclocking endgroup endinterface endpackage endprogram endproperty endsequence enum eventually expect export extends
extern final first_match foreach forkjoin global iff ignore_bins illegal_bins implements implies import inside int
interconnect interface intersect join_any join_none let local logic longint matches modport nettype new nexttime null
package packed priority program property protected pure rand randc randcase randsequence ref reject_on restrict return
s_always s_eventually s_nexttime s_until s_until_with sequence shortint shortreal soft solve static string strong
struct super sync_accept_on sync_reject_on tagged this throughout timeprecision timeunit type typedef union unique
unique0 until until_with untyped var virtual void wait_order weak wildcard with within
"""
VHDL = """
abs access after alias all and architecture array assert assume assume_guarantee attribute begin block body buffer bus
case component configuration constant context cover default disconnect downto else elsif end entity exit fairness file
for force function generate generic group guarded if impure in inertial inout is label library linkage literal loop
map mod nand new next nor not null of on open or others out package parameter port postponed procedure process
property protected pure range record register reject release rem report restrict restrict_guarantee return rol ror
select sequence severity shared signal sla sll sra srl strong subtype then to transport type unaffected units until
use variable vmode vprop vunit wait when while with xnor xor
"""

KEYWORDS = {
    language: table.split()
    for language, table in {
        "C": C,
        "C23": C23,
        "C++": CPP,
        "C++20": CPP20,
        "Verilog": VERILOG,
        "SystemVerilog": SYSTEM_VERILOG,
        "VHDL": VHDL,
    }.items()
}

# File names of C's library: an emitted header of that name would take its place wherever the build folder is searched.
LIBRARY_HEADERS = """
complex ctype errno fenv inttypes iso646 limits locale math setjmp stdalign stdarg stdatomic stdbool stddef stdint stdio
stdlib stdnoreturn string tgmath threads time uchar wchar wctype
"""

GOOD_NAMES = ["annexin_200nm", "a", "X", "Scan3", "SCAN", "modules", "wire_scan", "int32", "e1", "b0", "h", "x" * 48]
BAD_SHAPES = ["", " ", "1a", "_a", "a_", "a__b", "a b", "a-b", "a.b", "../a", "a/b", "a\n", "a\0", "\u00e4", "\uff41"]


def c_with(names: list[str]) -> str:
    return "".join(f"static const int {name} = 1;\nint use_{name}(void);\n" for name in names)


def verilog_with(names: list[str]) -> str:
    return "module m;\n" + "".join(f"    localparam {name} = 1;\n" for name in names) + "endmodule\n"


def vhdl_with(names: list[str]) -> str:
    shown = "".join(f"    constant {name} : integer := 1;\n" for name in names)
    return f"package p is\n{shown}end package;\n"


# Command, suffix, and a text with names in it.
COMPILERS: dict[str, tuple[list[str], str, Callable[[list[str]], str]]] = {
    "gcc": (["gcc", "-std=c11", "-fsyntax-only"], "c", c_with),
    "clang": (["clang", "-std=c99", "-fsyntax-only"], "c", c_with),
    "g++": (["g++", "-std=c++17", "-fsyntax-only"], "cpp", c_with),
    "g++20": (["g++", "-std=c++20", "-fsyntax-only"], "cpp", c_with),
    "iverilog-2005": (["iverilog", "-g2005", "-t", "null"], "v", verilog_with),
    "iverilog-2012": (["iverilog", "-g2012", "-t", "null"], "sv", verilog_with),
    "ghdl": (["ghdl", "-s", "--std=08"], "vhd", vhdl_with),
}
# C23 is younger than the compilers that are asked.
VOUCHED = [
    ("gcc", "C"),
    pytest.param("clang", "C", marks=pytest.mark.common),
    pytest.param("g++", "C++", marks=pytest.mark.common),
    pytest.param("g++20", "C++20", marks=pytest.mark.common),
    ("iverilog-2005", "Verilog"),
    ("iverilog-2012", "SystemVerilog"),
    pytest.param("ghdl", "VHDL", marks=pytest.mark.common),
]
# Words of the property language that GHDL reserves only inside properties.
TAKEN_BY_GHDL = {"assume_guarantee", "fairness", "strong"}


def compiles(compiler: str, names: list[str], folder: Path) -> bool:
    command, suffix, text = COMPILERS[compiler]
    source = folder / f"unit.{suffix}"
    source.write_text(text(names), "ascii")
    return run([*command, source], folder).returncode == 0


@pytest.mark.parametrize("language", KEYWORDS)
def test_every_keyword_is_refused(language: str) -> None:
    assert [word for word in KEYWORDS[language] if why_not_a_name(word) is None] == []


@pytest.mark.parametrize("language", KEYWORDS)
def test_keywords_are_refused_in_any_case(language: str) -> None:
    """VHDL tells no cases apart, and a user who changes the language later should not have to rename a scan."""
    refused = [word for word in KEYWORDS[language] if why_not_a_name(word)]
    assert [word for word in refused if not why_not_a_name(word.upper()) or not why_not_a_name(word.title())] == []


@pytest.mark.rest
@pytest.mark.parametrize(("compiler", "language"), VOUCHED)
def test_a_compiler_vouches_for_the_keywords(compiler: str, language: str, tmp_path: Path) -> None:
    """The table holds no word that its language would take: otherwise the first test would demand too much."""
    taken = {word for word in KEYWORDS[language] if compiles(compiler, [word], tmp_path)}
    assert taken == (TAKEN_BY_GHDL if compiler == "ghdl" else set())


@pytest.mark.common
@pytest.mark.parametrize("compiler", by_tool(COMPILERS))
def test_good_names_are_accepted_by_the_compiler(compiler: str, tmp_path: Path) -> None:
    """By themselves, and as the prefix of what is emitted."""
    assert [name for name in GOOD_NAMES if why_not_a_name(name)] == []
    for name in GOOD_NAMES:
        # GHDL tells no cases apart, so that constants and tables go by different names.
        identifiers = [name, f"{name}_x_table", f"{name}_y_fourier", f"{name.upper()}_X_TABLE_LENGTH"]
        assert compiles(compiler, identifiers, tmp_path), f"{compiler} refuses {name}"


@pytest.mark.parametrize("name", BAD_SHAPES, ids=repr)
def test_what_is_no_identifier_is_refused(name: str) -> None:
    assert why_not_a_name(name)


@pytest.mark.parametrize("compiler", by_tool(COMPILERS))
def test_the_compiler_refuses_a_bad_shape(compiler: str, tmp_path: Path) -> None:
    """Negative control of the good names."""
    assert not compiles(compiler, ["1a"], tmp_path)


def test_a_name_does_not_hide_a_header_of_the_library() -> None:
    """``stdint.h`` in the build folder would include itself instead of what it needs."""
    assert [name for name in LIBRARY_HEADERS.split() if why_not_a_name(name) is None] == []


# Names of the sequencer: its files are in every build, and its identifiers in every program that includes one.

OF_THE_SEQUENCER = [
    "dac_link",
    "dac_axis",
    "DAC_LINK",
    "dac_word",
    "dac_program",
    "Dac_Sequencer",
    "dac",
    "DAC",
    "dac_x",
]


@pytest.mark.parametrize("name", [*OF_THE_SEQUENCER, "program_loader", "Program_Loader"])
def test_names_of_the_sequencer_are_refused_in_any_case(name: str) -> None:
    assert why_not_a_name(name)


@pytest.mark.parametrize("name", ["dacs", "dac1_scan", "my_dac", "da_c", "x_dac_link"])
def test_names_that_only_resemble_them_are_accepted(name: str) -> None:
    assert why_not_a_name(name) is None


def test_no_scan_can_be_called_as_a_file_or_identifier_of_the_sequencer_begins() -> None:
    """What is emitted is called NAME or begins with NAME_; so no such beginning of a name of the sequencer is free."""
    files = [*c_runtime(), *c_link(), *c_store(), *verilog_runtime()]
    words = {path.stem for path in files}
    for path in files:
        text = path.read_text("utf-8")
        if path.suffix == ".v":
            words |= set(re.findall(r"^\s*module\s+(\w+)", text, re.MULTILINE))
        elif path.suffix == ".h":
            words |= set(re.findall(r"^#\s*define\s+(\w+)", text, re.MULTILINE))
            words |= set(re.findall(r"^(?:struct |enum |union )?\w[\w \*]*?\b(\w+)\(", text, re.MULTILINE))
    assert len(words) > 100
    assert {"dac_link", "DAC_LINK_H", "program_loader"} <= words
    parts = {word: word.split("_") for word in words}
    beginnings = {"_".join(split[:n]) for split in parts.values() for n in range(1, len(split) + 1)}
    free = {name for name in beginnings if re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name) and why_not_a_name(name) is None}
    assert free <= {"program"}  # program_loader alone is a name of the sequencer, and no scan emits a module
    assert {path.name for path in files} == {path.name for path in files if of_the_runtime(path.name)}
