"""What plans, certificates and files take, of scans of all kinds, over the CPU time of importing numpy."""

import subprocess
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

from build_cost import with_operators
from editing import SCAN, edited, write_pair
from gentle import LINES

from sections.processes import PYTHON, least_cpu, python_version
from sections.section import EXAMPLE, ROOT, Section
from tablegen.certificate.optimum import least_acceleration
from tablegen.waveform.minimum_acceleration import minimum_acceleration_series

HERE = Path(__file__).parent
ROUNDS = 3
TITLE = "Planning"
TEXT = """CPU time over that of `python -c "import numpy"`, the least of three processes, with one BLAS thread: the
first plan, certificate and files of a process, without start-up and imports; SCAN is the example with that change.
`batch.py` has those of a build among many in one process, where Jinja is imported and sines kept; it has
medians. Memory is the most that the process had. The last two rows are the same linear programme, by our own method
and by HiGHS of scipy."""
HEAD = ("scan", "plan", "certificate", "files", "memory [MB]", "run")
WIDE = ("dac.bits = 24", "dac.update_rate_hz = 10e6", "timing.line_rate_hz = 10", "- [limits]")
SLOW = ("timing.line_rate_hz = 1", "x.table.mode = 'auto'", "y.table.mode = 'auto'", "- [limits]")
SCANS = {
    "the example, 32 and 64 harmonics": (),
    "256 harmonics of x": ("x.band_limit.harmonics = 256", "- [limits]"),
    "512 harmonics of x": ("x.band_limit.harmonics = 512", "- [limits]"),
    "least acceleration at 0.3 %, 32 harmonics": ("x.band_limit.max_scaling_error_percent = 0.3",),
    "24 bits, 10 MHz, lines of 10 Hz": WIDE,
    "500 kHz, lines of 1 Hz, the tables chosen (cubic)": SLOW,
}
PROGRAMME = "both, 0.5, 0.1..0.9", 32, 0.3  # of benchmarks/gentle.py


def plan_once(scan: Path) -> list[float]:
    """What ``plan_once.py`` prints, the least of some runs."""
    runs = []
    for _ in range(ROUNDS):
        command = [PYTHON, str(HERE / "plan_once.py"), str(scan)]
        shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        runs.append([float(word) for word in shown.split()])
    return [min(values) for values in zip(*runs, strict=True)]


def batch() -> list[float]:
    """Median CPU seconds of a build among many, by ``batch.py``."""
    command = [PYTHON, str(ROOT / "benchmarks" / "batch.py"), "30"]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return batch_figures(shown)


def batch_figures(shown: str) -> list[float]:
    """Seconds of plan, certify and render, from what ``batch.py`` prints."""
    rows = {line.split()[0]: line.split() for line in shown.splitlines() if line}
    return [1e-3 * float(rows[what][2]) for what in ("plan", "certify", "render")]


def programmes() -> list[tuple[str, float]]:
    """CPU seconds of the linear programme, by both methods; the least of some runs."""
    line, harmonics, percent = PROGRAMME
    straight = LINES[line]
    found = []
    for what, solve in (("ours", minimum_acceleration_series), ("scipy's HiGHS", least_acceleration)):
        taken = []
        for _ in range(ROUNDS + 1):  # the first imports scipy
            before = time.process_time()
            solve(straight, harmonics, percent)
            taken.append(time.process_time() - before)
        found.append((f"least acceleration alone, {harmonics} harmonics, {percent:g} %: {what}", min(taken)))
    return found


def measure() -> Section:
    """Run all of them."""
    numpy = least_cpu({"numpy": [PYTHON, "-c", "import numpy"]})["numpy"]

    def row(what: str, seconds: list[float], memory: str, run: str) -> list[str]:
        return [what, *(f"{one / numpy:.2f}" for one in seconds), *[""] * (3 - len(seconds)), memory, f"`{run}`"]

    once = "python benchmarks/sections/plan_once.py"
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scans = {}
        for at, (what, edits) in enumerate(SCANS.items()):
            place = folder / str(at)
            place.mkdir()
            scans[what] = write_pair(place, edited(SCAN, *edits)) if edits else EXAMPLE
        scans |= {f"the example, {what}": scan for what, scan in with_operators(folder).items()}
        firsts = {what: plan_once(scan) for what, scan in scans.items()}
    for what, (*seconds, memory) in firsts.items():
        rows.append(
            row(what, seconds, f"{memory:.0f}", f"{once} {'examples/annexin_200nm.toml' if not rows else 'SCAN'}")
        )
    many = batch()
    rows.append(row("the example's scans, one among many", many, "", "python benchmarks/batch.py 30"))
    rows += [row(what, [taken], "", "python benchmarks/gentle.py") for what, taken in programmes()]
    versions = python_version() | {"scipy": version("scipy")}
    return Section(TITLE, TEXT, HEAD, rows, notes(firsts, many), versions)


def notes(firsts: dict[str, list[float]], many: list[float]) -> list[str]:
    """Where the time goes."""
    files = firsts["the example, 32 and 64 harmonics"][2]
    return [
        f"The first files of a process take {files / many[2]:.0f} times those of a later one: Jinja is imported.",
        "Many harmonics: sums of sines over the nodes, which make the normal equations of the window's fit, and their "
        "Cholesky factorisation in a fixed order. Many ticks: the certificate finds each tick at which a code changes, "
        "and measures errors where runs of one code begin and end.",
    ]
