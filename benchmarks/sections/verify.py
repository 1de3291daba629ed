"""Samples a CPU second of ``tablegen verify`` beside the same ticks played without Python."""

import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from build_cost import cpu_seconds
from editing import SCAN, edited, write_pair

from sections.processes import PYTHON, python_version, tool_version
from sections.section import EXAMPLE, ROOT, Section

ROUNDS = 2
TITLE = "Verifying"
TEXT = """Samples (codes of an axis) a CPU second of `tablegen verify` of the example, and of the same code that plays
as many ticks and adds up the codes: no record, no model, no comparison (`benchmarks/play_alone.c`, `play_alone.v`).
The less CPU time of two runs; compiling counts in `verify`, not in what plays alone. `--target c` plays every tick
twice, by single steps and by fills. Objects of the runtime were kept by a run before; "nothing kept" is a run without
[the cache](../docs/inputs.md), which compiles them too. A frame of ten times as many lines shows what samples cost,
with less of what every run costs, most of which is starting Python. Seconds are those of one machine; "times" is the
ratio of CPU times a sample."""
HEAD = ("target", "samples", "verify [million samples a CPU s]", "alone [million samples a CPU s]", "times", "run")
C_ROUNDS = 100  # of what plays alone in C, so that compiling and starting it do not count
BENCHMARKS = ROOT / "benchmarks"


@dataclass(frozen=True)
class Speed:
    """Samples, and CPU seconds that they took."""

    samples: int
    seconds: float

    @property
    def rate(self) -> float:
        """Samples a CPU second."""
        return self.samples / self.seconds


def ticks_of(shown: str) -> int:
    """The ticks that ``tablegen verify`` says it compared with the integer model."""
    found = re.findall(r"^(?:markers|frame|fill) +integer model +(\d+) ticks", shown, re.MULTILINE)
    return sum(map(int, found))


def verified(build: Path, *options: str, kept: bool = True) -> Speed:
    """A run of the command, of both axes, with what runs before it have kept or without."""
    without = [] if kept else ["env", "XDG_CACHE_HOME=/dev/null"]
    command = [*without, PYTHON, "-m", "tablegen", "verify", str(build), *options]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return Speed(2 * ticks_of(shown), min(cpu_seconds(command) for _ in range(ROUNDS)))


def compiled_c(build: Path, folder: Path) -> Path:
    """The program that plays a build's C alone."""
    program = folder / "play_alone"
    sources = [str(path) for path in sorted(build.glob("*.c")) if not path.stem.startswith("dac_link")]
    command = ["gcc", "-std=c99", "-O2", f"-I{build}", str(BENCHMARKS / "play_alone.c"), *sources, "-o", str(program)]
    subprocess.run(command, check=True)
    return program


def alone_in_c(build: Path, folder: Path) -> Speed:
    """The same C without Python."""
    ticks = 250_112  # a multiple of its blocks
    command = [str(compiled_c(build, folder)), str(ticks), str(C_ROUNDS)]
    seconds = min(cpu_seconds(command) for _ in range(ROUNDS))
    return Speed(2 * 2 * ticks * C_ROUNDS, seconds)


def compiled_verilog(build: Path, folder: Path, ticks: int) -> list[str]:
    """The command that plays so many ticks of a build's Verilog alone; it runs where the memory files are."""
    program = folder / "play_alone.vvp"
    sources = [str(path) for path in sorted(build.glob("dac_*.v"))]
    options = ["-g2005", "-s", "play_alone", f"-Pplay_alone.TICKS={ticks}", f"-I{build}", "-o", str(program)]
    subprocess.run(["iverilog", *options, str(BENCHMARKS / "play_alone.v"), *sources], check=True)
    return ["sh", "-c", f"cd '{build}' && exec vvp -n '{program}'"]


def alone_in_verilog(build: Path, folder: Path) -> Speed:
    """The same Verilog in Icarus, without cocotb."""
    ticks = 250_000
    command = compiled_verilog(build, folder, ticks)
    return Speed(2 * ticks, min(cpu_seconds(command) for _ in range(ROUNDS)))


def measure() -> Section:
    """Both targets."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        build = folder / "build"
        long = folder / "long"
        for scan, place in ((EXAMPLE, build), (write_pair(folder, edited(SCAN, "timing.lines = 2000")), long)):
            subprocess.run([PYTHON, "-m", "tablegen", "build", str(scan), "--quiet", "-o", str(place)], check=True)
        alone = alone_in_c(build, folder)
        pairs = {
            "c": (verified(build, "--target", "c"), alone),
            "c, nothing kept": (verified(build, "--target", "c", kept=False), alone),
            "c, 2000 lines": (verified(long, "--target", "c"), alone),
            "verilog, Icarus": (verified(build), alone_in_verilog(build, folder)),
        }
    in_c = "tablegen verify build --target c"
    runs = {
        "c": in_c,
        "c, nothing kept": f"XDG_CACHE_HOME=/dev/null {in_c}",
        "c, 2000 lines": in_c,
        "verilog, Icarus": "tablegen verify build",
    }
    rows = [
        [
            what,
            str(own.samples),
            millions(own),
            millions(alone),
            f"{alone.rate / own.rate:.3g}",
            f"`{runs[what]}`",
        ]
        for what, (own, alone) in pairs.items()
    ]
    versions = {"gcc": tool_version("gcc"), "Icarus Verilog": tool_version("iverilog", "-V")}
    return Section(TITLE, TEXT, HEAD, rows, notes(), python_version() | versions)


def millions(speed: Speed) -> str:
    """Million samples a CPU second, to two figures."""
    return f"{float(f'{speed.rate / 1e6:.2g}'):g}"


def notes() -> list[str]:
    """Where the time goes."""
    return [
        "What plays alone has no changes of programs, ramps and faults, and Icarus plays a part of `verify` with "
        "multipliers of look-up tables. The rest is ours: the integer model in Python, records of every tick, the "
        "certificate again from the words, SHA-256 of all files, starting Python twice, and compiling what the build "
        "has of its own. Where nothing is kept the C compiler takes longer than all that.",
    ]
