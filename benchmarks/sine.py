"""A sine and the best straight line at high rates, on simulated piezos that the project does not contain.

``python benchmarks/sine.py`` prints the table of docs/sine.md, ``--write`` puts it there. Each piezo is identified from
ten traces at 100 Hz and a response with noise, which is taken out of the traces as ``calibrate operator`` does; 200 nm
are planned, and the emitted integers are played on the piezo itself: hysteresis stepped tick by tick, creep, two modes
and a dead time. A pixel is the mean over its ticks. The straight line has the number of harmonics that leaves the
least.

``--limits`` prints, or writes, the table of what limits the sine: with parts of the piezo itself in place of those that
were identified, and with other measurements.
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

import numpy as np
from foreign_plants import TEN, V_MAX, BoucWen, ForeignPlant, ManyPlays, record
from msgspec import Struct, structs
from operator_scans import fitted
from replacing import replace
from sine_scans import image_errors, measured_response, pixels_on_the_piezo, predicted_errors, response_csv, sine_scan

from tablegen.base.input_errors import Rejected
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.compensation.line import SineLine
from tablegen.compensation.models.operator import OperatorIdentification
from tablegen.compensation.operator.creep import NO_CREEP
from tablegen.compensation.operator.settled import settled
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.pixel_table import with_pixel_table
from tablegen.waveform.series import FourierSeries

PAGE = Path(__file__).parent.parent / "docs" / "sine.md"
PIEZOS = {"plays": ManyPlays(1), "bouc-wen": BoucWen()}
RATES_HZ = (5e3, 10e3, 20e3)
UPDATES_HZ = 20e6
HARMONICS = (3, 5, 7, 9, 11, 13, 15, 21, 27)
HIGHEST_HZ = 150e3  # of the response that was measured
WINDOW = (0.1, 0.9)
PLACE_HARMONICS = 64
LIMITS_HEAD = (
    "| | rms, 5 kHz | scaling | rms, 10 kHz | scaling | rms, 20 kHz | scaling |\n|---|---|---|---|---|---|---|"
)
HEAD = "| piezo, line rate | motion | rms | scaling | trace and retrace | size |\n|---|---|---|---|---|---|"


class Measurement(Struct, frozen=True):
    """How a laboratory measures: noise of traces, as a share of their span, and of points of the response.

    ``turning`` is that of their phase in radians. Without ``before`` the traces keep the response.
    """

    traces: float = 1e-3
    points: int = 600
    noise: float = 1e-3
    turning: float = 0.0
    seed: int = 5
    before: bool = True

    def response_of(self, piezo: str) -> str:
        """The response of a piezo, as a CSV."""
        plant = ForeignPlant(PIEZOS[piezo])
        return response_csv(plant, HIGHEST_HZ, self.points, self.noise, self.turning, self.seed)


USUAL = Measurement()


@cache
def operator_of(piezo: str, how: Measurement = USUAL) -> bytes:
    """The operator of a piezo, from ten noisy traces at 100 Hz, behind its measured response."""
    plant = ForeignPlant(PIEZOS[piezo])
    traces = [Trace(f"{k}", *record(plant, at, stroke, seed=k, noise=how.traces)) for k, (at, stroke) in enumerate(TEN)]
    response = measured_response(how.response_of(piezo)) if how.before else None
    return operator_file(fitted(traces, response), "x", V_MAX)


def plan_of(piezo: str, rate_hz: float, *edits: str, how: Measurement = USUAL) -> Plan | None:
    """The plan of a scan; None where there is none."""
    timing = f"timing.line_rate_hz = {rate_hz}", f"dac.update_rate_hz = {UPDATES_HZ}", "timing.pixels = 64"
    operator, response = operator_of(piezo, how), how.response_of(piezo)
    with tempfile.TemporaryDirectory() as folder:
        try:
            return make_plan(sine_scan(Path(folder), operator, response, *timing, *edits), sines=True)
        except Rejected:
            return None


def sine_of(piezo: str, rate_hz: float, how: Measurement = USUAL) -> Plan:
    """The plan of a sine."""
    plan = plan_of(piezo, rate_hz, "- x.band_limit.harmonics", "x.motion = 'sine'", how=how)
    assert plan is not None
    return plan


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
            sine = sine_of(piezo, rate_hz)
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


def with_own(plan: Plan, piezo: str, own: str) -> Plan:
    """The plan with pixels where the piezo is if parts of it, of hysteresis, creep and response, are its own."""
    schedule, line, plant = plan.schedule, plan.x, ForeignPlant(PIEZOS[piezo])
    shape = line.drive.shape
    assert isinstance(shape, SineLine)
    known = shape.identification
    assert isinstance(known, OperatorIdentification)
    u = (line.converter.v_zero + line.converter.v_per_code * line.codes(0, schedule.ticks)) / V_MAX
    n = np.arange(1, len(u) // 2)
    f_hz = n.astype(np.float64) * float(schedule.line_rate)
    if "hysteresis" in own:
        moved = plant.core.settled(u)  # its sensitivity only changes the size
    else:
        loop = known.operator.loop(float(np.min(u)), float(np.max(u)), known.factor, float(np.mean(u)))
        moved = settled(loop, u, float(schedule.line_rate), NO_CREEP, None)
    real, imaginary = known.operator.creep.response(f_hz)
    linear = plant.crept(f_hz) if "creep" in own else real + 1j * imaginary
    if "response" in own:
        linear = linear * plant.dynamics(f_hz)
    else:
        response = known.operator.dynamics(line.drive.response)
        assert response is not None
        real, imaginary = response.inverse(np.minimum(f_hz, response.highest_hz))
        linear = linear / (real + 1j * imaginary)
    c = 2.0 * (np.fft.rfft(moved)[n] * linear)[:PLACE_HARMONICS] / len(u)
    c = c * np.exp(-1j * np.pi * n[:PLACE_HARMONICS] / len(u))  # a code is held for its tick
    place = FourierSeries(0.0, c.real.copy(), -c.imag.copy())
    values = place.on_grid(1 << 14)
    low, size = float(np.min(values)), float(np.ptp(values))
    place = FourierSeries(-low / size, place.a / size, place.b / size)
    return replace(plan, schedule=with_pixel_table(schedule, place, WINDOW))


PARTS = "hysteresis", "creep", "response"
SEEDS = range(5, 8)  # of the noise of a response


def limits() -> Iterator[tuple[str, list[list[dict[str, float]]]]]:
    """Rows of the table of limits: at each rate the errors on each piezo, and with each noise."""
    for text, own in (
        ("as above", ""), *((f"{one} of the piezo itself", one) for one in PARTS), ("all three", " ".join(PARTS)),
    ):  # fmt: skip
        found = []
        for rate_hz in RATES_HZ:
            plans = {piezo: sine_of(piezo, rate_hz) for piezo in PIEZOS}
            changed = {piezo: with_own(plan, piezo, own) if own else plan for piezo, plan in plans.items()}
            found.append([errors_of(plan, piezo) for piezo, plan in changed.items()])
        yield text, found
    found = []
    for rate_hz in RATES_HZ:
        plans = {piezo: sine_of(piezo, rate_hz) for piezo in PIEZOS}
        played = {piezo: pixels_on_the_piezo(plan, ForeignPlant(PIEZOS[piezo])) for piezo, plan in plans.items()}
        found.append([predicted_errors(plans[piezo], *played[piezo]) for piezo in PIEZOS])
    yield "without the rounding to ticks", found
    for text, how, seeds in (
        ("traces without noise", Measurement(traces=1e-6), (5,)),
        ("response without noise", Measurement(noise=0.0), (5,)),
        ("response of 200 points, without noise", Measurement(points=200, noise=0.0), (5,)),
        ("response of 100 points, without noise", Measurement(points=100, noise=0.0), (5,)),
        ("response with 0.1 % and 0.06 degrees of noise", Measurement(turning=1e-3), SEEDS),
        ("response with 0.3 % and 0.17 degrees of noise", Measurement(noise=3e-3, turning=3e-3), SEEDS),
        ("operator from before the response was known", Measurement(before=False), (5,)),
    ):
        found = []
        for rate_hz in RATES_HZ:
            hows = [structs.replace(how, seed=seed) for seed in seeds]
            found.append([errors_of(sine_of(piezo, rate_hz, one), piezo) for piezo in PIEZOS for one in hows])
        yield text, found


def limit_rows() -> Iterator[str]:
    """The same as text: mean and worst of rms and scaling."""
    for text, found in limits():
        cells = []
        for errors in found:
            for name, digits in (("rms", 3), ("scaling", 1)):
                values = [one[name] for one in errors]
                cells.append(f"{np.mean(values):.{digits}f} / {max(values):.{digits}f}")
        yield f"| {text} | {' | '.join(cells)} |"


def main() -> None:
    """Print a table, or write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="put the table into docs/sine.md")
    parser.add_argument("--limits", action="store_true", help="the table of what limits the sine")
    options = parser.parse_args()
    head, lines = LIMITS_HEAD if options.limits else HEAD, list[str]()
    for line in limit_rows() if options.limits else rows():
        lines.append(line)
        print(line, file=sys.stderr, flush=True)
    table = "\n".join([head, *lines])
    if not options.write:
        print(table)
        return
    text = PAGE.read_text("utf-8")
    first = re.escape(head.partition("\n")[0])
    PAGE.write_text(re.sub(rf"{first}\n(\|[^\n]*\n)+", lambda _: table + "\n", text), "utf-8")


if __name__ == "__main__":
    main()
