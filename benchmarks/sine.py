"""A sine and the best straight line at high rates, on simulated piezos that the project does not contain.

``python benchmarks/sine.py`` prints the table of docs/sine.md, ``--write`` puts it there. Each piezo is identified from
ten traces at 100 Hz and a response with noise, which is taken out of the traces as ``calibrate operator`` does; 200 nm
are planned, and the emitted integers are played on the piezo itself: hysteresis stepped tick by tick, creep, two modes
and a dead time. A pixel is the mean over its ticks. The straight line has the number of harmonics that leaves the
least.
"""

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from foreign_plants import TEN, V_MAX, BoucWen, ForeignPlant, ManyPlays, record
from operator_scans import fitted
from sine_scans import image_errors, measured_response, pixels_on_the_piezo, predicted_errors, response_csv, sine_scan

from tablegen.base.input_errors import Rejected
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.planning.line_plan import Plan, make_plan

PAGE = Path(__file__).parent.parent / "docs" / "sine.md"
PIEZOS = {"plays": ManyPlays(1), "bouc-wen": BoucWen()}
RATES_HZ = (5e3, 10e3, 20e3)
UPDATES_HZ = 20e6
HARMONICS = (3, 5, 7, 9, 11, 13, 15, 21, 27)
HIGHEST_HZ = 150e3  # of the response that was measured
WINDOW = (0.1, 0.9)
HEAD = "| piezo, line rate | motion | rms | scaling | trace and retrace | size |\n|---|---|---|---|---|---|"


@cache
def operator_of(piezo: str) -> bytes:
    """The operator of a piezo, from ten noisy traces at 100 Hz, behind its measured response."""
    plant = ForeignPlant(PIEZOS[piezo])
    traces = [Trace(f"{k}", *record(plant, at, stroke, seed=k)) for k, (at, stroke) in enumerate(TEN)]
    response = measured_response(response_csv(plant, HIGHEST_HZ))
    return operator_file(fitted(traces, response), "x", V_MAX)


def plan_of(piezo: str, rate_hz: float, *edits: str) -> Plan | None:
    """The plan of a scan; None where there is none."""
    timing = f"timing.line_rate_hz = {rate_hz}", f"dac.update_rate_hz = {UPDATES_HZ}", "timing.pixels = 64"
    response = response_csv(ForeignPlant(PIEZOS[piezo]), HIGHEST_HZ)
    with tempfile.TemporaryDirectory() as folder:
        try:
            return make_plan(sine_scan(Path(folder), operator_of(piezo), response, *timing, *edits), sines=True)
        except Rejected:
            return None


def errors_of(plan: Plan, piezo: str) -> dict[str, float]:
    """The errors of its image on the piezo itself."""
    return image_errors(*pixels_on_the_piezo(plan, ForeignPlant(PIEZOS[piezo])), WINDOW)


def best_line(piezo: str, rate_hz: float) -> tuple[str, dict[str, float]]:
    """The straight line of the least rms."""
    lines = {}
    for harmonics in HARMONICS:
        plan = plan_of(piezo, rate_hz, f"x.band_limit.harmonics = {harmonics}")
        if plan is not None:
            lines[f"line of {harmonics} harmonics"] = errors_of(plan, piezo)
    return min(lines.items(), key=lambda one: one[1]["rms"])


def rows() -> Iterator[str]:
    """The rows of the page."""
    for piezo in PIEZOS:
        for rate_hz in RATES_HZ:
            sine = plan_of(piezo, rate_hz, "- x.band_limit.harmonics", "x.motion = 'sine'")
            assert sine is not None
            played = pixels_on_the_piezo(sine, ForeignPlant(PIEZOS[piezo]))
            for motion, errors in (
                ("sine", image_errors(*played, WINDOW)),
                ("sine, at the places of the certificate", predicted_errors(sine, *played)),
                best_line(piezo, rate_hz),
            ):
                yield (
                    f"| {piezo}, {1e-3 * rate_hz:g} kHz | {motion} | {errors['rms']:.3f} | {errors['scaling']:.1f} | "
                    f"{errors['mismatch']:.2f} | {errors['size']:+.2f} |"
                )


def main() -> None:
    """Print the table, or write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="put the table into docs/sine.md")
    options = parser.parse_args()
    lines = []
    for line in rows():
        lines.append(line)
        print(line, file=sys.stderr, flush=True)
    table = "\n".join([HEAD, *lines])
    if not options.write:
        print(table)
        return
    text = PAGE.read_text("utf-8")
    PAGE.write_text(re.sub(r"\| piezo, line rate \|[^\n]*\n(\|[^\n]*\n)+", lambda _: table + "\n", text), "utf-8")


if __name__ == "__main__":
    main()
