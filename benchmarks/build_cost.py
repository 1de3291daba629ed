"""What a build costs against importing numpy, and a report against a build: CPU time of whole processes, as ratios.

All are run in turn, so that a machine whose speed drifts slows all. Usage: python benchmarks/build_cost.py [PAIRS]
"""

import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

EXAMPLE = Path(__file__).parent.parent / "examples" / "annexin_200nm.toml"
LIMIT, REPORT_LIMIT = 2.5, 5.0


def cpu_seconds(command: list[str]) -> float:
    """User and system time of a finished child process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Print the table; the status is 1 if a median ratio is above its limit."""
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    python = sys.executable
    with tempfile.TemporaryDirectory() as folder:
        build = [python, "-m", "tablegen", "build", str(EXAMPLE), "--quiet", "-o", folder]
        report = [python, "-m", "tablegen", "report", str(EXAMPLE), "-o", str(Path(folder) / "report.html")]
        numpy = [python, "-c", "import numpy"]
        commands = build, numpy, report
        [cpu_seconds(command) for command in commands]  # once, to fill the file cache
        measured = [[cpu_seconds(command) for command in commands] for _ in range(pairs)]
    ratios = [b / n for b, n, _ in measured]
    reports = [r / b for b, _, r in measured]
    print(f"{pairs} pairs              min   median      max")
    for name, values in (
        ("tablegen build [s]", [b for b, _, _ in measured]),
        ("import numpy [s]", [n for _, n, _ in measured]),
        ("ratio", ratios),
        ("report [s]", [r for _, _, r in measured]),
        ("report / build", reports),
    ):
        print(f"{name:<18}{min(values):9.3f}{statistics.median(values):9.3f}{max(values):9.3f}")
    return int(statistics.median(ratios) > LIMIT or statistics.median(reports) > REPORT_LIMIT)


if __name__ == "__main__":
    sys.exit(main())
