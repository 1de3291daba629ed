"""Texts of the two files that ``tablegen init`` writes."""

from dataclasses import dataclass
from math import ceil, floor, log10

from tablegen.compensation.size import SizeLaw

SCANNER_FILE = "scanner.toml"
_V_MAX = 100.0  # V, of the example's driver
_CONVERTER_SPAN = 10.0  # V, of the example's converter
_K, _BETA, _BASE_NM = 10.0, 0.53, 200.0
_SHARE = 0.8  # of the line of x that is imaged
_FASTEST_HZ = 500.0
TABLE_LENGTHS = (2048, 4096, 8192, 16384, 32768, 65536)
_FEW_BITS = 16  # below, the scan has to use most of the converter
_USUAL_NM = 200.0  # of an image
_FITTING = (0.02, 0.5)  # shares of the scanner's range that an image may span: less is quantised, more does not fit
_NEW_SHARE = 0.25


@dataclass(frozen=True)
class Wishes:
    """Requirements of the scan; ``rate`` is a key of ``[timing]`` and its value, None for a suitable rate."""

    bits: int = 16
    update_rate_hz: float = 500e3
    image_nm: float = 200.0
    pixels: int = 200
    image_lines: int = 200
    frame: str = "flyback"
    rate: tuple[str, float] | None = None
    name: str = ""
    table_length: int = 2048
    v_min: float | None = None
    v_max: float | None = None
    nm_per_v: float | None = None
    gain: float | None = None

    @property
    def own_scanner(self) -> bool:
        """True if anything is known of the user's scanner: the example's piezo would then be somebody else's."""
        return any(value is not None for value in (self.v_min, self.v_max, self.nm_per_v, self.gain))

    @property
    def driver(self) -> tuple[float, float]:
        """The range of the piezo driver in V."""
        low = 0.0 if self.v_min is None else self.v_min
        return low, low + _V_MAX if self.v_max is None else self.v_max

    @property
    def scan_name(self) -> str:
        """The name that was given, or one from the size of the image: annexin_200nm for the example's size."""
        if self.name:
            return self.name
        if self.image_nm == 200.0:
            return "annexin_200nm"
        return f"image_{self.image_nm:g}nm".replace(".", "_").replace("+", "").replace("-", "_")

    @property
    def timing(self) -> tuple[str, float, str]:
        """Key, value and comment of the rate; by default a pixel is a whole number of ticks, two at least."""
        if self.rate is not None:
            return (*self.rate, "")
        ticks = max(2, ceil(0.5 * _SHARE * self.update_rate_hz / (self.pixels * _FASTEST_HZ)))
        rate = 0.5 * _SHARE * self.update_rate_hz / (self.pixels * ticks)
        return "line_rate_hz", rate, f"a pixel is {ticks} ticks; "


def usual_image_nm(driver: tuple[float, float], nm_per_v: float | None) -> float:
    """Return the size of an image, in nm, that a scanner can make.

    Parameters
    ----------
    driver : tuple[float, float]
        The range of the piezo driver in V.
    nm_per_v : float or None
        The sensitivity of the scanner, with a range above 0 and finite; None for the example's scanner, whose range
        fits the image.

    Returns
    -------
    float
        200 nm if that is from 2 to 50 % of the scanner's range; otherwise the largest of 1, 2 and 5 times a power of
        ten up to a quarter of the range.
    """
    if nm_per_v is None:
        return _USUAL_NM
    whole = (driver[1] - driver[0]) * nm_per_v
    if _FITTING[0] * whole <= _USUAL_NM <= _FITTING[1] * whole:
        return _USUAL_NM
    most = _NEW_SHARE * whole
    power = floor(log10(most))
    steps = [step * 10.0**place for place in (power - 1, power) for step in (1, 2, 5)]
    return float(f"{max(step for step in steps if step <= most):.1g}")


def files(wishes: Wishes) -> dict[str, str]:
    """Return the texts of scanner file and scan file by their names."""
    return {SCANNER_FILE: _scanner(wishes), f"{wishes.scan_name}.toml": _scan(wishes)}


def _scan(wishes: Wishes) -> str:
    key, value, why = wishes.timing
    others = [other for other in ("line_rate_hz", "frame_rate_hz", "speed_um_per_s") if other != key]
    few = wishes.bits < _FEW_BITS
    limits = [("max_error_lsb", 1.0)] + ([] if few else [("max_scaling_error_percent", 0.5)])
    table = [f"length = {wishes.table_length}"] if wishes.table_length != TABLE_LENGTHS[0] else []
    table += [f"bits = {min(wishes.bits + 2, 24)}"] if wishes.bits > 16 else []
    tables = "\n[x.table]\n" + "\n".join(table) + "\n" if table else ""
    return f"""\
# {_size(wishes.image_nm)} at the centre of the positioning range. `tablegen show {wishes.scan_name}.toml` prints all
# that follows from it. Units are part of every key; voltages are at the piezo unless a key says otherwise.
name = "{wishes.scan_name}"
scanner = "{SCANNER_FILE}"         # relative to this file
{_line(f"image_nm = {_number(wishes.image_nm)}", "what the image spans; or [x, y]; or image_um")}

[timing]
{_line(f"pixels = {wishes.pixels}", "per line and direction")}
{_line(f"image_lines = {wishes.image_lines}", "the line periods for turnarounds are added to them")}
{_line(f'frame = "{wishes.frame}"', "flyback: every image goes up | up-down: up and down in turn")}
{_line(f"{key} = {_number(value)}", f"{why}or {' or '.join(others)}")}

[x]
{_line(f"offset_v = {_number(0.5 * sum(wishes.driver))}", "where the image is; or offset_nm")}
{tables}
[y]
{_line('like = "x"', 'the same; keys of y take precedence. motion = "off" makes a line scan')}

[limits]                         # optional: the build fails if the certificate exceeds a limit
{chr(10).join(f"{name} = {most}" for name, most in limits)}
"""


def _converter(wishes: Wishes) -> str:
    return f"""\
[dac]
{_line(f"bits = {wishes.bits}", "")}
{_line('coding = "offset-binary"', "offset-binary | twos-complement")}
{_line("v_min = -5.0", "V at the converter")}
v_max = 5.0
{_line(f"update_rate_hz = {_number(wishes.update_rate_hz)}", "ticks: updates of both converters a second")}
"""


def _own_scanner(wishes: Wishes) -> str:
    """Return the scanner of the user: the driver, the size, and nothing that nobody has measured on it."""
    low, high = wishes.driver
    span = high - low
    line_nm = wishes.image_nm / _SHARE
    if wishes.nm_per_v is None:
        k, origin = float(f"{line_nm / (0.3 * span):.3g}"), "a guess that fits the image: measure it"
    else:
        k, origin = wishes.nm_per_v, "as given"
    lowest = "" if wishes.v_min is None else _line(f"v_min = {_number(low)}", "V, least output of the driver") + "\n"
    gain = span / _CONVERTER_SPAN if wishes.gain is None else wishes.gain
    return f"""\
# The instrument: converter, amplifier and scanner. Voltages are at the piezo. What is not measured is not here.
name = "scanner"
{_line(f"v_max = {_number(high)}", "V, maximum output of the piezo driver; normalised voltages refer to it")}
{lowest}
{_converter(wishes)}
[amplifier]                      # piezo voltage = gain * converter voltage + bias_v
gain = {_number(gain)}
bias_v = {_number(0.5 * (low + high))}

[x.size]                         # `tablegen calibrate size` measures it, with how it bends
{_line(f"k_nm_per_v = {_number(k)}", origin)}
{_line(f"base_nm = {_number(min(line_nm, 0.5 * k * span))}", "the size at which k_nm_per_v holds")}

# Hysteresis is not corrected yet: typically some 10 % of the line. Take images of a grating or a lattice, trace and
# retrace, with a plain triangle of some voltages, and let the command write [x.hysteresis] here; then the same for y:
#   tablegen calibrate images --axis x --scanner {SCANNER_FILE} --write --pair VOLTS TRACE RETRACE
# With a displacement sensor: tablegen calibrate hysteresis, or tablegen calibrate operator.

[y]
like = "x"                       # all of it; tables of y take precedence
"""


def _scanner(wishes: Wishes) -> str:
    if wishes.own_scanner:
        return _own_scanner(wishes)
    factor = _factor(wishes)
    larger = "" if factor == 1.0 else f", with a range {factor:g} times as large"
    return f"""\
# The instrument: converter, amplifier, and a high-speed AFM scanner as the paper measured it{larger}.
# `tablegen calibrate` writes the values of your scanner in their place. Voltages are at the piezo.
name = "hs-afm"
{_line(f"v_max = {_number(_V_MAX)}", "V, maximum output of the piezo driver; normalised voltages refer to it")}

{_converter(wishes)}
[amplifier]                      # piezo voltage = gain * converter voltage + bias_v
gain = {_number(_V_MAX / 10.0)}
bias_v = {_number(0.5 * _V_MAX)}
{_line("max_slew_v_per_s = 2.0e6", "optional, at the piezo")}

[x.offset]                       # equations (1)-(4)
m_minus = 0.92                   # amplitude factor at V_offset = 0
m_plus = 1.25                    # amplitude factor at V_offset = v_max

[x.size]                         # equations (6)-(12)
{_line(f"k_nm_per_v = {_number(_K * factor)}", "calibrated at base_nm")}
beta = {_BETA}
base_nm = {_number(_BASE_NM * factor)}
v_threshold = 0.5                # normalised; above it the law is linear

[x.hysteresis]                   # equations (17)-(22)
model = "harmonic"               # triangle | sinusoidal | harmonic | operator

[[x.hysteresis.branches]]        # one entry per calibrated turning point
turn = 0.5
forward = {{ beta_max = 0.037, rho = 4.0, u_peak = 0.37 }}
backward = {{ beta_max = 0.080, rho = 1.5, u_peak = 0.48 }}

[x.frequency]                    # equation (23)
alpha = 0.03                     # relative amplitude lost per decade
reference_hz = 100.0

[y]
like = "x"                       # all of it, but for what follows

[y.offset]
m_minus = 0.90
m_plus = 1.22

[y.size]
beta = 0.60

[y.frequency]
reference_hz = 1.0
{_FLYBACK if wishes.frame == "flyback" else ""}"""


_FLYBACK = """
[[y.hysteresis.branches]]        # of frames that fly back
turn = 0.95
forward = { beta_max = 0.037, rho = 4.0, u_peak = 0.37 }
backward = { beta_max = 0.037, rho = 4.0, u_peak = 0.37 }
"""


def _factor(wishes: Wishes) -> float:
    """Return the range over that of the example: the image uses enough of it, with few bits most of it."""
    law = SizeLaw.calibrated(_K, _V_MAX, _BETA, _BASE_NM, 0.5)
    line_nm = wishes.image_nm / _SHARE
    if wishes.bits < _FEW_BITS:
        return float(f"{line_nm / law.size_nm(0.75):.3g}")
    least, most = line_nm / law.size_nm(0.5), line_nm / law.size_nm(0.2)
    return float(f"{min(max(1.0, least), most):.3g}")


def _line(text: str, comment: str) -> str:
    """Return a line with its comment in the column of the others."""
    return f"{text:<32} # {comment}".rstrip() if comment else text


def _number(value: float) -> str:
    """Format a float of TOML, without digits that it does not need."""
    short = f"{value:.10g}"
    if float(short) != value:
        short = repr(value)
    if abs(value) >= 1e4 and value % 1e3 == 0.0:
        return f"{value / 1e3:g}e3"
    return short if any(mark in short for mark in ".en") else f"{short}.0"


def _size(nm: float) -> str:
    return f"{nm:g} x {nm:g} nm" if nm < 1000.0 else f"{nm / 1e3:g} x {nm / 1e3:g} um"
