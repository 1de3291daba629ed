"""The files of the format c or verilog of any scan, as a package around them names them."""

from fractions import Fraction

from msgspec import Struct


class CPackage(Struct, frozen=True):
    """The C of a scan: its files with those of the runtime, in order, and what they are compiled with.

    ``headers`` are those that an application includes, ``options`` the macros of runtime and application at the least
    values that will do, and ``constants`` those of the scan's header without its name.
    """

    name: str
    version: str
    hash: str
    files: list[str]
    headers: list[str]
    options: dict[str, int]
    constants: dict[str, int]
    header_only: bool = False
    with_z: bool = False


class VerilogPackage(Struct, frozen=True):
    """The Verilog of a scan: the names of its own files and of the modules of the sequencer, each in order.

    ``clocks_per_tick`` is 0 where the clock of the FPGA is not known. ``parameters`` are those of ``NAME_top`` with
    their defaults; its codes have ``code_bits``, and its words for the converters of x and y ``word_bits``.
    """

    name: str
    version: str
    hash: str
    written: list[str]
    modules: list[str]
    clocks_per_tick: int
    update_rate_hz: Fraction
    parameters: dict[str, int]
    code_bits: int
    word_bits: tuple[int, int]
