"""A build as HTML for notebooks: drive and error over time as SVG, and the certificate. Nothing is loaded from outside.

The error is where the modelled piezo is less where it should be, to first order in the deviation between drive and
branch: x - tau = (w - u) / u'.
"""

from html import escape

import numpy as np

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.scan_warnings import brief_warnings
from tablegen.certificate.summary import certificate_lines, drive_lines, rate
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, Plan

_POINTS = 401
_WIDTH, _HEIGHT, _MARGIN = 400, 150, 40


def build_html(plan: Plan, certificates: dict[str, Certificate]) -> str:
    """A self-contained fragment."""
    schedule = plan.schedule
    title = f"{plan.name} on {plan.scanner}: {rate(schedule.line_rate)} lines of {schedule.ticks} ticks"
    parts = [
        f"<p><b>{escape(title)}</b>, {schedule.lines} lines a frame, {escape(rate(schedule.frame_rate))} frames</p>"
    ]
    parts += [f"<p><b>warning</b>: {escape(text)}</p>" for text in brief_warnings(plan, certificates)]
    for line in plan.moving:
        t = np.linspace(0.0, 1.0, _POINTS)
        volts = line.drive.v_offset + line.drive.v_amplitude * (line.series.value(t) - 0.5)
        parts.append("<div>")
        parts.append(_plot(f"{line.axis}: drive [V]", line, t, {"drive": volts}))
        parts.append(_plot(f"{line.axis}: modelled error [% of the line]", line, t, _errors(line, t)))
        parts.append("</div>")
        rows = [*drive_lines(line), *certificate_lines(certificates[line.axis])]
        cells = "".join(f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>" for name, value in rows)
        parts.append(f"<details><summary>{line.axis}: drive and certificate</summary><table>{cells}</table></details>")
    return "\n".join(parts)


def _errors(line: LinePlan, t: Floats) -> dict[str, Floats]:
    """Where the modelled piezo is less where it should be, in percent of the line, inside the imaging windows.

    ``triangle`` is that of a drive without compensation; outside of the windows the values are NaN.
    """
    shape, (low, high) = line.drive.shape, line.band_limit.window
    forward = t <= shape.turn
    tau = np.where(forward, t / shape.turn, (1.0 - t) / (1.0 - shape.turn))  # where the piezo should be
    inside = (tau >= low) & (tau <= high) & (forward | (line.band_limit.directions == "both"))
    sweep = np.where(forward, tau, 1.0 - tau)
    steepness = np.where(forward, shape.forward.slope(sweep), shape.backward.slope(sweep))
    deviation = (line.described.value(t) - shape.value(t)) / steepness
    uncompensated = np.where(forward, shape.forward.inverse(tau), 1.0 - shape.backward.inverse(1.0 - tau)) - tau
    return {
        "triangle": np.where(inside, 100.0 * uncompensated, np.nan),
        "compensated": np.where(inside, 100.0 * deviation, np.nan),
    }


# Blue and orange are told apart by all eyes, and a dashed line without colour.
_STYLES = {"drive": "#1f5fa8", "compensated": "#1f5fa8", "triangle": '#d98e04" stroke-dasharray="4 3'}


def _plot(title: str, line: LinePlan, t: Floats, curves: dict[str, Floats]) -> str:
    """One plot over a period, the imaging windows shaded."""
    values = np.concatenate(list(curves.values()))
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    low, high = (low, high) if high - low > 1e-12 else (low - 1.0, high + 1.0)

    def x(time: float) -> float:
        return _MARGIN + (_WIDTH - _MARGIN - 8) * time

    def y(value: float) -> float:
        return _HEIGHT - 22 - (_HEIGHT - 44) * (value - low) / (high - low)

    parts = [
        f'<svg width="{_WIDTH}" height="{_HEIGHT}" role="img" aria-label="{escape(title)}" '
        f'style="font:10px sans-serif" fill="currentColor">',
        f'<text x="{_MARGIN}" y="12">{escape(title)}</text>',
    ]
    turn, (first, last) = line.drive.turn, line.band_limit.window
    windows = [(turn * first, turn * last)]
    if line.band_limit.directions == "both":
        windows.append((turn + (1.0 - turn) * (1.0 - last), turn + (1.0 - turn) * (1.0 - first)))
    parts += [
        f'<rect x="{x(a):.1f}" y="20" width="{x(b) - x(a):.1f}" height="{_HEIGHT - 42}" fill="#8899bb" '
        f'fill-opacity="0.15"/>'
        for a, b in windows
    ]
    for value in (low, high):
        shown = f"{value:.3g}" if abs(value) > 1e-3 * (high - low) else "0"
        parts.append(f'<text x="{_MARGIN - 4}" y="{y(value) + 3:.1f}" text-anchor="end">{shown}</text>')
    for at, (name, values_of) in enumerate(curves.items()):
        style = f'fill="none" stroke="{_STYLES[name]}" stroke-width="1.5"'
        runs = np.split(np.arange(len(t)), np.flatnonzero(np.diff(np.isfinite(values_of).astype(int))) + 1)
        for run in runs:
            if np.isfinite(values_of[run[0]]):
                points = " ".join(f"{x(float(t[i])):.1f},{y(float(values_of[i])):.1f}" for i in run)
                parts.append(f'<polyline points="{points}" {style}/>')
        if len(curves) > 1:
            right = _WIDTH - 8 - 76 * at
            parts.append(f'<text x="{right}" y="12" text-anchor="end" fill="{_STYLES[name][:7]}">{name}</text>')
    period_s = 1.0 / float(line.rate)
    parts.append(f'<text x="{_MARGIN}" y="{_HEIGHT - 6}">0</text>')
    parts.append(f'<text x="{_WIDTH - 8}" y="{_HEIGHT - 6}" text-anchor="end">{period_s:.4g} s</text></svg>')
    return "".join(parts)
