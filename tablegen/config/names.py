"""Validity of names as identifiers in C, C++, Verilog, SystemVerilog and VHDL at once."""

import re

# Words reserved in at least one of: C23, C++23, Verilog-2005, SystemVerilog-2017, VHDL-2019. Compared in lower case,
# since VHDL does not tell cases apart. A single word is checked; every emitted identifier carries the scan's name as a
# prefix and an underscore, so the name itself is all that can collide.
_RESERVED = frozenset(
    """
    abs absolute accept_on access across after alias alignas aligned alignof all always always_comb always_ff
    always_latch and and_eq architecture array asm assert assign assume assume_guarantee attribute auto automatic
    before begin bind bins binsof bit bitand bitor block body bool break buf buffer bufif0 bufif1 bus byte case
    casex casez catch cell chandle char char16_t char32_t char8_t checker class clocking cmos co_await co_return
    co_yield compl component concept config configuration const const_cast constant consteval constexpr constinit
    constraint context continue cover covergroup coverpoint cross deassign decltype default defparam delete design
    disable disconnect dist do double downto dynamic_cast edge else elsif end endcase endchecker endclass
    endclocking endconfig endfunction endgenerate endgroup endinterface endmodule endpackage endprimitive endprogram
    endproperty endsequence endspecify endtable endtask entity enum event eventually exit expect explicit export
    extends extern fairness false file final first_match float for force foreach forever fork forkjoin friend
    function generate generic genvar global goto group guarded highz0 highz1 if iff ifnone ignore_bins illegal_bins
    implements implies import impure in incdir include inertial initial inline inout input inside instance int
    integer interconnect interface intersect is join join_any join_none label large let liblist library linkage
    literal local localparam logic long longint loop macromodule map matches medium mod modport module mutable
    namespace nand negedge nettype new next nexttime nmos noexcept nor noshowcancelled not not_eq notif0 notif1 null
    nullptr of on open operator or or_eq others out output package packed parameter pmos port posedge postponed
    primitive priority private procedure process program property protected public pull0 pull1 pulldown pullup
    pulsestyle_ondetect pulsestyle_onevent pure rand randc randcase randsequence range rcmos real realtime record
    ref reg register reinterpret_cast reject reject_on release rem repeat report requires restrict
    restrict_guarantee return rnmos rol ror rpmos rtran rtranif0 rtranif1 s_always s_eventually s_nexttime s_until
    s_until_with scalared select sequence severity shared short shortint shortreal showcancelled signal signed
    sizeof sla sll small soft solve specify specparam sra srl static static_assert static_cast std string strong
    strong0 strong1 struct subtype super supply0 supply1 switch sync_accept_on sync_reject_on table tagged task
    template then this thread_local throughout throw time timeprecision timeunit to tran tranif0 tranif1 transport
    tri tri0 tri1 triand trior trireg true try type typedef typeid typename typeof typeof_unqual unaffected
    unconstrained_array union unique unique0 units unsigned until until_with untyped use using uwire var variable
    vectored view virtual vmode void volatile vpkg vprop vunit wait wait_order wand wchar_t weak weak0 weak1 when
    while wildcard wire with within wor xnor xor xor_eq
    """.split()  # noqa: SIM905 - a list of one word a line is four hundred lines
)

_RUNTIME = "dac"  # dac_link.h, dac_axis.v, DAC_PARKED, ...

# Names of files, since NAME.h and NAME.c are written: headers of the C library, the runtime's own, devices of Windows.
_RESERVED_FILES = frozenset(
    """
    assert aux com1 com2 com3 com4 com5 com6 com7 com8 com9 complex con ctype errno fenv float inttypes iso646 limits
    locale lpt1 lpt2 lpt3 lpt4 lpt5 lpt6 lpt7 lpt8 lpt9 math nul prn program_loader setjmp signal stdalign stdarg
    stdatomic stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar
    wctype
    """.split()  # noqa: SIM905
)


def why_not_a_name(name: str) -> str | None:
    """Return what makes a name unusable as an identifier of some target language, or None."""
    accepted = "a letter, then letters, digits and single underscores"
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        return f"{name!r} is no identifier; accepted is {accepted}"
    if "__" in name or name.endswith("_"):
        return f"{name!r} is reserved in C++ or refused by VHDL; accepted is {accepted}, none at the end"
    if name.lower().split("_")[0] == _RUNTIME:
        return f"{name!r} begins as the files and identifiers of the sequencer do, {_RUNTIME}_...; put a word before it"
    if name.lower() in _RESERVED_FILES:
        return f"{name!r} would make a {name}.h that hides another file of that name; add to it"
    if name.lower() in _RESERVED:
        return f"{name!r} is a reserved word of C, C++, Verilog, SystemVerilog or VHDL"
    return None


def of_the_runtime(name: str) -> bool:
    """Return True if a file or identifier of this name is one of the sequencer, whatever the case of its letters."""
    return name.lower().startswith((f"{_RUNTIME}_", "program_loader"))
