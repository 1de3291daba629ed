"""Synthetic measurements with a known truth, from the paper's equations as printed and not from the package's laws.

Each case makes one noisy measurement from a generator of random numbers and fits it. A trial counts as a hit where the
truth lies within two standard errors.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import cos, exp, log10, pi, sin, tan
from typing import Any

import numpy as np

from tablegen.calibration.laws.frequency import fit_frequency
from tablegen.calibration.laws.hysteresis import HysteresisFit, Trace, fit_hysteresis
from tablegen.calibration.laws.image_sizes import Acquisition, ImageSizes, KnownSample, SampleImage, sizes_of
from tablegen.calibration.laws.images import Pair, fit_images
from tablegen.calibration.laws.offset import fit_offset
from tablegen.calibration.laws.resonance import fit_resonance
from tablegen.calibration.laws.size import fit_size
from tablegen.fitting.estimate import Estimate
from tablegen.images.line_length import Cell, Grating
from tablegen.numerics.arrays import Floats

NOISE = 0.002  # rms, of the issue
V_MAX = 100.0
OFFSETS = np.array([7.0, 25.0, 50.0, 75.0, 93.0])
DRIVES = np.array([5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0])
FREQUENCIES = np.geomspace(1.0, 3000.0, 15)
RESPONSE = np.concatenate([np.geomspace(100.0, 36e3, 20), np.linspace(36.5e3, 44e3, 30), np.geomspace(45e3, 60e3, 8)])
AMPLITUDES = (30.0, 60.0, 100.0)
IMAGED_DRIVES = np.array([10.0, 25.0, 40.0, 60.0, 80.0, 100.0])
IMAGED_OFFSETS = np.array([10.0, 30.0, 50.0, 70.0, 90.0])
LATTICE_NM, PITCH_NM = 17.7, 50.0

Found = dict[str, tuple[Estimate, float]]  # each parameter with its truth
Case = Callable[[np.random.Generator, float], Found]


def apparent(offset_v: Floats, m_minus: float, m_plus: float, centre_nm: float) -> Floats:
    """Equations (1)-(4)."""
    p = 2.0 * offset_v / V_MAX - 1.0
    return centre_nm * (1.0 + (m_plus - m_minus) / 2.0 * p + ((m_plus + m_minus) / 2.0 - 1.0) * p**2)


def actual(drive_v: Floats, k: float, beta: float, threshold: float, base_nm: float) -> Floats:
    """Equations (6), (8), (10), for a base size below the threshold."""
    full = k * V_MAX
    alpha = full / (1.0 + beta * base_nm / full)
    v = drive_v / V_MAX
    linear = alpha * ((1.0 + 2.0 * beta * threshold) * v - beta * threshold**2)
    return np.where(v > threshold, linear, alpha * v * (1.0 + beta * v))


def branch(beta: float, u_peak: float) -> Callable[[Floats], Floats]:
    """u(tau) of a forward branch, equations (17)-(21) as printed."""
    at = u_peak - beta
    t = tan(pi * at / 2.0)
    gamma = pi / 2.0 * (t * t - 1.0) / (t * t - pi * t + 1.0)
    xi = beta / (gamma * (cos(pi * at) + 2.0 * at - 1.0) + sin(pi * at))
    lam = 1.0 + 2.0 * xi * gamma
    return lambda tau: lam * tau + xi * (np.sin(pi * tau) + gamma * (np.cos(pi * tau) - 1.0))


def inverse(law: Callable[[Floats], Floats], u: Floats) -> Floats:
    """tau with law(tau) = u, by bisection."""
    low, high = np.zeros_like(u), np.ones_like(u)
    for _ in range(54):
        middle = 0.5 * (low + high)
        below = law(middle) < u
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def grown(v_scan: float, beta_max: float, rho: float) -> float:
    """Equation (22)."""
    return beta_max * (1.0 - exp(-rho * v_scan / V_MAX)) / (1.0 - exp(-rho))


@dataclass(frozen=True)
class Scanner:
    """Section 9's scanner, and how its traces are taken."""

    forward: tuple[float, float, float] = (0.037, 4.0, 0.37)  # beta_max, rho, u_peak
    backward: tuple[float, float, float] = (0.080, 1.5, 0.48)
    turn: float = 0.5
    period_s: float = 0.01
    begins: float = 0.137  # in periods after a minimum of the drive
    delay_s: float = 0.0
    drift: float = 0.01  # of the scan, over the record
    sign: float = 1.0

    def trace(self, v_scan: float, periods: float = 3.3, samples: int = 1000, noise: Floats | None = None) -> Trace:
        """A record; ``noise`` is that of displacement and drive, two rows, of the scan."""
        time = np.arange(samples) / samples * periods * self.period_s
        drive = self._triangle(time)
        moved = self._moved(time - self.delay_s, v_scan) + self.drift * time / time[-1]
        noise = np.zeros((2, samples)) if noise is None else noise
        volts = 50.0 + v_scan * (drive - 0.5 + noise[1])
        return Trace(f"{v_scan:g} V", time, volts, 3.0 + self.sign * 10.0 * v_scan * (moved + noise[0]))

    def images(self, v_scan: float, sample: "Sample", noise: float, random: np.random.Generator) -> Pair:
        """Trace and retrace of a sample, left on the left; ``noise`` rms of the heights' peak to peak."""
        low, high = sample.window
        place = low + (high - low) * (np.arange(sample.pixels) + 0.5) / sample.pixels
        laws = [branch(grown(v_scan, beta_max, rho), u) for beta_max, rho, u in (self.forward, self.backward)]
        lines = np.arange(sample.lines)[:, None]
        shown = []
        for x, within in (
            (inverse(laws[0], place), self.turn * place),
            (1.0 - inverse(laws[1], 1.0 - place), self.turn + (1.0 - self.turn) * (1.0 - place)),
        ):
            frame = (lines + sample.lag * within) / sample.lines
            heights = sample.height(v_scan / V_MAX * (x + sample.drift * frame**2), v_scan / V_MAX * frame)
            shown.append(heights + noise * float(np.ptp(heights)) * random.standard_normal(heights.shape))
        return Pair(f"{v_scan:g} V", v_scan, shown[0], shown[1])

    def _triangle(self, time: Floats) -> Floats:
        phase = (time / self.period_s + self.begins) % 1.0
        return np.where(phase <= self.turn, phase / self.turn, (1.0 - phase) / (1.0 - self.turn))

    def _moved(self, time: Floats, v_scan: float) -> Floats:
        drive = self._triangle(time)
        rising = (time / self.period_s + self.begins) % 1.0 <= self.turn
        laws = [branch(grown(v_scan, beta_max, rho), u) for beta_max, rho, u in (self.forward, self.backward)]
        # The backward branch is the forward one turned by half a turn: it begins where drive and position are 1.
        return np.where(rising, inverse(laws[0], drive), 1.0 - inverse(laws[1], 1.0 - drive))


@dataclass(frozen=True)
class Sample:
    """A periodic sample: of each wave its periods in a line of 100 V, angle in degrees, height, and phase in turns.

    ``lag`` is 1 for a slow axis that ramps and 0 for one that steps; ``drift`` of the line, quadratic in the frame.
    """

    waves: tuple[tuple[float, float, float, float], ...]
    pixels: int = 256
    lines: int = 256
    window: tuple[float, float] = (0.0, 1.0)
    lag: float = 1.0
    drift: float = 0.0

    def height(self, x: Floats, y: Floats) -> Floats:
        """At x and y in lines of 100 V."""
        total = np.zeros(np.broadcast(x, y).shape)
        for periods, angle, size, begins in self.waves:
            a = angle * pi / 180.0
            total = total + size * np.sin(2.0 * pi * (periods * (x * cos(a) + y * sin(a)) + begins))
        return total


def grating(periods: float = 14.3, angle: float = 3.0, begins: float = 0.2, **options: Any) -> Sample:
    """Bars that are no sine wave: three harmonics."""
    sizes = ((1.0, 0.0), (0.3, 0.1), (0.15, 0.3))
    waves = tuple((n * periods, angle, size, n * begins + more) for n, (size, more) in enumerate(sizes, 1))
    return Sample(waves, **options)


def lattice(periods: float = 14.3, angle: float = 7.0, **options: Any) -> Sample:
    """Hexagonal, with waves of different heights."""
    waves = tuple((periods, angle + 60.0 * n, 1.0 - 0.1 * n, 0.3 * n) for n in range(3))
    return Sample(waves, **options)


def offset_case(random: np.random.Generator, noise: float) -> Found:
    sizes = apparent(OFFSETS, 0.92, 1.25, 17.7) + 17.7 * noise * random.standard_normal(len(OFFSETS))
    fit = fit_offset(OFFSETS, sizes, V_MAX)
    return {"m_minus": (fit.m_minus, 0.92), "m_plus": (fit.m_plus, 1.25)}


def size_case(random: np.random.Generator, noise: float) -> Found:
    sizes = actual(DRIVES, 10.0, 0.53, 0.5, 200.0) * (1.0 + noise * random.standard_normal(len(DRIVES)))
    fit = fit_size(DRIVES, sizes, V_MAX)
    truth = {"k_nm_per_v": 10.0, "beta": 0.53, "v_threshold": 0.5}
    return {name: (getattr(fit, name), value) for name, value in truth.items()}


def frequency_case(random: np.random.Generator, noise: float) -> Found:
    gain = np.array([2.5 * (1.0 - 0.03 * log10(f / 100.0)) for f in FREQUENCIES])
    fit = fit_frequency(FREQUENCIES, gain * (1.0 + noise * random.standard_normal(len(gain))), 100.0)
    return {"alpha": (fit.alpha, 0.03)}


def resonance_case(random: np.random.Generator, noise: float) -> Found:
    r = RESPONSE / 40e3
    h = 3.0 * np.exp(-2j * pi * RESPONSE * 3e-6) / (1.0 - r**2 + 1j * r / 20.0)
    gain = np.abs(h) * (1.0 + noise * random.standard_normal(len(r)))
    phase = np.degrees(np.angle(h) + noise * random.standard_normal(len(r)))
    fit = fit_resonance(RESPONSE, gain, phase)
    truth = {"frequency_hz": 40e3, "quality": 20.0, "delay_s": 3e-6}
    return {name: (getattr(fit, name), value) for name, value in truth.items()}


def hysteresis_case(random: np.random.Generator, noise: float) -> Found:
    scanner = Scanner()
    traces = [scanner.trace(v, noise=noise * random.standard_normal((2, 1000))) for v in AMPLITUDES]
    return _branches(scanner, fit_hysteresis(traces, V_MAX))


def _branches(scanner: Scanner, found: HysteresisFit) -> Found:
    (fit,) = found.branches
    return {
        f"{side}.{name}": (getattr(getattr(fit, side), name), truth)
        for side, truths in (("forward", scanner.forward), ("backward", scanner.backward))
        for name, truth in zip(("beta_max", "rho", "u_peak"), truths, strict=True)
    }


def images_case(random: np.random.Generator, noise: float) -> Found:
    """A grating as it comes to lie; noise of 5 % where a sensor has 0.2 %."""
    scanner = Scanner()
    sample = grating(random.uniform(11.0, 20.0), random.uniform(-6.0, 6.0), random.uniform())
    pairs = [scanner.images(v, sample, 25.0 * noise, random) for v in AMPLITUDES]
    return _branches(scanner, fit_images(pairs, V_MAX))


def scan_of(
    nm: float, v: float, random: np.random.Generator, noise: float, pixels: int = 160, offset_v: float | None = None
) -> SampleImage:
    """Trace and retrace of a line so long: of a lattice in any direction, or from 300 nm on of a grating; drifting."""
    drift = random.uniform(-0.02, 0.02)
    if nm < 300.0:
        periods, angle, shape = nm / (LATTICE_NM * 3.0**0.5 / 2.0), random.uniform(-90.0, 90.0), lattice
    else:
        periods, angle, shape = nm / PITCH_NM, random.uniform(-6.0, 6.0), grating
    sample = shape(periods * V_MAX / v, angle, pixels=pixels, lines=pixels, drift=drift * V_MAX / v)
    shown = Scanner().images(v, sample, noise, random)
    return SampleImage(f"{v:g} V", v, offset_v, shown.trace, shown.retrace)


def measured(images: list[SampleImage]) -> ImageSizes:
    """What such images say."""
    return sizes_of(images, V_MAX, KnownSample(Cell.hexagonal(LATTICE_NM), Grating(PITCH_NM)), Acquisition())


def size_of_images_case(random: np.random.Generator, noise: float) -> Found:
    """Sizes from images, with noise of 5 % where a table has 0.2 %."""
    nm = actual(IMAGED_DRIVES, 10.0, 0.53, 0.5, 200.0)
    pairs = zip(nm.tolist(), IMAGED_DRIVES.tolist(), strict=True)
    found = measured([scan_of(one, v, random, 25.0 * noise) for one, v in pairs])
    fit = fit_size(IMAGED_DRIVES, found.nm, V_MAX, errors_nm=found.errors_nm, shared=found.shared)
    truth = {"k_nm_per_v": 10.0, "beta": 0.53, "v_threshold": 0.5}
    return {name: (getattr(fit, name), value) for name, value in truth.items()}


def offset_of_images_case(random: np.random.Generator, noise: float) -> Found:
    """One scan voltage at several offsets, as images show a lattice."""
    looks = apparent(IMAGED_OFFSETS, 0.92, 1.25, 1.0)
    pairs = zip((130.0 / looks).tolist(), IMAGED_OFFSETS.tolist(), strict=True)
    found = measured([scan_of(nm, 13.0, random, 25.0 * noise, 128, at) for nm, at in pairs])
    sizes = LATTICE_NM * 130.0 / found.nm
    fit = fit_offset(IMAGED_OFFSETS, sizes, V_MAX, errors_nm=sizes * found.errors_nm / found.nm)
    return {"m_minus": (fit.m_minus, 0.92), "m_plus": (fit.m_plus, 1.25)}


CASES: dict[str, Case] = {
    "offset": offset_case,
    "size": size_case,
    "hysteresis": hysteresis_case,
    "images": images_case,
    "frequency": frequency_case,
    "resonance": resonance_case,
}


# Some seconds a trial, so that there are fewer of them.
IMAGED_CASES: dict[str, Case] = {
    "offset --image": offset_of_images_case,
    "size --image": size_of_images_case,
}


def trials(kind: str, count: int, noise: float = NOISE, seed: int = 20) -> Iterator[Found]:
    """So many fits, each of its own noise."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield (CASES | IMAGED_CASES)[kind](random, noise)


def distances(kind: str, count: int, seed: int = 20) -> dict[str, Floats]:
    """How many standard errors each estimate is from its truth."""
    found: dict[str, list[float]] = {}
    for one in trials(kind, count, seed=seed):
        for name, (estimate, truth) in one.items():
            found.setdefault(name, []).append((estimate.value - truth) / estimate.standard_error)
    return {name: np.array(values) for name, values in found.items()}
