"""What a simulation on the own operator says, against the foreign piezos of which that operator was identified."""

from pathlib import Path

import numpy as np
import pytest
from foreign_plants import BoucWen, ForeignPlant, ManyPlays, triangle
from operator_scans import Played, fitted, foreign_traces, scan_on
from sets import long

from tablegen.planning.line_plan import make_plan
from tablegen.virtual.own_run import image_errors, simulate_own
from tablegen.virtual.simulation import run_line


def offset_law(plant: ForeignPlant) -> tuple[str, str]:
    """m of (1) at both ends, from triangles of 10 V at nine offsets; the middle of a large stroke is off the offset."""
    centres = np.linspace(0.1, 0.9, 9)
    sizes = [float(np.ptp(plant.settled(triangle(400, centre, 0.1), 100.0))) for centre in centres]
    bent = np.polyfit(2.0 * centres - 1.0, 1.0 / np.array(sizes), 2)
    low, middle, high = (float(np.polyval(bent, p)) for p in (-1.0, 0.0, 1.0))
    return f"x.offset.m_minus = {low / middle:.6f}", f"x.offset.m_plus = {high / middle:.6f}"


@pytest.mark.rest
@pytest.mark.parametrize("kind", long([BoucWen], [ManyPlays, BoucWen]))
def test_a_piezo_is_no_worse_than_the_worst_of_the_table(tmp_path: Path, kind: type) -> None:
    """At the measured offset; docs/virtual.md has these numbers."""
    plant = ForeignPlant(kind())
    fit = fitted(foreign_traces(plant))
    law = offset_law(plant)
    for size_nm in (100.0, 200.0, 400.0, 800.0):
        setup = scan_on(tmp_path, fit, size_nm, 50.0, *law)
        (run,) = simulate_own(setup, 0)
        table = run.rows[2].summary()
        real = image_errors(run_line(make_plan(setup).x, Played(plant)))
        (_, rms), (_, scaling), (_, mismatch), (_, size) = table.values()
        assert real[0] < rms
        assert real[2] < mismatch
        # Of eight scans one scaling error is above the worst, which docs/virtual.md says.
        assert real[1] < 1.25 * scaling
        assert abs(real[3]) < abs(size)
        # Nor does it frighten: of the largest scans less than ten times as much.
        if size_nm > 500.0:
            assert rms < 10.0 * real[0]
    # Where no trace was measured more is left, and the output says that it is not known.
    setup = scan_on(tmp_path, fit, 100.0, 85.0)
    (run,) = simulate_own(setup, 0)
    assert run.distance == pytest.approx(0.35, abs=1e-3)
    real = image_errors(run_line(make_plan(setup).x, Played(plant)))
    assert abs(real[3]) > 10.0 * abs(run.rows[2].summary()["size"][1])
