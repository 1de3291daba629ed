"""A built-in virtual scanner scaled to the range and the size of another one."""

from dataclasses import dataclass, fields, replace
from math import tau
from typing import Any

import numpy as np

from tablegen.config.scanner import Scanner, ScannerAxis
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver
from tablegen.virtual.line_error import ideal_triangle
from tablegen.virtual.scanner import VirtualAxis, VirtualScanner

_SAME = 0.05  # sizes that differ by less are those of the scanner as it is
_NEAR = 2.0  # a resonance that is no farther away than by this factor stays where it is
_TICKS = 2000


@dataclass(frozen=True)
class ScaledAxis(VirtualAxis):
    """An axis whose displacement is ``times`` as large; its response to small signals excludes the factor."""

    times: float = 1.0

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """Return the displacement of ``VirtualAxis.settled``, ``times`` as large.

        Returns
        -------
        Displacement in nm, shape (ticks,).
        """
        return self.times * super().settled(volts, tick_s)

    def follow(self, volts: Floats, tick_s: float, mean_v: float | None = None) -> Floats:
        """Return the displacement of ``VirtualAxis.follow``, ``times`` as large.

        Returns
        -------
        Displacement in nm, shape (ticks,).
        """
        return self.times * super().follow(volts, tick_s, mean_v)


def scaled_to(scanner: VirtualScanner, file: Scanner) -> tuple[VirtualScanner, str]:
    """Scale the scanner to the drive range of a file, and to its nm per V at ``base_nm``; describe the changes.

    Its resonance becomes that of the file if that is more than a factor of 2 away; other frequencies stay. A scanner
    whose size agrees with the file within 5 % in both axes, over the same range, and whose resonances stay, is returned
    as it is, with an empty text.
    """
    axes = {name: _scaled(getattr(scanner, name), getattr(file, name), file.driver) for name in ("x", "y")}
    faster = {name: _faster(axis, getattr(file, name)) for name, axis in axes.items()}
    same_range = all(axis.driver == file.driver for axis in (scanner.x, scanner.y))
    if same_range and not any(faster.values()) and all(abs(axis.times - 1.0) <= _SAME for axis in axes.values()):
        return scanner, ""
    changes = [" and ".join(f"{getattr(file, name).size.k_nm_per_v:g} nm/V in {name}" for name in axes)]
    for name, times in faster.items():
        if times is not None:
            axes[name] = replace(axes[name], resonance=axes[name].resonance.faster(times))
            changes.append(f"a resonance of {getattr(file, name).resonance.frequency_hz:g} Hz in {name}")
    return VirtualScanner(
        scanner.name, axes["x"], axes["y"], scanner.coupling
    ), f"scaled to {file.driver}, {', '.join(changes)}"


def _scaled(axis: VirtualAxis, file: ScannerAxis, driver: Driver) -> ScaledAxis:
    """Scale the axis so that a slow triangle of the volts that k gives ``base_nm`` moves ``base_nm``."""
    share = min(file.size.base_nm / (file.size.k_nm_per_v * driver.span), 1.0)
    drive = 0.5 + share * (ideal_triangle(_TICKS, 0.5) - 0.5)
    stroke_nm = float(np.ptp(axis.hysteresis.settled(drive)))
    attributes: dict[str, Any] = {field.name: getattr(axis, field.name) for field in fields(axis)}
    return ScaledAxis(**{**attributes, "driver": driver}, times=file.size.k_nm_per_v * share * driver.span / stroke_nm)


def _faster(axis: VirtualAxis, file: ScannerAxis) -> float | None:
    """Return the ratio of the file's resonance to that of the axis; None where that of the axis stays."""
    if file.resonance is None or file.resonance.frequency_hz is None or not axis.resonance.poles:
        return None
    times = tau * file.resonance.frequency_hz / abs(axis.resonance.poles[0])  # the first pole is the first resonance's
    return None if 1.0 / _NEAR <= times <= _NEAR else times
