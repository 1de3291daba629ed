"""Waveforms at equal bandwidth and at equal error: scaling error, and peak acceleration beside the least there is."""

import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np
from build_cost import with_operators
from editing import edited
from scaling import SECTION_8, worst

from sections.processes import python_version
from sections.section import Section
from tablegen.certificate.certificate import certify
from tablegen.certificate.optimum import least_acceleration, with_optimum
from tablegen.compensation.line import LineShape
from tablegen.config.load import load
from tablegen.config.schema import BandLimit
from tablegen.numerics.arrays import Floats
from tablegen.planning.band_limit import band_limited
from tablegen.planning.enough_harmonics import plain_line
from tablegen.planning.line_plan import make_plan
from tablegen.waveform.minimum_acceleration import Straightness, fewest_harmonics, minimum_acceleration_series
from tablegen.waveform.series import FourierSeries

WINDOW = (0.1, 0.9)
STRAIGHT = Straightness(SECTION_8, SECTION_8, WINDOW, True)
PLAIN = plain_line(0.5)
HARMONICS = 32
MOST_SOLVED = 96  # harmonics for which the optimum is worked out: more take minutes
TRIED = (8, 10, 12, 14, 16, 18, 20, 22, 24, 28, 32, 40, 48, 64, 80, 96, 128, 160, 192, 256, 320, 384, 512)
PERCENT = (1.0, 0.3, 0.05)
_GRID = 1 << 14  # times of a period from which harmonics of a spline come
TITLE = "Waveforms"
TEXT = """The line of section 8 of the paper: turn at 0.5, imaged from 0.1 to 0.9 both ways. The error is the scaling
error in the window, peak to peak, the worse of both ways; acceleration is its peak, of the line per period squared.
"least" is the optimum of a linear programme (HiGHS) of as many harmonics, up to 96, at the same error, without a say
in where the line lies. A triangle and a rounded triangle (parabolas outside the window) are what is played without
compensation; the spline follows the compensated line in the window, and turns on cubics of the least mean square
acceleration outside. Equal error: the fewest harmonics, of 23 numbers up to 512, by which a method keeps it."""
HEAD = ("compared at", "waveform", "harmonics", "error [%]", "acceleration", "least", "over least")
Method = Callable[[int], FourierSeries]


def splined(shape: LineShape, t: Floats, derivative: int = 0) -> Floats:
    """The line in its window, and cubics from window to window with the same value and slope at both ends.

    Values or accelerations (``derivative`` 0 or 2) at times in periods. Of all turns between the same ends, a cubic has
    the least mean square acceleration.
    """
    low, high = WINDOW
    turn = shape.turn
    t = np.asarray(t, dtype=np.float64) % 1.0
    step = 1e-5
    bend = (shape.slope((t + step) % 1.0) - shape.slope((t - step) % 1.0)) / (2.0 * step)
    out: Floats = shape.value(t) if derivative == 0 else bend
    # The turn at the end of the line, and the one at its start, which begins in the period before.
    for start, stop in (
        (turn * high, turn + (1.0 - turn) * (1.0 - high)),
        ((1.0 - turn) * (1.0 - low) + turn, 1.0 + turn * low),
    ):
        ends = np.array([start, stop]) % 1.0
        (p, q), (v, w) = shape.value(ends), (stop - start) * shape.slope(ends)
        s = ((t - start) % 1.0) / (stop - start)
        two, three = 3.0 * (q - p) - 2.0 * v - w, 2.0 * (p - q) + v + w
        cubic = (
            p + s * (v + s * (two + s * three))
            if derivative == 0
            else (2.0 * two + 6.0 * s * three) / (stop - start) ** 2
        )
        out = np.where(s <= 1.0, cubic, out)
    return out


def spline(shape: LineShape) -> Method:
    """The first harmonics of ``splined``."""
    found = np.fft.rfft(splined(shape, np.arange(_GRID) / _GRID)) / _GRID

    def of(harmonics: int) -> FourierSeries:
        kept = found[1 : harmonics + 1]
        return FourierSeries(float(found[0].real), 2.0 * kept.real, -2.0 * kept.imag)

    return of


def limited(shape: LineShape, method: str) -> Method:
    """One of the build's own methods."""
    limit = BandLimit(method=method, window=WINDOW, directions="both")  # type: ignore[arg-type]
    return lambda harmonics: band_limited(shape, limit, harmonics)


METHODS: dict[str, Method] = {
    "triangle": limited(PLAIN, "truncate"),
    "rounded triangle": spline(PLAIN),
    "truncated Fourier series": limited(SECTION_8, "truncate"),
    "sigma factors": limited(SECTION_8, "lanczos"),
    "minimum-acceleration spline": spline(SECTION_8),
    "ours, fit of the window": limited(SECTION_8, "window"),
}


def of_series(compared: str, what: str, series: FourierSeries) -> list[str]:
    """A row of a series, with the optimum of as many harmonics at the same error beside it."""
    error, peak = worst(SECTION_8, series, *WINDOW), series.peak_acceleration()
    shown = ["", ""]
    if series.harmonics <= MOST_SOLVED:
        least = least_acceleration(STRAIGHT, series.harmonics, error)
        shown = beside(peak, least) if least is not None else ["none so", ""]
    return [compared, what, str(series.harmonics), f"{error:.2g}", f"{peak:.1f}", *shown]


def beside(peak: float, least: float) -> list[str]:
    """The last two cells of a row."""
    return [f"{least:.1f}", f"{peak / least:.2f}"]


def at_equal_bandwidth() -> list[list[str]]:
    """All methods with as many harmonics."""
    rows = [of_series("bandwidth", what, method(HARMONICS)) for what, method in METHODS.items()]
    for percent in reversed(PERCENT):
        rows.append(
            of_series(
                "bandwidth",
                f"ours, least acceleration at {percent:g} %",
                minimum_acceleration_series(STRAIGHT, HARMONICS, percent),
            )
        )
    return rows


def fewest(method: Method, percent: float) -> FourierSeries | None:
    """The series of the fewest harmonics of ``TRIED`` that keeps an error; None if none does."""
    return next((s for s in map(method, TRIED) if worst(SECTION_8, s, *WINDOW) <= percent), None)


def at_equal_error() -> list[list[str]]:
    """Each method with the harmonics that it needs."""
    rows = []
    for percent in PERCENT:
        compared = f"error {percent:g} %"
        for what, method in METHODS.items():
            series = fewest(method, percent)
            if series is None:
                rows.append([compared, what, f"not by {TRIED[-1]}", *[""] * 4])
            else:
                rows.append(of_series(compared, what, series))
        least = fewest_harmonics(STRAIGHT, percent, 1, TRIED[-1])
        assert least is not None
        for what, harmonics in (("fewest harmonics", least), *(("least acceleration", h) for h in (HARMONICS, 64))):
            rows.append(of_series(compared, f"ours, {what}", minimum_acceleration_series(STRAIGHT, harmonics, percent)))
    return rows


def operator_rows() -> list[list[str]]:
    """The example's x on an operator that was identified on the virtual scanner: learnt, and gentle."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        scan = with_operators(Path(name))["operator of x"]
        text = scan.read_text("utf-8")
        for percent in (None, 0.3):
            if percent is not None:
                scan.write_text(edited(text, f"x.band_limit.max_scaling_error_percent = {percent}"), "utf-8")
            plan = make_plan(load(scan))
            found = with_optimum(plan.x, certify(plan)["x"])
            assert found.peak_acceleration is not None
            what = "as it is learnt" if percent is None else "least acceleration"
            cells = ["", ""] if found.optimum is None else beside(found.peak_acceleration, found.optimum)
            error = "its own" if percent is None else f"{percent:g}"
            peak = f"{found.peak_acceleration:.1f}"
            rows.append(["the operator's line", f"ours, {what}", str(plan.x.target.harmonics), error, peak, *cells])
    return rows


def unlimited() -> list[str]:
    """The spline with all its harmonics: what no bandwidth would allow."""
    peak = float(np.max(np.abs(splined(SECTION_8, np.arange(_GRID) / _GRID, 2))))
    return ["no band limit", "minimum-acceleration spline", "all", "0", f"{peak:.1f}", "", ""]


def measure() -> Section:
    """All rows, the same on every machine but for the last digits of HiGHS."""
    rows = [*at_equal_bandwidth(), *at_equal_error(), unlimited(), *operator_rows()]
    return Section(TITLE, TEXT, HEAD, rows, notes(rows), python_version() | {"scipy": version("scipy")})


def notes(rows: list[list[str]]) -> list[str]:
    """Where another is better."""
    better = []
    for percent in PERCENT:
        here = [one for one in rows if one[0] == f"error {percent:g} %" and one[4]]
        ours = min(float(one[4]) for one in here if one[1].startswith("ours, least") and one[2] == str(HARMONICS))
        better += [
            f"{one[1]} at {percent:g} % ({one[4]} with {one[2]} harmonics)"
            for one in here
            if not one[1].startswith("ours") and float(one[4]) < ours
        ]
    return [
        f"Gentler than our {HARMONICS} harmonics at the same error: {', '.join(better) or 'none'}.",
        "The spline without a band limit is the mark that more harmonics approach; its acceleration jumps at the "
        "ends of the window, which a resonance answers.",
        "The fit of the window, our default by laws, does not minimise the peak: `max_scaling_error_percent` does.",
    ]
