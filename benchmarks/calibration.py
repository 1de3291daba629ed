"""How well calibrations know themselves: 1,000 noisy trials of each, as a table for docs/calibration.md.

``python benchmarks/calibration.py`` prints the table, ``--write`` puts it into the page, ``--trials N`` takes as many,
``--only images`` that calibration, the others' rows kept. Calibrations of size and offset from images have a table of
their own, of a tenth as many trials: they take seconds each.
"""

import argparse
import re
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "calibration.md"
sys.path.insert(0, str(ROOT / "tests" / "helpers"))

from calibrating import CASES, IMAGED_CASES, trials  # noqa: E402

HEAD = [
    "| calibration | parameter | truth | rms error | standard error | truth within 2 |",
    "|---|---|---|---|---|---|",
]


def rows(kind: str, count: int) -> list[str]:
    """A row a parameter: truth, scatter of the estimates, median of their standard errors, share of hits."""
    lines = []
    found = list(trials(kind, count))
    for name, (_, truth) in found[0].items():
        values = np.array([one[name][0].value for one in found])
        errors = np.array([one[name][0].standard_error for one in found])
        hits = float(np.mean(np.abs(values - truth) <= 2.0 * errors))
        rms, median = float(np.sqrt(np.mean((values - truth) ** 2))), float(np.median(errors))
        lines.append(f"| {kind} | `{name}` | {truth:g} | {rms:.2g} | {median:.2g} | {100.0 * hits:.1f} % |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument(
        "--only", choices=[*CASES, *IMAGED_CASES], help="this calibration; the page keeps the others' rows"
    )
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    given = parser.parse_args()
    for mark, cases, count in (
        ("measured", CASES, given.trials),
        ("measured of images", IMAGED_CASES, max(given.trials // 10, 1)),
    ):
        marked = re.compile(rf"(?<=<!-- {mark} -->\n).*(?=<!-- /{mark} -->)", re.DOTALL)
        before = marked.search(PAGE.read_text("utf-8"))
        kept = before[0].splitlines() if before else []
        lines = list(HEAD)
        for kind in cases:
            if given.only in (None, kind):
                lines += rows(kind, count)
            else:
                lines += [line for line in kept if line.startswith(f"| {kind} |")]
        text = "\n".join(lines) + "\n"
        print(text)
        if given.write:
            page = PAGE.read_text("utf-8")  # trials take a while; somebody may have written meanwhile
            PAGE.write_text(marked.sub(lambda _, text=text: text, page, count=1), "utf-8")


if __name__ == "__main__":
    main()
