"""Start-up and build beside generators of code from other descriptions, which are read and written in like amounts."""

import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sections.processes import PYTHON, least_cpu, python_version
from sections.section import EXAMPLE, ROOT, Section

OTHERS = ROOT / "build" / "bench" / "others" / "bin"
HDL_REGISTERS = Path(__file__).with_name("with_hdl_registers.py")
TITLE = "Start-up and build"
TEXT = """CPU time of whole processes, the least of eleven rounds in which all are run in turn, with one BLAS thread.
The others are in an environment of their own (`benchmarks/others.txt`). They read a description of as many bytes as
the example's two files: messages of CAN for cantools, registers for the others. None of them computes anything;
tablegen plans two waveforms, certifies 251,250 ticks, and copies its runtime. "over pass" is against `python -c pass`
of that environment, "over numpy" against `python -c "import numpy"` of ours."""
HEAD = ("what", "bytes read", "bytes written", "over pass", "over numpy", "over our build", "run")


def message(number: int) -> str:
    """A message of CAN with four signals, in the language of DBC."""
    signals = (f' SG_ S{number}_{at} : {16 * at}|16@1+ (0.5,-10) [0|4000] "V" Vector__XXX\n' for at in range(4))
    return f"BO_ {256 + number} M{number}: 8 Vector__XXX\n{''.join(signals)}\n"


def dbc(messages: int) -> str:
    """Messages of CAN."""
    return 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_:\n\n' + "".join(map(message, range(messages)))


def rdl(registers: int) -> str:
    """Registers in SystemRDL."""
    one = "    reg {{ field {{ sw = rw; hw = r; }} gain[16] = 0; field {{ sw = r; hw = w; }} code[16]; }} r{};\n"
    return "addrmap like {\n" + "".join(map(one.format, range(registers))) + "};\n"


def toml(registers: int) -> str:
    """Registers as hdl-registers reads them."""
    one = '[r{0}]\nmode = "r_w"\ndescription = "A gain."\ngain.type = "bit_vector"\ngain.width = 16\n\n'
    return "".join(map(one.format, range(registers)))


def of_size(make: Callable[[int], str], most: int) -> str:
    """The longest description of at most so many bytes."""
    count = 1
    while len(make(count + 1)) <= most:
        count += 1
    return make(count)


@dataclass(frozen=True)
class Build:
    """A build: what it reads, and its command, whose last word is the folder that it writes."""

    name: str
    reads: Sequence[Path]
    command: Sequence[str]


def builds(folder: Path) -> list[Build]:
    """All builds, and the descriptions that they read."""
    own = [EXAMPLE, EXAMPLE.with_name("scanner.toml")]
    size = sum(len(path.read_bytes()) for path in own)
    paths = []
    for name, make in (("like.dbc", dbc), ("like.rdl", rdl), ("like.toml", toml)):
        paths.append(folder / name)
        paths[-1].write_text(of_size(make, size), "ascii")
    can, systemrdl, registers = paths
    for name in ("tablegen", "cantools", "c-header", "regblock", "hdl-registers"):
        (folder / name).mkdir()
    return [
        Build(
            "tablegen build",
            own,
            [PYTHON, "-m", "tablegen", "build", str(EXAMPLE), "--quiet", "-o", str(folder / "tablegen")],
        ),
        Build(
            "cantools generate_c_source",
            [can],
            [str(OTHERS / "cantools"), "generate_c_source", str(can), "-o", str(folder / "cantools")],
        ),
        Build(
            "PeakRDL-cheader",
            [systemrdl],
            [str(OTHERS / "peakrdl"), "c-header", str(systemrdl), "-o", str(folder / "c-header" / "like.h")],
        ),
        Build(
            "PeakRDL-regblock",
            [systemrdl],
            [str(OTHERS / "peakrdl"), "regblock", str(systemrdl), "-o", str(folder / "regblock")],
        ),
        Build(
            "hdl-registers, C and VHDL",
            [registers],
            [str(OTHERS / "python"), str(HDL_REGISTERS), str(registers), str(folder / "hdl-registers")],
        ),
    ]


STARTS = {
    "tablegen --version": [PYTHON, "-m", "tablegen", "--version"],
    "cantools --version": [str(OTHERS / "cantools"), "--version"],
    "peakrdl --version": [str(OTHERS / "peakrdl"), "--version"],
    "hdl-registers, its imports": [str(OTHERS / "python"), str(HDL_REGISTERS)],
}


def shown(command: Sequence[str], folder: Path) -> str:
    """A command without the machine's paths."""
    words = [
        "python" if word in (PYTHON, str(OTHERS / "python")) else word.replace(str(folder), "build/bench")
        for word in command
    ]
    return f"`{' '.join(words).replace(f'{OTHERS}/', '').replace(f'{ROOT}/', '')}`"


def written(command: Sequence[str]) -> int:
    """Bytes of what a build left where its last word says."""
    place = Path(command[-1])
    return sum(path.stat().st_size for path in (place if place.is_dir() else place.parent).rglob("*") if path.is_file())


def measure() -> Section:
    """Run all of them."""
    if not (OTHERS / "cantools").exists():
        raise FileNotFoundError("cantools, peakrdl and hdl-registers are not in build/bench/others: run `make bench`")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = builds(folder)
        commands = {
            "pass": [str(OTHERS / "python"), "-c", "pass"],
            "our pass": [PYTHON, "-c", "pass"],
            "import numpy": [PYTHON, "-c", "import numpy"],
            **STARTS,
            **{build.name: build.command for build in made},
        }
        least = least_cpu(commands)
        sizes = {build.name: (sum(len(p.read_bytes()) for p in build.reads), written(build.command)) for build in made}
    rows = []
    for what in [*STARTS, *sizes]:
        read, wrote = map(str, sizes.get(what, ("", "")))
        ratios = [f"{least[what] / least['pass']:.1f}", f"{least[what] / least['import numpy']:.2f}"]
        ratios.append("" if what in STARTS else f"{least[what] / least['tablegen build']:.2f}")
        rows.append([what, read, wrote, *ratios, shown(commands[what], folder)])
    return Section(TITLE, TEXT, HEAD, rows, notes(least), python_version() | other_versions())


def notes(least: dict[str, float]) -> list[str]:
    """Who is ahead of us, and where our time goes."""
    ours = least["tablegen build"]
    ahead = [f"{what} ({least[what] / ours:.2f})" for what in least if what in OTHER_BUILDS and least[what] < ours]
    start, numpy = least["tablegen --version"] / ours, least["import numpy"] / ours
    bare = least["our pass"] / least["pass"]
    return [
        f"Ahead of our build: {', '.join(ahead) or 'none'}.",
        f"Of our build, {100 * numpy:.0f} % is importing numpy, which none of the others does; `tablegen "
        f"--version` takes {100 * start:.0f} % of it. What is beyond both is planning, the certificate and the "
        "files: see planning.",
        "`python -c pass` of our environment, into which the package is installed for development, takes "
        f"{bare:.1f} of the others'; all our rows have that in them.",
    ]


OTHER_BUILDS = ("cantools generate_c_source", "PeakRDL-cheader", "PeakRDL-regblock", "hdl-registers, C and VHDL")


def other_versions() -> dict[str, str]:
    """Versions in the environment of the others."""
    names = ["cantools", "peakrdl", "peakrdl-cheader", "peakrdl-regblock", "hdl-registers"]
    asked = f"from importlib.metadata import version; print(*map(version, {names}))"
    found = subprocess.run([str(OTHERS / "python"), "-c", asked], capture_output=True, text=True, check=True).stdout
    return dict(zip(names, found.split(), strict=True))
