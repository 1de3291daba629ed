"""Peak acceleration at a scaling error against the optimum of a linear programme, as a table for docs/waveform.md.

``python benchmarks/gentle.py`` prints it, ``--write`` puts it into the page. The lines have the parameters of section 8
of the paper. The optimum is that of HiGHS for the scaling error and the range alone.
"""

import argparse
import os
import re
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from scaling import SECTION_8

from tablegen.base.input_errors import Unphysical
from tablegen.certificate.optimum import least_acceleration
from tablegen.compensation.line import LineShape
from tablegen.waveform.minimum_acceleration import Straightness, least_percent, minimum_acceleration_series
from tablegen.waveform.window_fit import fit_window

PAGE = Path(__file__).parent.parent / "docs" / "waveform.md"
MARK = "gentle"
SLOW = LineShape(0.95, SECTION_8.forward, SECTION_8.backward)
LINES = {
    "both, 0.5, 0.1..0.9": Straightness(SECTION_8, SECTION_8, (0.1, 0.9), True),
    "forward, 0.95, 0.05..0.95": Straightness(SLOW, SLOW, (0.05, 0.95), False),
    "forward, 0.5, 0.1..0.9": Straightness(SECTION_8, SECTION_8, (0.1, 0.9), False),
}
HARMONICS = (16, 32, 64)
PERCENT = (0.05, 0.3, 1.0)


def table() -> tuple[list[str], float]:
    """Rows of Markdown, and the largest ratio."""
    rows = ["| directions, turn, window | H | allowed [%] | window, leaves | minimum | optimum | ratio |"]
    rows.append("|---|---|---|---|---|---|---|")
    worst = 0.0
    for name, straight in LINES.items():
        for harmonics in HARMONICS:
            fitted = fit_window(straight.target, harmonics, straight.window, straight.both)
            window = f"{fitted.peak_acceleration():.1f}, {straight.error_percent(fitted):.2g} %"
            for percent in PERCENT:
                try:
                    series = minimum_acceleration_series(straight, harmonics, percent)
                except Unphysical:
                    least = least_percent(straight, harmonics)
                    rows.append(f"| {name} | {harmonics} | {percent:g} | {window} | from {least:.2g} % on | | |")
                    continue
                optimum = least_acceleration(straight, harmonics, percent)
                assert optimum is not None
                peak = series.peak_acceleration()
                worst = max(worst, peak / optimum)
                figures = f"{peak:.1f} | {optimum:.1f} | {peak / optimum:.3f}"
                rows.append(f"| {name} | {harmonics} | {percent:g} | {window} | {figures} |")
    return rows, worst


def main() -> int:
    """Print the table; the status is 1 if a ratio is above what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    given = parser.parse_args()
    rows, worst = table()
    text = "\n".join(rows) + "\n"
    print(text)
    print(f"worst ratio {worst:.3f}, at most 1.15")
    if given.write:
        marked = re.compile(rf"(?<=<!-- {MARK} -->\n).*?(?=<!-- /{MARK} -->)", re.DOTALL)
        PAGE.write_text(marked.sub(lambda _: text, PAGE.read_text("utf-8"), count=1), "utf-8")
    return int(worst > 1.15)


if __name__ == "__main__":
    sys.exit(main())
