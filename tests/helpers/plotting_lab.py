"""A folder with something to plot for every command that plots, and the words of those commands."""

from pathlib import Path
from typing import Any

import numpy as np
from calibrating import AMPLITUDES, DRIVES, FREQUENCIES, OFFSETS, RESPONSE, Scanner, actual, apparent, grating
from correcting import old_frame, save_pair
from editing import SCAN, write_pair
from foreign_plants import SIX, ForeignPlant, ManyPlays, record
from operator_files import operator_file, write_operator_scan
from refining import play, scanner, sensed

from tablegen.config.load import load

NOISE = 1.0 + 0.002 * np.random.default_rng(11).standard_normal(100)
_AXIS = ("--axis", "x", "--v-max", "100")
_PAIR = ("--pair", "100", "t100.npy", "r100.npy")

# By command: its words; all of them take --plot FILE.
PLOTTING: dict[str, tuple[str, ...]] = {
    "show": ("show", "scan.toml"),
    "show of a line": ("show", "line.toml"),
    "build": ("build", "scan.toml", "-o", "out", "-q"),
    "tables": ("tables", "scan.toml"),
    "simulate": ("simulate", "scan.toml", "--no-calibration"),
    "simulate own": ("simulate", "own/scan.toml"),
    "compare": ("compare", "scan.toml", "scan.toml"),
    "refine": ("refine", "scan.toml", "trace.csv", "--axis", "x"),
    "predict": ("predict", "own/scanner.toml", "o3.csv", "--axis", "x", "--against", "o3.csv"),
    "lattice": ("lattice", "trace.npy", "retrace.npy"),
    "drift": ("drift", "rough0.npy", "rough1.npy", "--seconds-apart", "10"),
    "correct": ("correct", "trace.npy", "retrace.npy", "--fit", "--lattice-nm", "60"),
    "calibrate offset": ("calibrate", "offset", *_AXIS, "offset.csv"),
    "calibrate size": ("calibrate", "size", *_AXIS, "size.csv"),
    "calibrate frequency": ("calibrate", "frequency", *_AXIS, "frequency.csv"),
    "calibrate resonance": ("calibrate", "resonance", *_AXIS, "resonance.csv"),
    "calibrate coupling": ("calibrate", "coupling", "x_moves.csv"),
    "calibrate hysteresis": ("calibrate", "hysteresis", *_AXIS, *(f"trace{v:g}.csv" for v in AMPLITUDES)),
    "calibrate images": ("calibrate", "images", *_AXIS, *_PAIR),
    "calibrate operator": ("calibrate", "operator", *_AXIS, "o1.csv", "o3.csv", "o5.csv"),
}
# Commands that write pages.
REPORTING: dict[str, tuple[str, ...]] = {
    "report": ("report", "scan.toml", "-o", "page.html"),
    "report own": ("report", "own/scan.toml", "-o", "page.html"),
    "report of a build": ("report", "out", "-o", "page.html"),
    "compare": ("compare", "scan.toml", "scan.toml", "-o", "page.html"),
    "calibrate": (*PLOTTING["calibrate hysteresis"], "--no-plot", "--report", "page.html"),
    "calibrate operator": (*PLOTTING["calibrate operator"], "--no-plot", "--report", "page.html"),
    "refine": (*PLOTTING["refine"], "--no-plot", "--report", "page.html"),
}


def make_lab(folder: Path) -> None:
    """Scans, measurements and images."""
    write_pair(folder)
    line = SCAN.split("\n[y]\n")[0].replace("lines = 200 ", "image_lines = 7")
    (folder / "line.toml").write_text(f"{line}\n[y]\nmotion = 'off'\noffset_v = 40.0\n", "utf-8")
    own = folder / "own"
    own.mkdir()
    write_operator_scan(own, operator_file(), "- [limits]")
    write_csv(folder / "offset.csv", offset_v=OFFSETS, apparent_nm=apparent(OFFSETS, 0.93, 1.22, 17.7) * NOISE[:5])
    sizes = actual(DRIVES, 11.0, 0.6, 0.5, 200.0) * NOISE[:11]
    write_csv(folder / "size.csv", drive_v=DRIVES, actual_nm=sizes)
    moves = np.linspace(0.0, 200.0, 100)
    write_csv(folder / "x_moves.csv", x_nm=moves, y_nm=0.02 * moves + 50.0 * (NOISE - 1.0))
    gain = (1.0 - 0.025 * np.log10(FREQUENCIES / 100.0)) * NOISE[:15]
    write_csv(folder / "frequency.csv", frequency_hz=FREQUENCIES, gain=gain)
    r = RESPONSE / 41e3
    h = np.exp(-2j * np.pi * RESPONSE * 2e-6) / (1.0 - r**2 + 1j * r / 15.0)
    phase = np.degrees(np.angle(h))
    write_csv(folder / "resonance.csv", frequency_hz=RESPONSE, gain=np.abs(h) * NOISE[:58], phase_deg=phase)
    noise = np.random.default_rng(12).standard_normal((3, 2, 800)) * 0.002
    for v, one in zip(AMPLITUDES, noise, strict=True):
        trace = Scanner(forward=(0.04, 3.0, 0.4), backward=(0.07, 1.2, 0.46)).trace(v, 3.3, 800, one)
        columns = {"time_s": trace.time_s, "drive_v": trace.drive_v, "displacement_nm": trace.displacement_nm}
        write_csv(folder / f"trace{v:g}.csv", **columns)
    pair = Scanner().images(100.0, grating(16.0, pixels=128, lines=96), 0.05, np.random.default_rng(8))
    np.save(folder / "t100.npy", pair.trace)
    np.save(folder / "r100.npy", pair.retrace)
    rough = np.cumsum(np.random.default_rng(15).standard_normal((40, 64)), axis=1)
    np.save(folder / "rough0.npy", rough[:, :60])
    np.save(folder / "rough1.npy", rough[:, 3:63])
    for number, (centre, stroke) in enumerate(SIX[1::2]):
        time_s, drive_v, nm = record(ForeignPlant(ManyPlays()), centre, stroke, seed=number)
        write_csv(folder / f"o{2 * number + 1}.csv", time_s=time_s, drive_v=drive_v, displacement_nm=nm)
    save_pair(old_frame("paper", pixels=96, lines=96), folder)
    step = play(load(folder / "scan.toml"), "x", scanner().x)
    write_csv(folder / "trace.csv", **sensed(step.line, scanner().x, 0, samples=1000, periods=6.3))


def write_csv(path: Path, **columns: Any) -> Path:
    """Columns of numbers as a file; its path."""
    rows = zip(*([repr(float(v)) for v in values] for values in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *map(",".join, rows)]) + "\n", "utf-8")
    return path
