"""The pixels of a sine, computed again from the position that its manifest predicts: edges, and errors of each."""

import numpy as np

from tablegen.manifest.fields import ManifestAxis, ManifestPixels, ManifestSequence
from tablegen.numerics.arrays import Floats
from tablegen.verification.checks.certified import different_figures, on_grid

CHORD = 0.05  # share of the line
_GRID = 1 << 18  # points of a period, at least
_EDGE_TICKS = 1.0 + 1e-3  # by which an edge may be off its place
SIDES = ("forward", "backward")


def wrong_edges(sequence: ManifestSequence, axis: ManifestAxis) -> str | None:
    """Return why the pixels of a schedule are not where the piezo is; None where they are."""
    place, imaged, table = axis.fourier.place, axis.fourier.imaged, sequence.pixel_table
    if place is None or imaged is None or table is None:
        return "there, and the position or the imaged part is not"
    if not imaged[0] < imaged[1] or len(place.a) != len(place.b):
        return "there, and the position or the imaged part has no meaning"
    positions = on_grid(place, _GRID)
    bottom, top = int(np.argmin(positions)), int(np.argmax(positions))
    grid = imaged[0] + (imaged[1] - imaged[0]) * np.arange(sequence.pixels + 1) / sequence.pixels
    for side, counts, begin, end in (
        ("forward", table[0], bottom, bottom + (top - bottom) % _GRID),
        ("backward", table[1], top, top + (bottom - top) % _GRID),
    ):
        k = np.arange(begin, end + 1)
        way = positions[k % _GRID]
        if side == "backward":
            k, way = k[::-1], way[::-1]
        inside = (way >= grid[0]) & (way <= grid[-1])
        if np.any(np.diff(way[inside]) <= 0.0):
            return "there, and the piezo goes to and fro"
        due = np.interp(grid, way, k) * sequence.line_ticks / _GRID
        window = getattr(sequence, f"{side}_ticks")
        edges = window[0] + np.concatenate([[0], np.cumsum(counts)])
        half = 0.5 * sequence.line_ticks
        off = np.abs((edges - np.sort(due) + half) % (2.0 * half) - half)
        if float(np.max(off)) > _EDGE_TICKS:
            return f"{float(np.max(off)):.4g} ticks from where the piezo is, {side}, at pixel {int(np.argmax(off))}"
    return None


def wrong_pixels(sequence: ManifestSequence, axis: ManifestAxis) -> tuple[int, list[str]]:
    """Return the number of figures of the pixels in a certificate, and those that the table makes otherwise."""
    stated = axis.certificate.pixels
    if sequence.pixel_table is None:
        return 0, ["certificate.pixels is there, and the pixels have no table"] if stated is not None else []
    if stated is None:
        return 0, ["certificate.pixels is missing, and the pixels have a table"]
    errors = _errors(sequence, axis)
    wrong, count = [], 0
    for name, figures in _figures(errors, axis, sequence.pixels).items():
        sides = getattr(stated, name)
        count += len(figures)
        wrong += different_figures(sides, figures, True, f"pixels.{name}.")
    mismatch: dict[str, float | int | None] = {
        "mismatch_percent": float(np.max(np.abs(errors["forward"] - errors["backward"])))
    }
    wrong += different_figures({"mismatch_percent": stated.mismatch_percent}, mismatch, True, "pixels.")
    return count + 1, wrong + _wrong_errors(stated, errors)


def _errors(sequence: ManifestSequence, axis: ManifestAxis) -> dict[str, Floats]:
    """Compute the mean position over each pixel less that of the grid, in percent, by a sum over a fine grid."""
    place, imaged = axis.fourier.place, axis.fourier.imaged
    assert place is not None
    assert imaged is not None
    assert sequence.pixel_table is not None
    fine = -(-_GRID // sequence.line_ticks)
    values = on_grid(place, fine * sequence.line_ticks)
    sums = np.concatenate([[0.0], np.cumsum(0.5 * (values + np.roll(values, -1)))])
    grid = imaged[0] + (imaged[1] - imaged[0]) * (np.arange(sequence.pixels) + 0.5) / sequence.pixels
    errors = {}
    for side, counts in zip(SIDES, sequence.pixel_table, strict=True):
        edges = getattr(sequence, f"{side}_ticks")[0] + np.concatenate([[0], np.cumsum(counts)])
        means = np.diff(sums[edges * fine]) / (fine * np.diff(edges))
        errors[side] = 100.0 * ((means if side == "forward" else means[::-1]) - grid)
    return errors


def _figures(errors: dict[str, Floats], axis: ManifestAxis, pixels: int) -> dict[str, dict[str, float | int | None]]:
    assert axis.fourier.imaged is not None
    pitch = (axis.fourier.imaged[1] - axis.fourier.imaged[0]) / pixels
    step = min(max(round(CHORD / pitch), 1), pixels - 1)
    return {
        "rms_percent": {side: float(np.sqrt(np.mean(one * one))) for side, one in errors.items()},
        "worst_percent": {side: float(np.max(np.abs(one))) for side, one in errors.items()},
        "scaling_percent": {
            side: float(np.ptp(one[step:] - one[:-step])) / (step * pitch) if step else 0.0
            for side, one in errors.items()
        },
    }


def _wrong_errors(stated: ManifestPixels, errors: dict[str, Floats]) -> list[str]:
    """List the directions whose errors of single pixels differ by more than their six digits."""
    wrong = []
    for side, one in errors.items():
        other = np.array(stated.errors_percent.get(side, []))
        if len(other) != len(one) or np.any(np.abs(other - one) > 1e-5 * np.abs(one) + 1e-6):
            wrong.append(f"certificate.pixels.errors_percent.{side} is not what the table makes")
    return wrong
