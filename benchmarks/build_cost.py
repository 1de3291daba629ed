"""What a build costs, against importing numpy: CPU time of whole processes, run in pairs, as a ratio.

Pairs are taken in turn, so that a machine whose speed drifts slows both. Usage: python benchmarks/build_cost.py [PAIRS]
"""

import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

EXAMPLE = Path(__file__).parent.parent / "examples" / "annexin_200nm.toml"
LIMIT = 2.5


def cpu_seconds(command: list[str]) -> float:
    """User and system time of a finished child process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Print the table; the status is 1 if the median ratio is above the limit."""
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    python = sys.executable
    with tempfile.TemporaryDirectory() as folder:
        build = [python, "-m", "tablegen", "build", str(EXAMPLE), "--quiet", "-o", folder]
        numpy = [python, "-c", "import numpy"]
        cpu_seconds(build), cpu_seconds(numpy)  # once, to fill the file cache
        measured = [(cpu_seconds(build), cpu_seconds(numpy)) for _ in range(pairs)]
    ratios = [b / n for b, n in measured]
    print(f"{pairs} pairs              min   median      max")
    for name, values in (
        ("tablegen build [s]", [b for b, _ in measured]),
        ("import numpy [s]", [n for _, n in measured]),
        ("ratio", ratios),
    ):
        print(f"{name:<18}{min(values):9.3f}{statistics.median(values):9.3f}{max(values):9.3f}")
    return int(statistics.median(ratios) > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
