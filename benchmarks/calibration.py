"""How well calibrations know themselves: 1,000 noisy trials of each, as a table for docs/calibration.md.

``python benchmarks/calibration.py`` prints the table, ``--write`` puts it into the page, ``--trials N`` takes as many.
"""

import argparse
import re
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "calibration.md"
sys.path.insert(0, str(ROOT / "tests"))

from calibrating import CASES, trials  # noqa: E402


def table(count: int) -> str:
    """A row a parameter: truth, scatter of the estimates, median of their standard errors, share of hits."""
    rows = [
        "| calibration | parameter | truth | rms error | standard error | truth within 2 |",
        "|---|---|---|---|---|---|",
    ]
    for kind in CASES:
        found = list(trials(kind, count))
        for name, (_, truth) in found[0].items():
            values = np.array([one[name][0].value for one in found])
            errors = np.array([one[name][0].standard_error for one in found])
            hits = float(np.mean(np.abs(values - truth) <= 2.0 * errors))
            rms, median = float(np.sqrt(np.mean((values - truth) ** 2))), float(np.median(errors))
            rows.append(f"| {kind} | `{name}` | {truth:g} | {rms:.2g} | {median:.2g} | {100.0 * hits:.1f} % |")
    return "\n".join(rows) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    given = parser.parse_args()
    text = table(given.trials)
    print(text)
    if given.write:
        page = PAGE.read_text("utf-8")
        marked = r"(?<=<!-- measured -->\n).*(?=<!-- /measured -->)"
        PAGE.write_text(re.sub(marked, lambda _: text, page, count=1, flags=re.DOTALL), "utf-8")


if __name__ == "__main__":
    main()
