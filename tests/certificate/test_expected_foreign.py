"""What the certificate expects, and how sure it is, against piezos that the project does not contain: kept aside."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, write_pair
from foreign_plants import SIX, TEN, BoucWen, ForeignPlant, ManyPlays, record, triangle

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.calibration.operator.fit import fit_operator
from tablegen.calibration.operator.periodic_line import periodic_line
from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.own_run import image_errors
from tablegen.virtual.simulation import run_line

SAMPLES = 2000  # of a period, on which the piezos are integrated
SCANS = tuple((offset, share) for offset in (0.5, 0.6, 0.7, 0.85) for share in (0.2, 0.5, 0.85))
PLANTS = {  # not of benchmarks/expected_coverage.py; one level was raised after scaling errors of these missed
    "plays": ForeignPlant(ManyPlays(seed=11), creep=0.024),
    "Bouc-Wen": ForeignPlant(BoucWen(a=0.3, beta=5.0, gamma=-1.5, n=1.2, depth=0.5, asymmetry=0.2, bend=0.2), 0.022),
}


class Played:
    """A foreign piezo as an axis on which emitted integers are played."""

    def __init__(self, plant: ForeignPlant) -> None:
        self._plant = plant

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        ticks = (np.arange(len(volts)) + 0.5) / len(volts)
        at = (np.arange(SAMPLES) + 0.5) / SAMPLES
        moved = self._plant.settled(np.interp(at, ticks, volts, period=1.0), 1.0 / (len(volts) * tick_s))
        return np.interp(ticks, at, moved, period=1.0)


def small(plant: ForeignPlant, centre: float) -> float:
    return float(np.ptp(plant.settled(triangle(400, centre, 0.1), 100.0)))


def judged(plant: ForeignPlant, protocol: Sequence[tuple[float, float]], folder: Path) -> tuple[Floats, Floats, Floats]:
    """What each scan leaves, the most that its certificate expects, and what traces are missed by; percent."""
    folder.mkdir()
    centres = np.linspace(0.1, 0.9, 9)
    bent = np.polyfit(2.0 * centres - 1.0, [small(plant, 0.5) / small(plant, centre) for centre in centres], 2)
    low, middle, high = (float(np.polyval(bent, p)) for p in (-1.0, 0.0, 1.0))
    traces = [Trace(f"{s:g}", *record(plant, c, s, seed=seed)) for seed, (c, s) in enumerate(protocol)]
    lines = [periodic_line(trace, 100.0) for trace in traces]
    fit = fit_operator(lines, None, lambda centre: float(np.polyval(bent, 2.0 * centre - 1.0)) / middle)
    (folder / "operator.toml").write_bytes(operator_file(fit, "x", 100.0))
    scanner = edited(
        SCANNER,
        "x.hysteresis.model = 'operator'",
        "x.hysteresis.file = 'operator.toml'",
        f"x.offset.m_minus = {low / middle:.6f}",
        f"x.offset.m_plus = {high / middle:.6f}",
        "- [x.resonance]",
    )
    left, most, plain = [], [], np.median(np.abs([line.left_out for line in fit.operator.lines]), axis=0)
    for offset, share in SCANS:
        size_nm = share * 2.0 * min(offset, 1.0 - offset) * 10.0 * small(plant, offset)
        scan = edited(SCAN, f"x.size_nm = {size_nm:.6g}", f"x.offset_v = {100.0 * offset}", "timing.lines = 20")
        path = write_pair(folder, edited(scan, "timing.line_rate_hz = 100", "- [limits]"), scanner)
        plan = make_plan(load(path))
        expected = certify(plan)["x"].expected
        assert expected is not None
        sides = expected.rms, expected.scaling, {"": expected.mismatch}, {"": expected.size}
        figures = [[one for one in side.values() if one is not None] for side in sides]
        most.append([max(abs(one.value) + (one.uncertainty or 0.0) for one in found) for found in figures])
        left.append(np.abs(image_errors(run_line(plan.x, Played(plant)))).tolist())
    return np.array(left), np.array(most), np.tile(plain, (len(left), 1))


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_nine_of_ten_scans_leave_less_than_what_is_expected_and_its_uncertainty(tmp_path: Path) -> None:
    """From traces of the default procedure, at three offsets."""
    parts = [judged(plant, TEN, tmp_path / kind) for kind, plant in PLANTS.items()]
    left, most, _ = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    within = np.mean(left <= most, axis=0)
    assert np.all(within >= 0.9), within
    # It says something: of most scans less than three times as much as is left; sizes may be right by chance.
    assert np.all(np.median(most[:, :3] / left[:, :3], axis=0) < 3.0)


@pytest.mark.rest
def test_it_holds_at_offsets_that_no_trace_showed(tmp_path: Path) -> None:
    """It cannot be as tight there: that the loop of plays does not change with the offset is not seen at one offset."""
    left, most, plain = judged(PLANTS["plays"], SIX, tmp_path / "plays")
    within = np.mean(left <= most, axis=0)
    assert np.all(within >= 0.9), within
    # What the traces are missed by, wherever the scan is, does not hold that often.
    assert np.min(np.mean(left <= plain, axis=0)) < 0.7
