"""Remedies of hardware that stands in the scanner file: the axis and the file are named, and what is named holds."""

import re
from typing import Any

import pytest
from building import REMOVED, changed
from editing import EXAMPLES

from tablegen.certificate.certificate import broken_limits, certify, scaling_errors
from tablegen.certificate.excess import excess
from tablegen.certificate.scan_warnings import scan_warnings
from tablegen.config.load import Setup, from_values
from tablegen.planning.line_plan import make_plan

SCAN = {
    "dac": REMOVED,
    "amplifier": REMOVED,
    "limits": REMOVED,
    "timing.lines": 20,
    "y.band_limit.harmonics": 16,
    "y.band_limit.window": [0.2, 0.8],
    "x.size_nm": 20.0,
    "y.size_nm": 20.0,
    "y.offset_v": 30.0,
}
SCANNER = {
    "dac": {"bits": 16, "v_min": -5.0, "v_max": 5.0, "update_rate_hz": 500e3},
    "x.amplifier": {"gain": 15.0, "bias_v": 60.0},
    "y.amplifier": {"gain": -20.0, "bias_v": 45.0},
}


def setup_of(**scanner: Any) -> Setup:
    values = {**SCANNER, **scanner}
    return from_values(changed(EXAMPLES / "annexin_200nm.toml", SCAN), changed(EXAMPLES / "scanner.toml", values))


@pytest.mark.parametrize(("axis", "sign"), [("x", 1.0), ("y", -1.0)])
def test_the_amplifier_of_the_axis_is_named_with_its_file_and_holds(axis: str, sign: float) -> None:
    setup = setup_of()
    plan = make_plan(setup)
    (said,) = [str(one) for one in scan_warnings(setup, plan, certify(plan)) if f"the {axis} axis" in str(one)]
    number = r"(-?[\d.e+-]+)"
    found = re.search(
        rf"{axis}\.amplifier\.gain = {number} in scanner with {axis}\.amplifier\.bias_v = {number} in scanner leaves "
        rf"{number} %; or dac\.bits = (\d+) in scanner leaves {number} %",
        said,
    )
    assert found is not None, said
    gain, bias_v, left, bits, with_bits = map(float, found.groups())
    assert gain * sign > 0.0
    for scanner, percent in (
        ({f"{axis}.amplifier": {"gain": gain, "bias_v": bias_v}}, left),
        ({"dac": {**SCANNER["dac"], "bits": int(bits)}}, with_bits),
    ):
        again = make_plan(setup_of(**scanner))
        line, other = (again.x, again.y) if axis == "x" else (again.y, again.x)
        scaling = scaling_errors(line)
        assert excess(scaling) is None
        worst = max(max(part.total, part.band_limit, abs(part.size)) for part in scaling.values())
        assert worst == pytest.approx(percent, rel=0.005)
        if "dac" not in scanner:
            before = plan.y if axis == "x" else plan.x
            assert other.program.output == before.program.output, "the other axis keeps its amplifier"


def test_a_step_above_the_guard_stands_at_the_amplifier_of_its_axis() -> None:
    """A guard that a plan cannot have: the message is at the key that limits it, in the scanner file."""
    from replacing import replace

    setup = setup_of(**{"y.amplifier": {"gain": -20.0, "bias_v": 45.0, "max_slew_v_per_s": 1e6}})
    plan = make_plan(setup)
    certificates = certify(plan)
    tight = {"y": replace(certificates["y"], max_step=certificates["y"].largest_step - 1)}
    (problem,) = broken_limits(plan, tight, setup.scan_file, hardware_problem=setup.hardware_problem)
    assert (problem.file, problem.key) == ("scanner", "y.amplifier.max_slew_v_per_s")
