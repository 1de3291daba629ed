"""Images of scans at an angle put straight by their scan file: the frame that was played, on the scanner known now."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from editing import SCANNER, run
from msgspec import structs
from operator_files import REVERSIBLE, THRESHOLDS, operator_file
from scipy.ndimage import map_coordinates
from turned_scans import write_turned

import tablegen
from tablegen.compensation.operator.file import operator_text
from tablegen.compensation.operator.frame_layer import FrameLayer
from tablegen.config.load import load
from tablegen.config.scanner import Coupling
from tablegen.correction.by_scanner import by_scan_file
from tablegen.correction.correction_text import correct_text
from tablegen.correction.old_scan import OldScan
from tablegen.correction.scan_images import Choice, read_scan
from tablegen.numerics.arrays import Floats
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan
from tablegen.virtual.imaging import Conditions, FrameImages, hexagonal, turned_frame
from tablegen.waveform.series import FourierSeries

SHORT = ("timing.lines = 44", "timing.pixels = 64", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")
WEIGHTS = 9.0, 4.0, 2.0  # of the piezo, others than those by which the scan was planned
COUPLING = Coupling(x_per_y=0.04, y_per_x=0.01)
_SAMPLES = 256  # of a line, at which plays are stepped


class Stepped:
    """The plays of the piezo by their definition, stepped twice through a frame of 0..100 V."""

    def __init__(self, lines: int) -> None:
        self.count = _SAMPLES * lines

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        """Positions in nm, shape of ``volts``."""
        at, whole = (np.arange(self.count) + 0.5) / self.count, (np.arange(len(volts)) + 0.5) / len(volts)
        u = np.interp(at, whole, volts, period=1.0) / 100.0
        transforms = np.stack([u, u * u, 1.0 - (1.0 - u) ** 2])
        state, out = np.zeros((3, len(THRESHOLDS))), np.empty(self.count)
        for _ in range(2):
            for k in range(self.count):
                g = transforms[:, k, None]
                state = np.minimum(np.maximum(state, g - THRESHOLDS), g + THRESHOLDS)
                out[k] = float(np.array(WEIGHTS) @ np.sum(state, axis=1))
        out += REVERSIBLE[0] * u + REVERSIBLE[1] * u * u
        return np.interp(whole, at, out, period=1.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scan at 30 degrees, and beside its scanner one that knows the piezo and its coupling: ``later.toml``."""
    scan = write_turned(tmp_path_factory.mktemp("turned"), 30.0, *SHORT)
    text = (scan.parent / "scanner.toml").read_text("utf-8")
    for axis in "xy":
        known = operator_text(operator_file(axis, weights=WEIGHTS), []).encode("utf-8")
        (scan.parent / f"later_{axis}.toml").write_bytes(known)
        text = text.replace(f"operator_{axis}.toml", f"later_{axis}.toml")
    coupling = f"\n[coupling]\nx_per_y = {COUPLING.x_per_y}\ny_per_x = {COUPLING.y_per_x}\n"
    (scan.parent / "later.toml").write_text(text + coupling, "utf-8")
    return scan.parent


@pytest.fixture(scope="module")
def plan(folder: Path) -> Iterator[TurnedPlan]:
    """The plan of the scan, which is not learnt again for each correction."""
    learnt = make_turned_plan(load(folder / "scan.toml"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tablegen.correction.turned_scan.make_turned_plan", lambda _: learnt)
        yield learnt


@pytest.fixture(scope="module")
def frame(folder: Path, plan: TurnedPlan) -> FrameImages:
    """What the piezo images, as files too."""
    piezo = Stepped(plan.schedule.lines)
    taken = turned_frame(plan, piezo, piezo, hexagonal(70.0), Conditions(noise=0.0), coupling=COUPLING)
    for name, image in (("trace", taken.trace), ("retrace", taken.retrace)):
        np.save(folder / f"{name}.npy", image.heights)
    return taken


def off_nm(plan: TurnedPlan, frame: FrameImages, folder: Path, scanner: str | None) -> tuple[float, float]:
    """How far pixels of the straight picture are from where they should be, rms; the scan's own size counts.

    Along and across, without the mean.
    """
    images = read_scan(folder / "trace.npy", folder / "retrace.npy", Choice())
    path = None if scanner is None else folder / scanner
    straight = by_scan_file(images, folder / "scan.toml", path, OldScan())
    row, column, inside = straight.distortion.sources(True)
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    x, y = frame.trace.x_nm, frame.trace.y_nm
    true = (map_coordinates(one, [row, column], order=1) for one in (c * x + s * y, c * y - s * x))
    grid = np.meshgrid(*straight.distortion.grid)
    errors = [(one - other)[inside] for one, other in zip(true, grid, strict=True)]
    return float(np.std(errors[0])), float(np.std(errors[1]))


@pytest.mark.common
def test_a_frame_is_put_straight_by_what_is_known_later(folder: Path, plan: TurnedPlan, frame: FrameImages) -> None:
    """Sizes, shear by the coupling, and both loops along and across: from 3.7 and 7.9 nm of 240 nm to .006 and .008."""
    before, after = off_nm(plan, frame, folder, None), off_nm(plan, frame, folder, "later.toml")
    assert min(before) > 3.0
    assert max(after) < 0.05


@pytest.mark.common
def test_the_command_knows_the_angle_of_the_scan(folder: Path, frame: FrameImages) -> None:
    images = (folder / "trace.npy", folder / "retrace.npy")
    outcome = run("correct", *images, "--scan", folder / "scan.toml", "--scanner", folder / "later.toml", "--json")
    assert outcome.status == 0, outcome.err
    record = json.loads(outcome.out)
    record = record[0] if isinstance(record, list) else record
    assert record["scan"]["angle_deg"] == 30.0
    assert record["x"]["files"][0]["file"] == "later_x.toml"
    assert record["trace_retrace"]["difference"]["after"] < 0.3 * record["trace_retrace"]["difference"]["before"]


@pytest.mark.common
def test_an_image_that_states_another_angle_is_remarked(folder: Path, frame: FrameImages) -> None:
    """Instruments count angles either way."""
    made = tablegen.correct(folder / "trace.npy", scan=folder / "scan.toml", scanner=folder / "later.toml")
    for stated, remarked in ((30.0, False), (-30.4, False), (330.0, False), (40.0, True)):
        scan = replace(made.scan, record={**made.record, "scan_angle_deg": stated})
        text = "\n".join(correct_text(scan, made.images))
        assert ("the scan file has 30 degrees" in text) == remarked
        assert "took [x] of the scanner file" not in text


@pytest.mark.common
def test_a_part_of_a_frame_and_a_scanner_without_operators_are_refused(folder: Path, frame: FrameImages) -> None:
    part = folder / "part.npy"
    np.save(part, frame.trace.heights[:-3])
    with pytest.raises(tablegen.Unphysical, match=r"rows, and scan\.toml images \d+ lines a frame"):
        tablegen.correct(part, scan=folder / "scan.toml")
    (folder / "laws.toml").write_text(SCANNER, "utf-8")
    with pytest.raises(tablegen.Rejected, match=r"x\.hysteresis: is no operator"):
        tablegen.correct(folder / "trace.npy", scan=folder / "scan.toml", scanner=folder / "laws.toml")


@pytest.mark.common
def test_what_was_learnt_beside_another_operator_is_left_out(
    folder: Path, plan: TurnedPlan, frame: FrameImages, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A layer of 5 nm changes a correction by the scan's own scanner file, and none by a file with other operators."""
    wave = FourierSeries(0.0, np.array([5.0]), np.array([0.0]))
    motion = replace(plan.x.motion, layer=FrameLayer(wave, wave))
    learnt = structs.replace(plan, x=structs.replace(plan.x, motion=motion))
    for scanner, is_same in (("scanner.toml", False), ("later.toml", True)):
        straight = []
        for one in (plan, learnt):
            monkeypatch.setattr("tablegen.correction.turned_scan.make_turned_plan", lambda _, one=one: one)
            made = tablegen.correct(folder / "trace.npy", scan=folder / "scan.toml", scanner=folder / scanner)
            straight.append(made.trace)
        assert np.array_equal(*straight, equal_nan=True) == is_same
