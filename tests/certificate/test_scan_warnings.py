"""Warnings of a scan that is worse than it should be: when, of what, and that the remedies hold what they promise."""

import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from replacing import replace
from variants import setup_of

from tablegen.certificate import remedies
from tablegen.certificate.certificate import certify, scaling_errors
from tablegen.certificate.excess import excess
from tablegen.certificate.line_errors import ScalingError
from tablegen.certificate.remedies import changed
from tablegen.certificate.scan_warnings import brief_warnings, scan_warnings
from tablegen.config.load import Setup
from tablegen.planning.line_plan import make_plan

FREE = {"limits.max_error_lsb": "", "limits.max_scaling_error_percent": ""}
SMALL = {"x.size_nm": "20.0", "y.size_nm": "20.0"}
COARSE = {"dac.v_min": "-10.0", "dac.v_max": "10.0", "amplifier.gain": "20.0", "amplifier.bias_v": "0.0"}

# Edits of the scan and of the scanner, the axis, where the warning stands, the cause, and the key of the remedy.
CASES: dict[str, tuple[dict[str, str], dict[str, str], str, str, str, str]] = {
    "small": (SMALL, {}, "x", "x.size_nm", "quantisation", "amplifier.gain"),
    "small on a coarse converter": (
        {**SMALL, **COARSE},
        {},
        "y",
        "y.size_nm",
        "quantisation",
        "amplifier.gain",
    ),
    "small, inverted": ({**SMALL, "amplifier.gain": "-10.0"}, {}, "x", "x.size_nm", "quantisation", "amplifier.gain"),
    "coarse words": ({"x.table.bits": "8"}, {}, "x", "x.size_nm", "quantisation", "x.table.bits"),
    "few words": (
        {"x.table.length": "32", "x.band_limit.harmonics": "15"},
        {},
        "x",
        "x.size_nm",
        "quantisation",
        "x.table.length",
    ),
    "few harmonics": (
        {"x.band_limit.harmonics": "2"},
        {},
        "x",
        "x.band_limit.harmonics",
        "the band limit",
        "x.band_limit.harmonics",
    ),
    "a large error allowed": (
        {"x.band_limit.max_scaling_error_percent": "2.5"},
        {},
        "x",
        "x.band_limit.max_scaling_error_percent",
        "the band limit",
        "x.band_limit.max_scaling_error_percent",
    ),
    "low cutoff": (
        {"y.band_limit.harmonics": "", "y.band_limit.cutoff_hz": "10.0"},
        {},
        "y",
        "y.band_limit.cutoff_hz",
        "the band limit",
        "y.band_limit.cutoff_hz",
    ),
    "ringing": (
        {"x.band_limit.method": '"truncate"'},
        {},
        "x",
        "x.band_limit.method",
        "the band limit",
        "x.band_limit.method",
    ),
    "sharp turns": (
        {"x.band_limit.window": "[0.0, 1.0]"},
        {},
        "x",
        "x.band_limit.harmonics",
        "the band limit",
        "x.band_limit.window",
    ),
    "slow scanner": (
        {},
        {"x.resonance.frequency_hz": "2000.0", "x.resonance.max_boost_db": "3.0"},
        "x",
        "x.band_limit.harmonics",
        "the model",
        "timing.line_rate_hz",
    ),
}


def warned(setup: Setup) -> list[str]:
    plan = make_plan(setup)
    return [str(one) for one in scan_warnings(setup, plan, certify(plan))]


def test_a_good_scan_is_silent_and_nothing_is_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remedies, "make_plan", lambda _: pytest.fail("planned again"))
    assert warned(setup_of(tmp_path)) == []


@pytest.mark.parametrize("case", CASES)
def test_a_warning_has_its_place_its_cause_and_a_remedy_that_holds(tmp_path: Path, case: str) -> None:
    scan, scanner, axis, key, cause, remedy = CASES[case]
    setup = setup_of(tmp_path, {**FREE, **scan}, scanner)
    (text,) = [one for one in warned(setup) if f"the {axis} axis" in one]
    assert re.match(rf".*scan\.toml:\d+: {re.escape(key)}: the {axis} axis has a scaling error of ", text)
    assert f"the cause is {cause} (" in text
    assert "above 1 %" in text
    advice = text.split("; tried: ")[1].split("; or ")
    assert advice[0].startswith(f"{remedy} = ")
    assert len(advice) == (
        2 if remedy == "amplifier.gain" else 1
    )  # where the scan itself can help, nothing else is named
    assert ("amplifier.gain = -" in text) == ("inverted" in case)
    for one in advice:  # as a user would: each is written into the file, built, and measured
        edits, _, left = one.rpartition(" leaves ")
        change = tomllib.loads(edits.replace(" with ", "\n"))
        written = {key: _toml(value) for key, value in _flat(change)}
        again = make_plan(setup_of(tmp_path, {**FREE, **scan, **written}, scanner))
        line = again.x if axis == "x" else again.y
        scaling = scaling_errors(line)
        assert excess(scaling) is None, one
        worst = max(max(part.total, part.band_limit, abs(part.size)) for part in scaling.values())
        assert float(left.removesuffix(" %")) == pytest.approx(worst, rel=0.005), one


def test_the_small_scan_is_worse_than_none_and_says_so(tmp_path: Path) -> None:
    setup = setup_of(tmp_path, {**FREE, **SMALL})
    plan = make_plan(setup)
    certificates = certify(plan)
    problems = scan_warnings(setup, plan, certificates)
    assert sorted((one.code, one.axis) for one in problems) == [("scaling-error", "x"), ("scaling-error", "y")]
    by_axis = sorted(map(str, problems), key=lambda text: "the y axis" in text)  # the worse one comes first
    for text, certificate in zip(by_axis, certificates.values(), strict=True):
        span = certificate.highest_code - certificate.lowest_code + 1
        assert re.search(r"above 1 % and above the [12](\.\d+)? % of the uncompensated line; ", text)
        assert f"the scan spans {span} of the converter's 65536 codes; tried: amplifier.gain = 3" in text
        assert "; or dac.bits = 18 leaves 0." in text


def test_two_causes_at_once_name_the_best_that_was_tried(tmp_path: Path) -> None:
    edits = {"dac.bits": "8", "x.band_limit.harmonics": "2"}
    text = warned(setup_of(tmp_path, {**FREE, **edits}))[0]
    found = re.search(r"no remedy that was tried is enough; the best: (\S+) = (\d+) leaves (\S+) %$", text)
    assert found
    assert found[1] == "x.band_limit.harmonics"
    line = make_plan(setup_of(tmp_path, {**FREE, **edits, found[1]: found[2]})).x
    assert float(found[3]) > 1.0
    assert float(found[3]) == pytest.approx(max(part.total for part in scaling_errors(line).values()), rel=0.005)


def test_what_nothing_helps_ends_after_few_trials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No harmonics are left to take, and no window is narrow enough: a turn in the middle of the image."""
    trials = []
    monkeypatch.setattr(remedies, "make_plan", lambda setup, **how: trials.append(setup) or make_plan(setup, **how))
    edits = {"x.band_limit.harmonics": "1", "x.table.length": "4", "y.table.length": "4", "y.band_limit.harmonics": "1"}
    setup = setup_of(tmp_path, {**FREE, **edits})
    texts = warned(setup)
    assert len(texts) == 2
    assert all("no remedy that was tried" in text for text in texts)
    assert len(trials) <= 40


@pytest.mark.parametrize(
    ("left", "said"),
    [
        (2.6, "no remedy that was tried helps"),
        (1.5, "no remedy that was tried is enough; the best: a = 1 leaves 1.5 %"),
    ],
)
def test_a_remedy_that_changes_little_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, left: float, said: str
) -> None:
    one = remedies.Remedy("a = 1", left, low=False, within_limits=True)
    monkeypatch.setattr(remedies, "excess_remedies", lambda *_: [one])
    assert all(text.endswith(said) for text in warned(setup_of(tmp_path, {**FREE, **SMALL})))


def test_a_trial_that_cannot_be_planned_is_no_remedy(tmp_path: Path) -> None:
    """The converter's word has 16 bits: no more can be advised."""
    text = warned(setup_of(tmp_path, {**FREE, **SMALL, "dac.word_bits": "16"}))[0]
    assert "tried: amplifier.gain = " in text
    assert "dac.bits = " not in text


def test_both_ways_of_keys_are_kept(tmp_path: Path) -> None:
    """Where the length of a line is given in ticks, a slower line has more of them."""
    scanner = {"x.resonance.frequency_hz": "2000.0", "x.resonance.max_boost_db": "3.0"}
    (text,) = warned(setup_of(tmp_path, {**FREE, "timing.ticks_per_line": "1250"}, scanner))
    assert re.search(r"tried: timing\.ticks_per_line = (2500|5000|10000) leaves", text)


@pytest.mark.parametrize("model", ["triangle", "sinusoidal"])
def test_without_hysteresis_there_is_no_line_to_be_worse_than(tmp_path: Path, model: str) -> None:
    none = "{ beta_max = 0.0 }"
    scanner = {"x.hysteresis.model": f'"{model}"'}
    if model == "sinusoidal":
        scanner |= {f"x.hysteresis.branches.{side}": none for side in ("forward", "backward")}
    setup = setup_of(tmp_path, FREE, scanner)
    plan = make_plan(setup)
    assert all(part.uncompensated < 1e-9 for part in certify(plan)["x"].scaling.values())
    assert warned(setup) == []
    (text,) = warned(setup_of(tmp_path, {**FREE, "x.band_limit.harmonics": "2"}, scanner))
    assert "above 1 %; the cause is the band limit" in text


PERCENT = st.floats(0.0, 50.0)


@example(total=0.0, band=0.0, rest=0.0, size=-1.1, before=2.0)
@example(total=0.0, band=0.0, rest=0.0, size=1.1, before=2.0)
@example(total=0.0, band=1.1, rest=0.0, size=0.0, before=2.0)
@example(total=1.1, band=0.0, rest=0.0, size=0.0, before=2.0)
@example(total=0.6, band=0.0, rest=0.0, size=0.0, before=0.5)
@given(total=PERCENT, band=PERCENT, rest=PERCENT, size=st.floats(-5.0, 5.0), before=st.floats(0.01, 50.0))
def test_when_a_scan_is_warned_of(total: float, band: float, rest: float, size: float, before: float) -> None:
    parts = ScalingError(total, band, rest, 0.0, size, before)
    found = excess({"forward": parts, "backward": ScalingError(0.0, 0.0, 0.0, 0.0, 0.0, 50.0)})
    worse = max(total, band) > 1.0 or max(total, band) > before
    assert (found is not None) == (worse or abs(size) > 1.0)
    if found is not None:
        assert found.side == "forward"
        assert found.times > 1.0
        assert found.cause == ("band limit" if band > rest else "quantisation")
        text = found.text("x")
        assert ("of the uncompensated line" in text) == (found.what == "scaling error" and max(total, band) > before)


def test_the_worst_of_all_errors_is_told() -> None:
    """Of both directions, and of scaling and size, by how far each is above what it may be."""
    parts = {
        "forward": ScalingError(2.0, 0.0, 2.0, 0.0, -1.5, 5.0),
        "backward": ScalingError(3.0, 0.0, 3.0, 0.0, 2.5, 5.0),
    }
    found = excess(parts)
    assert found is not None
    assert (found.side, found.what, found.times) == ("backward", "scaling error", 3.0)
    parts["forward"] = replace(parts["forward"], size=-3.5)
    found = excess(parts)
    assert found is not None
    assert (found.side, found.what, found.percent) == ("forward", "size error", -3.5)
    found = excess(parts, most=4.0)
    assert found is None
    parts["backward"] = replace(parts["backward"], uncompensated=0.1)
    found = excess(parts)
    assert found is not None
    assert (found.side, found.times) == ("backward", 30.0)


def test_brief_warnings_are_the_same_without_remedies(tmp_path: Path) -> None:
    setup = setup_of(tmp_path, {**FREE, **SMALL})
    plan = make_plan(setup)
    brief, full = brief_warnings(plan, certify(plan)), warned(setup)
    assert len(brief) == 2
    assert all(one in other for one, other in zip(brief, full, strict=True))
    assert not any("tried" in one for one in brief)


def test_a_change_leaves_the_setup_as_it_was(tmp_path: Path) -> None:
    setup = setup_of(tmp_path)
    other = changed(setup, {"x.band_limit.harmonics": 5, "dac.bits": 18})
    assert (other.scan.x.band_limit.harmonics, other.scan.dac.bits) == (5, 18)
    assert (setup.scan.x.band_limit.harmonics, setup.scan.dac.bits) == (32, 16)
    assert replace(other, scan=setup.scan) == setup


def _flat(tree: dict[str, object], before: str = "") -> list[tuple[str, object]]:
    found: list[tuple[str, object]] = []
    for key, value in tree.items():
        found += _flat(value, f"{before}{key}.") if isinstance(value, dict) else [(before + key, value)]
    return found


def _toml(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)
