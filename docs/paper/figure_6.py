"""Figure 6 and section 10: scan size against rate."""

from functools import cache
from math import log10

import numpy as np
from matplotlib.figure import Figure

from paper.drawing import BLUE, GREY, ORANGE, key, printed, sheet
from paper.laws import LOSS
from paper.measured import RATE_HZ, axis
from paper.rows import Row, Source, about, exact, limits
from tablegen.calibration.laws.frequency import fit_frequency
from tablegen.compensation.frequency import frequency_gain
from tablegen.virtual.experiments import frequency_response

TITLE = "Figure 6: scan rate"
TEXT = """The law is (23) with 3 % a decade. R is normalised to its value at the reference, because its 0.03 has to be
read in this way. The virtual scanner was identified on the 3 % a decade and on the resonance of figure 6c. A frame is
assumed to have 200 lines."""

SLOW_FPS, FAST_FPS, LINES = 0.5, 7.3, 200
LATTICE_NM = 17.7


def grown() -> float:
    """The factor of the apparent lattice constant from 0.5 to 7.3 fps by (23)."""
    return frequency_gain(FAST_FPS, LOSS, SLOW_FPS)


@cache
def virtual_grown() -> float:
    """The same factor from the virtual scanner's response to small signals."""
    slow, fast = frequency_response(axis(), [SLOW_FPS * LINES, FAST_FPS * LINES])["gain"]
    return float(slow / fast)


@cache
def resonance_khz() -> float:
    """The frequency at which the virtual scanner's response is largest."""
    f = np.geomspace(1e4, 1e5, 8001)
    return float(f[np.argmax(np.abs(axis().response(f)))]) / 1e3


@cache
def loss() -> float:
    """alpha of (23), by ``tablegen calibrate frequency``, from 1 Hz to a fifteenth of the resonance."""
    f = np.geomspace(1.0, 3e3, 15)
    return fit_frequency(f, frequency_response(axis(), f)["gain"], RATE_HZ).alpha.value


def change_of(factor: float) -> float:
    """The change of the size by a change of the rate, by (23), in percent."""
    return 100.0 * LOSS * log10(factor)


def rows() -> list[Row]:
    """Section 10 in its order."""
    law, known = Source.LAW, Source.IDENTIFIED
    rate = FAST_FPS / SLOW_FPS
    why = (
        f"18.3 nm over 17.7 nm is {100.0 * (18.3 / 17.7 - 1.0):.1f} %; 0.03 a decade, a number of one digit, gives "
        f"{100.0 * (grown() - 1.0):.1f} % for 14.6 times the rate"
    )
    return [
        Row(
            "6b",
            "7.3 fps over 0.5 fps",
            exact("14"),
            rate,
            Source.ARITHMETIC,
            "the paper cuts 14.6 off and does not round it",
        ),
        Row("6b", "lattice at 7.3 fps, 17.7 nm at 0.5 fps, (23)", exact("18.3", "nm"), LATTICE_NM * grown(), law),
        Row("6b", "lattice at 7.3 fps, virtual scanner", exact("18.3", "nm"), LATTICE_NM * virtual_grown(), known),
        Row("6b", "18.3 nm above 17.7 nm", exact("3", "%"), 100.0 * (18.3 / 17.7 - 1.0), Source.ARITHMETIC),
        Row("6b", "increase of the lattice by (23)", exact("3", "%"), 100.0 * (grown() - 1.0), law, why),
        Row("6c", "resonance", about("50", "kHz"), resonance_khz(), known),
        Row("sec. 3", "resonance in the scanner", about("40", "kHz"), resonance_khz(), known, "figure 6c has 50 kHz"),
        Row("6d", "alpha_DL", exact("0.03"), loss(), known),
        Row("sec. 10", "loss of size, a decade", about("3", "%"), 100.0 * loss(), known),
        Row("sec. 10", "two times the rate", limits("below 1 to 2 %", "%", high=2.0), change_of(2.0), law),
        Row("sec. 10", "three times the rate", limits("below 1 to 2 %", "%", high=2.0), change_of(3.0), law),
    ]


def figure_6d() -> Figure:
    """The response, and its slow loss enlarged."""
    figure, [[whole, enlarged]] = sheet(1, 2, 10.6, 4.0)
    f = np.geomspace(1.0, 2e5, 4000)
    gain = frequency_response(axis(), f)["gain"]
    whole.loglog(f, gain, color=BLUE, label="virtual scanner (simulation)")
    whole.axvline(50e3, color=ORANGE, lw=1.2, ls=":")
    printed(whole, [50e3], [float(np.max(gain))], ORANGE, "printed: 50 kHz")
    whole.set(title="6c: response to small signals", xlabel="frequency [Hz]", ylabel="gain", xlim=(1, 2e5))
    low = f <= 1e4
    enlarged.semilogx(f[low], gain[low], color=BLUE, label="virtual scanner (simulation)")
    decades = np.log10(f[low] / RATE_HZ)
    enlarged.semilogx(f[low], 1.0 - LOSS * decades, color=ORANGE, lw=1.2, ls="--", label="(23), 3 % a decade")
    rates = np.array([SLOW_FPS, FAST_FPS]) * LINES
    start = 1.0 - LOSS * log10(rates[0] / RATE_HZ)
    printed(enlarged, [*rates], [start, start * 17.7 / 18.3], ORANGE, "printed: 17.7 to 18.3 nm")
    enlarged.axhline(1.0, color=GREY, lw=0.7)
    enlarged.set(title="6d: enlarged", xlabel="frequency [Hz]", ylabel="gain", xlim=(1, 1e4), ylim=(0.9, 1.1))
    key(whole, loc="upper left")
    key(enlarged, loc="lower left")
    return figure


PICTURES = {"figure_6d": ("Gain against frequency, and its slow loss", figure_6d)}
