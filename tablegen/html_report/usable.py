"""The offsets and sizes within driver, converter and amplifier, with this scan in them."""

from fractions import Fraction

import numpy as np

from tablegen.charts.chart import Chart, DrawnCurve, Mark
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.offset_sizes import OffsetSurface
from tablegen.html_report.blocks import Charts, Paragraph, Section
from tablegen.html_report.subject import PlannedScan
from tablegen.numerics.arrays import Floats
from tablegen.planning.laws import offset_surface
from tablegen.planning.line_plan import LinePlan
from tablegen.planning.table_maker import StoredWave

_OFFSETS = 101
_SIZES = 241


def usable(planned: PlannedScan) -> Section:
    """Return a chart per axis."""
    blocks = [_axis(planned, line) for line in planned.plan.moving]
    words = [word for _, words in blocks for word in words]
    return Section(
        "usable",
        "Usable offsets and sizes",
        (Charts(tuple(chart for chart, _ in blocks)), *(Paragraph(word, "quiet") for word in words)),
        "Lines below the curve fit, at this rate and with the waveform of this scan. Other sizes have slightly other "
        "waveforms, so near the curve `tablegen check` decides.",
    )


def _axis(planned: PlannedScan, line: LinePlan) -> tuple[Chart, list[str]]:
    drive = line.drive
    offsets, largest, cause = largest_sizes(planned, line)
    curves = [DrawnCurve("largest line", "other", offsets, largest, "area")]
    traces = drive.shape.identification.traces
    if traces:
        v = np.array([trace.stroke for trace in traces])
        curves.append(
            DrawnCurve(
                "traces of the operator",
                "before",
                drive.driver.volts(np.array([trace.centre for trace in traces])),
                np.array([drive.size_law.size_nm(min(one / (drive.m * drive.g), 1.0)) for one in v.tolist()]),
                "points",
            )
        )
    curves.append(DrawnCurve("this scan", "limit", np.array([drive.v_offset]), np.array([drive.size_nm]), "points"))
    top = 1.15 * max(float(np.max(largest)), drive.size_nm)
    here = float(np.interp(drive.v_offset, offsets, largest))
    words = [
        f"{line.axis}: at {drive.v_offset:.4g} V the largest line is about {here:.4g} nm; this one has "
        f"{drive.size_nm:.4g} nm. {cause}"
    ]
    chart = Chart(
        f"usable-{line.axis}",
        f"{line.axis}: usable scans",
        "offset [V]",
        "size of the line [nm]",
        tuple(curves),
        marks=(Mark(drive.v_offset, ""), Mark(drive.size_nm, "", "y")),
        x_range=(drive.driver.v_min, drive.driver.v_max),
        y_range=(0.0, top),
    )
    return chart, words


def largest_sizes(planned: PlannedScan, line: LinePlan) -> tuple[Floats, Floats, str]:
    """Compute the largest line at each offset, with the waveform of this scan.

    Returns ------- Offsets in V and the largest line at each in nm, shape (offsets,) each; and the limit at this scan's
    offset, in words.
    """
    drive, driver = line.drive, line.drive.driver
    low, high = StoredWave(line.series).reach
    ends = sorted(
        line.converter.v_zero + line.converter.v_per_code * code for code in (0, (1 << line.converter.bits) - 1)
    )
    bottom, top = max(driver.v_min, ends[0]), min(driver.v_max, ends[1])
    slew = planned.setup.hardware(line.axis).amplifier.max_slew_v_per_s
    fastest = np.inf if slew is None else slew / (line.series.peak_slope() * float(Fraction(line.rate)))
    surface = _surface(planned, line)
    v = np.linspace(0.0, 1.0, _SIZES)[1:]
    sizes = np.array([drive.size_law.size_nm(one) for one in v.tolist()])
    laws = [surface.at(one) for one in v.tolist()]
    offsets = np.linspace(driver.v_min, driver.v_max, _OFFSETS)
    largest = np.zeros(_OFFSETS)
    for i, offset in enumerate(offsets.tolist()):
        p = driver.p(offset)
        amplitude = np.array([law.factor(p) for law in laws]) * drive.g * v * driver.span
        room = min((offset - bottom) / max(0.5 - low, 1e-9), (top - offset) / max(high - 0.5, 1e-9), fastest)
        fits = amplitude <= room * (1.0 + 1e-9)
        largest[i] = float(sizes[fits][-1]) if fits[0] else 0.0
    if slew is not None and fastest < min(
        (drive.v_offset - bottom) / (0.5 - low), (top - drive.v_offset) / (high - 0.5)
    ):
        return offsets, largest, "The slew rate of the amplifier bounds it."
    if bottom > driver.volts(1e-3) or top < driver.volts(0.999):
        return offsets, largest, f"The converter reaches {bottom:.4g}..{top:.4g} V of the driver's {driver}."
    return offsets, largest, f"The driver's {driver} bound it."


def _surface(planned: PlannedScan, line: LinePlan) -> OffsetSurface:
    """Compute m over offset and size."""
    axis = getattr(planned.setup.scanner, line.axis)
    if axis.offset is None:
        return OffsetSurface.everywhere(OffsetLaw())
    return offset_surface(axis.offset, line.drive.driver, line.drive.size_law)
