"""Tools by sets of tests: what the Makefile's lists install, and which of it a test may call."""

import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
# Packages of Debian, and what tests and makefiles call of them and of what they require.
_GCC = ("gcc", "cc", "gcov", "nm", "ar", "ld", "as", "objdump", "size")
PROGRAMS: Mapping[str, tuple[str, ...]] = {
    "arduino-builder": ("arduino-builder",),
    "cargo": ("cargo", "rustc"),
    "ccache": ("ccache",),
    "chromium": ("chromium",),
    "clang": ("clang", "clang++", "nm", "ar", "ld", "as"),
    "cmake": ("cmake", "ctest"),
    "cppcheck": ("cppcheck",),
    "fpga-icestorm": ("icepack",),
    "g++": ("g++", "c++", *_GCC),
    "gcc": _GCC,
    "gcc-arm-none-eabi": ("arm-none-eabi-gcc", "arm-none-eabi-g++", "arm-none-eabi-size", "arm-none-eabi-nm"),
    "gcc-avr": ("avr-gcc", "avr-g++", "avr-size", "avr-nm", "avr-objcopy"),
    "gcc-mips-linux-gnu": ("mips-linux-gnu-gcc",),
    "gcc-riscv64-unknown-elf": ("riscv64-unknown-elf-gcc",),
    "ghdl": ("ghdl",),
    "groff": ("groff",),
    "iverilog": ("iverilog", "vvp"),
    "make": ("make",),
    "man-db": ("man",),
    "nextpnr-ice40": ("nextpnr-ice40",),
    "ninja-build": ("ninja",),
    "nodejs": ("node",),
    "npm": ("npm",),
    "qemu-system-arm": ("qemu-system-arm",),
    "qemu-user": ("qemu-mips",),
    "simavr": ("simavr",),
    "srecord": ("srec_cat",),
    "tcl": ("tclsh",),
    "yosys": ("yosys",),
    "z3": ("z3",),
}
# Packages without a program: what shows that a test needs them.
LIBRARIES: Mapping[str, str] = {
    "arduino-core-avr": "/usr/share/arduino",
    "avr-libc": "avr-gcc",
    "libc6-dev": "gcc",
    "libc6-dev-mips-cross": "mips-linux-gnu-gcc",
    "libclang-rt-dev": "-fsanitize=undefined,address",
    "libelf-dev": "-lelf",
    "libpython": "cocotb",
    "libsimavr-dev": "-lsimavr",
}
# What every Debian with the packages that the README asks for has, as far as tests call it by `tool`.
BASE = frozenset({"bash", "env", "git", "make", "sh", "tar"})
_LISTS = {"quick": "CHECK_TOOLS", "common": "COMMON_TOOLS", "long": "TOOLS", "rest": "TOOLS"}


@cache
def makefile_lists() -> Mapping[str, frozenset[str]]:
    """The packages of each list of the Makefile whose name ends in TOOLS."""
    lists: dict[str, frozenset[str]] = {}
    text = (REPOSITORY / "Makefile").read_text("utf-8").replace("\\\n", " ")
    for name, value in re.findall(r"^(\w*TOOLS) := (.*)$", text, re.MULTILINE):
        words: set[str] = set()
        for word in value.split():
            reference = re.fullmatch(r"\$\((\w+)\)", word)
            words |= lists[reference[1]] if reference else {word}
        lists[name] = frozenset(words)
    return lists


def allowed_programs(marks: Iterable[str], *, hdl: bool) -> frozenset[str]:
    """Programs that a test with these marks may call; one in ``hdl_tests`` is run by `make test-hdl` too."""
    names = set(marks)
    mark = next((mark for mark in ("long", "rest", "common") if mark in names), "quick")
    programs = programs_of(makefile_lists()[_LISTS[mark]])
    return programs & programs_of(makefile_lists()["HDL_TOOLS"]) if hdl else programs


def programs_of(packages: Iterable[str]) -> frozenset[str]:
    """Programs that come with packages."""
    return frozenset(program for package in packages for program in PROGRAMS.get(package, ()))


def why_missing(program: str) -> str:
    """What to do about a program that is not on PATH."""
    packages = [package for package, programs in PROGRAMS.items() if program in programs] or [program]
    return (
        f"{program} is not installed, or not by the Makefile's list of this test's set: "
        f"`.ci/system-packages {packages[0]}`, or another mark (tests/README.md)"
    )
