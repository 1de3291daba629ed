"""Errors of the position behind a response: against a simulation in time, and as `tablegen verify` finds them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, run

from tablegen.certificate.certificate import certify
from tablegen.certificate.expectation_checks import expectation_warnings
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.certificate.position_errors import arriving
from tablegen.compensation.dynamics import SecondOrder
from tablegen.config.load import load
from tablegen.planning.line_plan import LinePlan, Plan, make_plan

FINE = 64  # points of a tick in the simulation
RESONANCE = "x.resonance"
MEASURED = "hz,gain,phase_deg\n1000,1,-0.7\n20000,1.3,-15\n38000,6,-80\n42000,7,-120\n60000,0.8,-170\n90000,0.2,-200\n"


def planned(folder: Path, scanner: tuple[str, ...] = (), scan: tuple[str, ...] = ()) -> Plan:
    return make_plan(load(written(folder, scanner, scan)))


def written(folder: Path, scanner: tuple[str, ...] = (), scan: tuple[str, ...] = ()) -> Path:
    (folder / "scanner.toml").write_text(edited(SCANNER, *scanner), "utf-8")
    (folder / "response.csv").write_text(MEASURED, "utf-8")
    (folder / "scan.toml").write_text(edited(SCAN, "timing.lines = 20", *scan), "utf-8")
    return folder / "scan.toml"


def simulated(line: LinePlan, response: SecondOrder) -> np.ndarray:
    """The position less the target in the middle of ticks, in LSB: small steps in time, until nothing changes."""
    ticks = line.program.ticks
    w = (line.program.codes(np.arange(ticks)) - line.float_codes(np.zeros(1))[0]) / line.codes_per_unit
    step = 1.0 / (float(line.rate) * ticks * FINE)
    omega = 2.0 * np.pi * response.frequency_hz * step
    late = round(response.delay_s / step)
    assert late == pytest.approx(response.delay_s / step, abs=1e-6)
    drive = np.roll(np.repeat(w, FINE), late).tolist()
    position = speed = 0.0
    for _ in range(3):  # periods: it rings for 100 ticks
        middles = []
        for i, value in enumerate(drive):
            if i % FINE == FINE // 2:
                middles.append(position)
            # Velocity Verlet's with damping in halves: second order in the step.
            half = speed + 0.5 * omega * (value - position - speed / response.quality)
            position += omega * half
            speed = (half + 0.5 * omega * (value - position)) / (1.0 + 0.5 * omega / response.quality)
    target = line.target.value((np.arange(ticks) + 0.5) / ticks)
    return np.asarray((np.array(middles) - target) * line.codes_per_unit)


@pytest.mark.parametrize("delay_s", [0.0, 1.5625e-6])
def test_the_position_is_that_of_a_simulation_in_time(tmp_path: Path, delay_s: float) -> None:
    line = planned(tmp_path, (f"{RESONANCE}.delay_s = {delay_s}",)).x
    assert isinstance(line.drive.response, SecondOrder)
    found, right = arriving(line, EmittedPeriod(line)), simulated(line, line.drive.response)
    assert float(np.max(np.abs(found - right))) < 0.02 * float(np.max(np.abs(right)))
    assert float(np.max(np.abs(right))) > 2.0, "the codes alone err by less than one"


@pytest.mark.parametrize(
    ("scanner", "scan"),
    [
        (("- [x.resonance]",), ()),
        ((), ("dac.shaping = 'first'",)),
    ],
    ids=["no response", "shaped"],
)
def test_what_is_not_judged_has_no_figure(tmp_path: Path, scanner: tuple[str, ...], scan: tuple[str, ...]) -> None:
    certificates = certify(planned(tmp_path, scanner, (*scan, "- [limits]")))
    assert certificates["x"].position is None
    assert certificates["y"].position is None


def test_a_resonance_that_is_driven_is_a_warning_with_remedies(tmp_path: Path) -> None:
    line_of_60_nm = ("x.size_nm = 60.0", "- [limits]")
    plan = planned(tmp_path, (), line_of_60_nm)
    certificate = certify(plan)["x"]
    assert certificate.position is not None
    side, percent = certificate.position.worst
    assert percent > 2.0 * certificate.scaling[side].total
    (doubt,) = expectation_warnings(plan.x, certificate)
    assert (doubt.code, doubt.percent) == ("resonance", percent)
    outcome = run("check", tmp_path / "scan.toml")
    assert "scan.toml:23: x.size_nm: the steps of the x codes drive the resonance at 40000 Hz: behind it" in outcome.err
    assert 'tried: dac.shaping = "second" leaves 1.' in outcome.err
    assert "dac.bits = 18 leaves 0." in outcome.err
    assert run("check", tmp_path / "scan.toml", "--strict").status == 3
    # Where the codes are coarse too, one warning says both.
    small = written(tmp_path, (), ("x.size_nm = 20.0", "- [limits]"))
    (warning,) = [row for row in run("check", small).err.splitlines() if ": x.size_nm: " in row]
    assert "the cause is quantisation" in warning
    assert "; with the resonance that steps drive it is " in warning
    assert ' % forward (dac.shaping = "' in warning


def built(folder: Path, scanner: tuple[str, ...] = ()) -> Path:
    out = folder / "out"
    assert run("build", written(folder, scanner), "-o", out, "-q").status == 0
    return out / "manifest.json"


POSITION: dict[str, Callable[[dict[str, Any]], object]] = {
    "a scaling error": lambda c: c["position"]["scaling_error_percent"].update(backward=0.3),
    "a direction less": lambda c: c["position"]["scaling_error_percent"].pop("backward"),
    "the largest error": lambda c: c["position"].update(max_error_lsb=c["position"]["max_error_lsb"] * 1.0001),
    "the rms error": lambda c: c["position"].update(rms_error_lsb=0.1),
    "another quality": lambda c: c["position"]["passage"].update(quality=2.0),
    "a delay": lambda c: c["position"]["passage"].update(delay_s=1e-6),
    "a band": lambda c: c["position"].update(passage={"band_hz": 12800.0}),
    "none": lambda c: c.pop("position"),
    "a mismatch by the laws": lambda c: c["expected"]["mismatch_percent"].update(value=0.2),
    "its last digit": lambda c: c["expected"]["mismatch_percent"].update(
        value=c["expected"]["mismatch_percent"]["value"] * 1.0001
    ),
    "the stroke that it is of": lambda c: c["expected"]["stroke"].update(size=0.5),
    "its branches": lambda c: c["expected"]["stroke"]["forward"].update(beta=0.5),
    "no stroke": lambda c: c["expected"].pop("stroke"),
}


@pytest.mark.common
def test_verify_finds_the_same_position_and_mismatch_and_every_other(tmp_path: Path) -> None:
    manifest = built(tmp_path)
    assert run("verify", manifest.parent, "--target", "files").status == 0
    plain = manifest.read_text("ascii")
    missed = []
    for what, change in POSITION.items():
        content = json.loads(plain)
        change(content["axes"]["x"]["certificate"])
        manifest.write_text(json.dumps(content, indent=2), "ascii")
        outcome = run("verify", manifest.parent, "--target", "files")
        if outcome.status != 5 or "axes.x.certificate." not in outcome.out + outcome.err:
            missed.append(what)
    assert missed == []


@pytest.mark.common
@pytest.mark.parametrize(
    "resonance",
    [
        "response = 'response.csv'",
        "frequency_hz = 40e3\nquality = 0.5",
        "frequency_hz = 90e3\nquality = 30\ndelay_s = 3.3e-6",
    ],
    ids=["measured", "damped", "late"],
)
def test_verify_agrees_for_other_responses(tmp_path: Path, resonance: str) -> None:
    manifest = built(tmp_path, ("- [x.resonance]", f"+ [x.resonance]\n{resonance}\n"))
    position = json.loads(manifest.read_text("ascii"))["axes"]["x"]["certificate"]["position"]
    assert position["max_error_lsb"] > 0.1
    outcome = run("verify", manifest.parent, "--target", "files")
    assert outcome.status == 0, outcome.out
