"""A simulated piezo that the project does not contain: calibrated by the commands of tablegen, and scanned."""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from click.testing import CliRunner

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tests" / "helpers"))

from foreign_plants import SIX, V_MAX, ForeignPlant, record, triangle  # noqa: E402

import tablegen  # noqa: E402
from tablegen.cli import cli  # noqa: E402
from tablegen.config.load import load  # noqa: E402
from tablegen.numerics.arrays import Bools, Floats  # noqa: E402
from tablegen.refinement.round import Options, refine  # noqa: E402

WINDOW = (0.1, 0.9)
CHORD = 0.05  # of the line
TICK_S = 2e-6
SCANNER = """name = "foreign"
v_max = 100.0
[x.size]
k_nm_per_v = 10.0
[x.resonance]
frequency_hz = 60e3
quality = 14.0
delay_s = 2e-6
[y.size]
k_nm_per_v = 10.0
"""
SCAN = """name = "foreign"
scanner = "scanner.toml"
[dac]
bits = 16
v_min = -5.0
v_max = 5.0
update_rate_hz = 500e3
[amplifier]
gain = 10.0
bias_v = 50.0
[timing]
pixels = {pixels}
lines = 64
line_rate_hz = {rate_hz}
[x]
size_nm = {size_nm}
offset_v = {offset_v}
[x.band_limit]
method = "window"
harmonics = 32
window = [0.1, 0.9]
directions = "both"
[x.table]
mode = "interpolated"
length = 8192
bits = 18
[y]
size_nm = 100.0
offset_v = 50.0
"""
LAG_S = 2e-6 + 1.0 / (2.0 * np.pi * 60e3 * 14.0)  # of the resonance, that `calibrate hysteresis` is told


@dataclass(frozen=True)
class Line:
    """One scanned line over time: place on the line, where it goes forward, errors of place and size in percent."""

    x: Floats
    forward: Bools
    error: Floats
    size: float

    def side(self, forward: bool) -> tuple[Floats, Floats]:
        """Place and error of one direction, over the window, at even places."""
        mine = self.forward == forward
        order = np.argsort(self.x[mine])
        grid = np.linspace(*WINDOW, 801)
        return grid, np.interp(grid, self.x[mine][order], self.error[mine][order])

    @property
    def rms(self) -> float:
        """Of the direction that has more, percent of the line."""
        return max(float(np.sqrt(np.mean(self.side(way)[1] ** 2))) for way in (True, False))

    @property
    def scaling(self) -> float:
        """Peak to peak, of the direction that has more, percent."""
        found = []
        for way in (True, False):
            x, error = self.side(way)
            step = round(CHORD / (x[1] - x[0]))
            found.append(float(np.ptp(error[step:] - error[:-step])) / (x[step] - x[0]))
        return max(found)

    @property
    def mismatch(self) -> float:
        """Largest distance of trace and retrace, percent of the line."""
        return float(np.max(np.abs(self.side(True)[1] - self.side(False)[1])))


def command(*arguments: str) -> str:
    """Run a command of tablegen; what it printed."""
    result = CliRunner().invoke(cli, list(arguments), catch_exceptions=False)
    if result.exit_code:
        raise RuntimeError(result.output)
    return result.output


def calibrated(plant: ForeignPlant, folder: Path, protocol: tuple[tuple[float, float], ...] = SIX) -> str:
    """Scanner files ``laws.toml`` and ``operator.toml`` of one set of traces; what `calibrate operator` printed."""
    traces = []
    sizes = ["drive_v,actual_nm"]
    for number, (centre, stroke) in enumerate(protocol):
        columns = record(plant, centre, stroke, seed=number)
        path = folder / f"{100 * stroke:.0f}v_at_{100 * centre:.0f}v.csv"
        np.savetxt(path, np.column_stack(columns), "%.9g", ",", header="time_s,drive_v,displacement_nm", comments="")
        traces.append((centre, str(path)))
        if centre == 0.5:
            one = columns[2][-1000:]
            sizes.append(f"{V_MAX * stroke},{np.ptp(np.convolve(one, np.ones(5) / 5, 'valid'))}")
    (folder / "sizes.csv").write_text("\n".join(sizes) + "\n", "utf-8")
    centres = (0.1, 0.3, 0.5, 0.7, 0.9)
    seen = [float(np.ptp(plant.settled(triangle(400, centre, 0.1), 100.0))) for centre in centres]
    rows = [f"{V_MAX * centre},{20.0 * max(seen) / size}" for centre, size in zip(centres, seen, strict=True)]
    (folder / "offsets.csv").write_text("\n".join(["offset_v,apparent_nm", *rows]) + "\n", "utf-8")
    laws = folder / "laws.toml"
    laws.write_text(SCANNER, "utf-8")
    shared = ("--axis", "x", "--scanner", str(laws), "--write")
    command("calibrate", "size", str(folder / "sizes.csv"), *shared)
    command("calibrate", "offset", str(folder / "offsets.csv"), "--size-v", "10", *shared)
    rates = (10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
    reached = [float(np.ptp(plant.settled(triangle(400, 0.5, 0.1), rate))) for rate in rates]
    gains = [f"{rate},{size / reached[2]}" for rate, size in zip(rates, reached, strict=True)]
    (folder / "gains.csv").write_text("\n".join(["frequency_hz,gain", *gains]) + "\n", "utf-8")
    command("calibrate", "frequency", str(folder / "gains.csv"), "--reference-hz", "100", *shared)
    main = [path for centre, path in traces if centre == 0.5]
    command("calibrate", "hysteresis", *main, "--delay-s", f"{LAG_S:.3g}", *shared)
    operator = folder / "operator.toml"
    operator.write_bytes(laws.read_bytes())
    everything = [path for _, path in traces]
    shared = ("--axis", "x", "--scanner", str(operator), "--write", "--plot", str(folder / "fit.png"))
    return command("calibrate", "operator", *everything, *shared)


def scanned(
    plant: ForeignPlant, folder: Path, scanner: str, size_nm: float, offset_v: float, rate_hz: float, model: str = ""
) -> Line:
    """A line of the emitted codes on the plant."""
    text = SCAN.format(size_nm=size_nm, offset_v=offset_v, rate_hz=rate_hz, pixels=100)
    path = folder / "scan.toml"
    path.write_text(text.replace("scanner.toml", scanner), "utf-8")
    if model:
        other = (folder / scanner).read_text("utf-8").replace('model = "harmonic"', f'model = "{model}"')
        (folder / "other.toml").write_text(other, "utf-8")
        path.write_text(text.replace("scanner.toml", "other.toml"), "utf-8")
    return played(plant, tablegen.build(path).x.volts, rate_hz, size_nm)


def refined(plant: ForeignPlant, folder: Path, size_nm: float, offset_v: float, rate_hz: float) -> Line:
    """The same on the operator after one round of refining, from 50 periods of a sensor with 0.2 % of noise."""
    path = folder / "scan.toml"
    text = SCAN.format(size_nm=size_nm, offset_v=offset_v, rate_hz=rate_hz, pixels=100)
    path.write_text(text.replace("scanner.toml", "operator.toml"), "utf-8")
    volts = tablegen.build(path).x.volts
    turns = 0.37 + np.arange(50 * len(volts)) / len(volts)
    position = moved(plant, volts, rate_hz, 0.5)
    middles = (np.arange(len(volts)) + 0.5) / len(volts)
    noise = 0.002 * size_nm * np.random.default_rng(1).standard_normal(len(turns))
    reading = np.interp(turns, middles, position, period=1.0) + noise
    drive = np.interp(turns, middles, volts, period=1.0)
    layered = refine(load(path), "x", turns / rate_hz, reading, drive, Options()).setup
    return played(plant, tablegen.build(layered).x.volts, rate_hz, size_nm)


def moved(plant: ForeignPlant, volts: Floats, rate_hz: float, at: float) -> Floats:
    """Positions in nm, settled, of codes that are each held for a tick; ``at`` 0 begin and 1 end of each."""
    f = rate_hz * np.arange(len(volts) // 2 + 1)
    held = np.sinc(f * TICK_S) * np.exp(2j * np.pi * f * TICK_S * (at - 0.5))
    return np.fft.irfft(np.fft.rfft(plant.settled(volts, rate_hz)) * held, len(volts))


def played(plant: ForeignPlant, volts: Floats, rate_hz: float, size_nm: float) -> Line:
    """Codes on the plant."""
    position = moved(plant, volts, rate_hz, 0.0)
    t = np.arange(len(volts)) / len(volts)
    x = np.where(t <= 0.5, 2.0 * t, 2.0 - 2.0 * t)
    inside = (x >= WINDOW[0]) & (x <= WINDOW[1])
    slope, offset = np.polyfit(x[inside], position[inside], 1)
    error = 100.0 * ((position - offset) / slope - x)
    return Line(x, t <= 0.5, error, 100.0 * (float(slope) / size_nm - 1.0))
