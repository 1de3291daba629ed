"""A sine on piezos that the project does not contain: what the image of its emitted integers leaves."""

from functools import cache
from pathlib import Path

import pytest
from foreign_plants import TEN, V_MAX, BoucWen, ForeignPlant, ManyPlays, record
from operator_scans import fitted
from replacing import replace
from sets import long
from sine_scans import image_errors, measured_response, pixels_on_the_piezo, predicted_errors, response_csv, sine_scan

from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.file_of_fit import operator_file
from tablegen.compensation.line import SineLine
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.pixel_table import with_pixel_table
from tablegen.waveform.series import FourierSeries

pytestmark = pytest.mark.rest
WINDOW = (0.1, 0.9)
PLANTS = {"plays": ForeignPlant(ManyPlays(1)), "bouc-wen": ForeignPlant(BoucWen())}


@cache
def operator_of(name: str, before: bool = True) -> bytes:
    """From ten traces; behind the response of the scanner file, but not if it was measured later."""
    plant = PLANTS[name]
    traces = [Trace(f"{k}", *record(plant, at, stroke, seed=k)) for k, (at, stroke) in enumerate(TEN)]
    response = measured_response(response_csv(plant, 150e3)) if before else None
    return operator_file(fitted(traces, response), "x", V_MAX)


def sine_of(folder: Path, name: str, rate_hz: float, points: int = 600, before: bool = True) -> Plan:
    setup = sine_scan(
        folder, operator_of(name, before), response_csv(PLANTS[name], 150e3, points),
        f"timing.line_rate_hz = {rate_hz}", "dac.update_rate_hz = 20e6", "timing.pixels = 64",
        "- x.band_limit.harmonics", "x.motion = 'sine'",
    )  # fmt: skip
    return make_plan(setup, sines=True)


@pytest.mark.parametrize("name", long(["bouc-wen"], PLANTS))
def test_a_sine_of_10_khz_images_straight(name: str, tmp_path: Path) -> None:
    plan = sine_of(tmp_path, name, 10e3)
    played = pixels_on_the_piezo(plan, PLANTS[name])
    errors = image_errors(*played, WINDOW)
    assert errors["rms"] < 0.05
    assert errors["mismatch"] < 0.15
    assert predicted_errors(plan, *played)["scaling"] < min(errors["scaling"], 2.0)


@pytest.mark.parametrize("name", long(["bouc-wen"], PLANTS))
def test_200_points_of_a_response_serve_a_sine_of_20_khz(name: str, tmp_path: Path) -> None:
    """Its third harmonic is on a resonance that is 13 times as high as the rest; lines between points leave 0.2 %."""
    plan = sine_of(tmp_path, name, 20e3, points=200)
    assert image_errors(*pixels_on_the_piezo(plan, PLANTS[name]), WINDOW)["rms"] < 0.08


def test_an_operator_from_before_the_response_counts_the_dead_time_twice(tmp_path: Path) -> None:
    plant = PLANTS["bouc-wen"]
    errors = []
    for before in (True, False):
        (folder := tmp_path / str(before)).mkdir()
        plan = sine_of(folder, "bouc-wen", 10e3, before=before)
        errors.append(image_errors(*pixels_on_the_piezo(plan, plant), WINDOW)["rms"])
    assert errors[1] > 2.0 * errors[0]


def test_without_the_harmonics_of_the_loop_the_image_is_bent(tmp_path: Path) -> None:
    """The trap: pixels by the first harmonic of the position alone, which is all that the drive has."""
    plan = sine_of(tmp_path, "plays", 10e3)
    shape = plan.x.drive.shape
    assert isinstance(shape, SineLine)
    first = FourierSeries(shape.place.a0, shape.place.a[:1].copy(), shape.place.b[:1].copy())
    bent = replace(plan, schedule=with_pixel_table(plan.schedule, first, WINDOW))
    plant = PLANTS["plays"]
    right, wrong = (image_errors(*pixels_on_the_piezo(one, plant), WINDOW)["rms"] for one in (plan, bent))
    assert wrong > 5.0 * right
