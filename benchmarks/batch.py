"""What a build costs among many in one process: CPU milliseconds of plan, certificate and files; and memory.

Every build is of another size, after some that fill the caches. Seconds differ between machines: compare runs on one.
Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/batch.py [BUILDS]
"""

import os
import resource
import statistics
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads would only spin

import tablegen
from tablegen.emit.render import render

EXAMPLE = Path(__file__).parent.parent / "examples" / "annexin_200nm.toml"
WARM = 5  # builds before those that are measured
REACH_MS = {"plan": 5.0, "certify": 15.0, "render": 5.0}


def most_megabytes() -> float:
    """The most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print the table."""
    builds = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    sizes = [100.0 + 5.0 * at for at in range(builds + WARM)]
    measured: dict[str, list[float]] = {"load": [], "plan": [], "certify": [], "render": []}
    memory = 0.0
    for at, variant in enumerate(tablegen.variants(EXAMPLE, {"x.size_nm": sizes})):
        marks = [time.process_time()]
        setup = variant.setup
        marks.append(time.process_time())
        plan = tablegen.plan(setup)
        marks.append(time.process_time())
        certificates = tablegen.certify(plan)
        marks.append(time.process_time())
        render(plan, certificates)
        marks.append(time.process_time())
        if at == WARM:
            memory = most_megabytes()
        if at >= WARM:
            for what, first, last in zip(measured, marks, marks[1:], strict=False):
                measured[what].append(1e3 * (last - first))
    print(f"{f'CPU ms, {builds} builds':<28}{'min':>9}{'median':>9}{'max':>9}")
    for what, values in measured.items():
        text = f"{what:<28}{min(values):9.2f}{statistics.median(values):9.2f}{max(values):9.2f}"
        print(text + (f"   to reach: {REACH_MS[what]:g}" if what in REACH_MS else ""))
    print(f"memory: {memory:.1f} MB after {WARM + 1} builds, {most_megabytes():.1f} MB after {builds + WARM}")


if __name__ == "__main__":
    main()
