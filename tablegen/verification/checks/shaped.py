"""Shaped codes, computed again from the integers of a manifest in another way, and the errors that arrive.

Remainders of order 1 and 2 are sums of all values so far, modulo a code; those of order 3 are carried on one by one.
docs/manifest.md says of which ticks the figures are, and behind what.
"""

from functools import cached_property

import numpy as np

from tablegen.fixedpoint.program import Program
from tablegen.manifest.fields import ManifestAxis, ManifestShaped
from tablegen.numerics.arrays import Floats, Ints
from tablegen.verification.checks.passage import passes

MOST_TICKS = 1 << 20  # of one period
_SEVERAL_TICKS, _PERIODS = 1 << 18, 17
_CODE_AND_REMAINDER_BITS = 28


def step_excess(axis: ManifestAxis) -> int:
    """Return the bound of what shaping adds to a step, in codes."""
    shaping = axis.output.shaping
    if shaping is None:
        return 0
    return {1: 2, 2: 4}.get(shaping.order, 4 + (shaping.zero + 31) // 32)


def code_excess(axis: ManifestAxis) -> float:
    """Return the bound of the distance of a shaped code from its unrounded value, in codes."""
    shaping = axis.output.shaping
    if shaping is None:
        return 0.5
    return {1: 1.0, 2: 2.0}.get(shaping.order, 2.0 + shaping.zero / 64)


def shaped_codes(program: Program, count: int) -> Ints:
    """Return the first codes of a shaped program since it began, within its limits.

    Parameters
    ----------
    count
        Number of ticks, which may be several periods.

    Returns
    -------
    Ints
        Codes, shape (count,).
    """
    output = program.output
    bits = _CODE_AND_REMAINDER_BITS - output.dac_bits
    half = 1 << (bits - 1)
    ticks = np.arange(min(count, program.ticks), dtype=np.int64)
    exact = output.gain_word * program.samples(ticks) + output.offset_word
    # Subtract the half code of the rounding again, so that remainders are centred on 0.
    value = np.resize(((exact + (1 << (output.gain_q - 1))) >> (output.gain_q - bits)) - half, count)
    order = output.shaping.order
    if order == 3:
        residue = _carried(value, half, output.shaping.zero)
    else:
        residue = value
        for _ in range(order):
            residue = np.cumsum(residue)  # wraps at 2^64, a multiple of every code
        residue = (residue + half & 2 * half - 1) - half
    e1, e2, e3 = (np.concatenate([np.zeros(by, dtype=np.int64), residue])[:count] for by in (1, 2, 3))
    feedback = {1: e1, 2: 2 * e1 - e2}.get(order, e1 - e2 + e3 + output.shaping.zero * (e1 - e2) // 64)
    codes: Ints = np.clip((value + feedback - residue) // (2 * half), output.code_min, output.code_max)
    return codes


def _carried(value: Ints, half: int, zero: int) -> Ints:
    past = [0, 0, 0]
    for one in value.tolist():
        change = past[-1] - past[-2]
        feedback = one + change + past[-3] + zero * change // 64
        past.append((feedback + half) % (2 * half) - half)
    return np.array(past[3:], dtype=np.int64)


class ShapedPlay:
    """The periods of a shaped axis that a certificate judges; ``intended`` are unrounded codes, one a tick."""

    def __init__(self, axis: ManifestAxis, intended: Floats, update_rate_hz: float) -> None:
        self.axis, self._rate_hz = axis, update_rate_hz
        program = axis.program
        ticks = min(program.ticks, MOST_TICKS)
        self.is_whole = ticks == program.ticks
        periods = max(1, min(_PERIODS, _SEVERAL_TICKS // ticks))
        self._intended = intended
        self._shaped = shaped_codes(program, periods * ticks).reshape(periods, ticks)
        self._rounded = np.tile(program.rounded.codes(np.arange(ticks, dtype=np.int64)), (periods, 1))
        self._first = min(periods - 1, 1)

    @property
    def codes(self) -> Ints:
        """The codes of the judged periods.

        Returns
        -------
        Ints
            One period after another, shape (periods * ticks,).
        """
        return self._shaped[self._first :].reshape(-1)

    @property
    def code_errors(self) -> Floats:
        """The codes less the unrounded codes of the judged periods.

        Returns
        -------
        Floats
            LSB of the converter, shape (periods * ticks,).
        """
        return np.asarray((self._shaped - self._intended)[self._first :].reshape(-1))

    @cached_property
    def position_errors(self) -> Floats | None:
        """The errors of the position in the judged periods.

        Returns
        -------
        Floats or None
            LSB of the converter, shape (periods, ticks); None where the manifest states no passage.
        """
        return self._behind(self._shaped)

    @cached_property
    def rounded_errors(self) -> Floats | None:
        """The errors of the position in the judged periods if codes were rounded instead of shaped.

        Returns
        -------
        Floats or None
            LSB of the converter, shape (periods, ticks); None where the manifest states no passage.
        """
        return self._behind(self._rounded)

    def _behind(self, codes: Ints) -> Floats | None:
        stated = self.axis.certificate.shaped
        if stated is None:
            return None
        errors = (codes - self._intended).reshape(-1)
        size = 2
        while size < 2 * len(errors):
            size *= 2
        factor = passes(stated.passage, np.arange(size // 2 + 1, dtype=np.float64) * (self._rate_hz / size))
        arrived = np.fft.irfft(np.fft.rfft(errors, size) * factor, size)
        return np.asarray(arrived[: len(errors)].reshape(codes.shape)[self._first :])

    def figures(self) -> dict[str, float | int | None]:
        """Return the figures of shaping; those of the position where they can be computed."""
        errors, changes, before = self.code_errors, _changes(self.codes), _changes(self._judged_rounded)
        values: dict[str, float | int | None] = {
            "ticks": len(self.codes),
            "max_code_error_lsb": float(np.max(np.abs(errors))),
            "rms_code_error_lsb": float(np.sqrt(np.mean(errors**2))),
            "largest_step": int(np.max(np.abs(np.diff(self.codes)))),
            "changes.percent": changes[0],
            "changes.mean_step": changes[1],
            "rounded.changes.percent": before[0],
            "rounded.changes.mean_step": before[1],
        }
        if self.rounded_errors is not None:
            values["rounded.max_error_lsb"] = float(np.max(np.abs(self.rounded_errors)))
            values["rounded.rms_error_lsb"] = float(np.sqrt(np.mean(self.rounded_errors**2)))
        return values

    @property
    def _judged_rounded(self) -> Ints:
        return self._rounded[self._first :].reshape(-1)


def _changes(codes: Ints) -> tuple[float, float]:
    steps = np.abs(codes[1:] - codes[:-1])
    changes = steps[steps > 0]
    return 100.0 * len(changes) / max(len(steps), 1), float(np.mean(changes)) if len(changes) else 0.0


def stated_shaping(stated: ManifestShaped | None) -> dict[str, float | int | None]:
    """Return what a certificate states of shaping, by the names of ``figures``."""
    if stated is None:
        return {}
    figures: dict[str, float | int | None] = {
        name: getattr(stated, name) for name in ("ticks", "max_code_error_lsb", "rms_code_error_lsb", "largest_step")
    }
    for prefix, changes in (("", stated.changes), ("rounded.", stated.rounded.changes)):
        figures |= {f"{prefix}changes.{name}": getattr(changes, name) for name in ("percent", "mean_step")}
    return figures | {f"rounded.{name}": getattr(stated.rounded, name) for name in ("max_error_lsb", "rms_error_lsb")}
