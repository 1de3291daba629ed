"""What a build costs against importing numpy, and a report against a build: CPU time of whole processes, as ratios.

The example is built by its laws, with an operator of x, and with operators of both axes, which were identified on the
virtual scanner. All are run in turn, with one thread for linear algebra and with modules compiled before; a ratio is
that of the least times of all rounds, since whatever else a machine does only adds to them. ``--laws`` leaves out the
operators, whose identification needs the extra ``calibrate``. Usage: python benchmarks/build_cost.py [ROUNDS] [--laws]
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # its threads would only spin, here and in what is measured
MODULES = tempfile.TemporaryDirectory()  # as they are compiled, once for all processes
ENVIRONMENT = {**os.environ, "PYTHONPYCACHEPREFIX": MODULES.name, "PYTHONDONTWRITEBYTECODE": ""}
ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "examples" / "annexin_200nm.toml"
# What is measured: over what its ratio is taken, and the largest that will do.
LIMITS: dict[str, tuple[str, float | None]] = {
    "laws": ("import numpy", 2.5),
    "operator of x": ("import numpy", 6.0),
    "operators of x and y": ("import numpy", None),
    "report": ("laws", 5.0),
}
RATES_HZ = {"x": 100.0, "y": 1.0}  # of the traces
TURNS = {"x": 0.5, "y": 0.95}


def cpu_seconds(command: list[str]) -> float:
    """User and system time of a finished child process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=ENVIRONMENT)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def with_operators(folder: Path) -> dict[str, Path]:
    """The example with operators: a scan file each."""
    sys.path.insert(0, str(ROOT / "tests" / "helpers"))
    from editing import SCAN, SCANNER, edited
    from operator_scans import fitted, virtual_traces

    from tablegen.calibration.operator.file_of_fit import operator_file
    from tablegen.virtual.parameters import load_truth
    from tablegen.virtual.scanner import VirtualScanner

    scanner = VirtualScanner.of(load_truth())
    for axis, piezo in (("x", scanner.x), ("y", scanner.y)):
        fit = fitted(virtual_traces(piezo, RATES_HZ[axis], TURNS[axis]))
        (folder / f"{axis}.toml").write_bytes(operator_file(fit, axis, 100.0))
    scans = {}
    for name, axes in (("operator of x", "x"), ("operators of x and y", "xy")):
        edits = [
            edit for a in axes for edit in (f"{a}.hysteresis.model = 'operator'", f"{a}.hysteresis.file = '{a}.toml'")
        ]
        (folder / f"scanner_{axes}.toml").write_text(edited(SCANNER, *edits), "utf-8")
        scans[name] = folder / f"scan_{axes}.toml"
        scans[name].write_text(SCAN.replace('"scanner.toml"', f'"scanner_{axes}.toml"'), "utf-8")
    return scans


def main() -> int:
    """Print the table; the status is 1 if a ratio is above its limit."""
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    rounds = numbers[0] if numbers else 15
    python = sys.executable
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scans = {"laws": EXAMPLE, **({} if "--laws" in sys.argv else with_operators(folder))}
        commands = {
            what: [python, "-m", "tablegen", "build", str(scan), "--quiet", "-o", str(folder / what)]
            for what, scan in scans.items()
        }
        commands["report"] = [python, "-m", "tablegen", "report", str(EXAMPLE), "-o", str(folder / "report.html")]
        commands["import numpy"] = [python, "-c", "import numpy"]
        for command in commands.values():
            cpu_seconds(command)  # once, to fill the caches
        measured: dict[str, list[float]] = {what: [] for what in commands}
        for _ in range(rounds):
            for what, command in commands.items():
                measured[what].append(cpu_seconds(command))
    print(f"{f'CPU seconds, {rounds} rounds':<28}{'min':>9}{'median':>9}{'max':>9}")
    status = 0
    for what, values in measured.items():
        text = f"{what:<28}{min(values):9.3f}{statistics.median(values):9.3f}{max(values):9.3f}"
        if what in LIMITS:
            over, limit = LIMITS[what]
            ratio = min(values) / min(measured[over])
            status |= int(limit is not None and ratio > limit)
            text += f"   {ratio:.2f} x {over}" + (f", at most {limit:g}" if limit is not None else "")
        print(text)
    return status


if __name__ == "__main__":
    sys.exit(main())
