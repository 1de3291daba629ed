"""The order of notes and warnings where several come together: what spoils an image first, small print last."""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from calibrating import DRIVES, Scanner, actual
from correcting import LAWS, old_frame, save_pair
from editing import SCAN, SCANNER, edited, run, write_pair
from gwyfile.objects import GwyContainer, GwyDataField
from hypothesis import given
from hypothesis import strategies as st
from plotting_lab import write_csv
from replacing import replace

from tablegen.base.warnings import Finding, Remark, as_printed, of_remarks, worst_first
from tablegen.calibration.laws.hysteresis import Trace, fit_hysteresis

WEIGHTS = ("limit", "spoils", "expect", "note")
FINDINGS = st.lists(
    st.builds(Finding, st.sampled_from(WEIGHTS), st.floats(0.0, 200.0), st.text("ab", min_size=1, max_size=3)),
    max_size=12,
)


def in_order(findings: list[Finding]) -> bool:
    """Whether weights do not rise, and percentages do not within one."""
    return all(
        (WEIGHTS.index(one.weight), -as_printed(one.percent))
        <= (WEIGHTS.index(other.weight), -as_printed(other.percent))
        for one, other in pairwise(findings)
    )


@given(FINDINGS)
def test_the_worst_is_first_and_nothing_is_lost(findings: list[Finding]) -> None:
    found = worst_first(findings)
    assert in_order(found)
    assert sorted(map(repr, found)) == sorted(map(repr, findings))
    assert worst_first(found) == found


def test_another_order_is_found() -> None:
    """Negative control; and what reads the same stays as it was."""
    small, large = Finding("spoils", 1.0, "a"), Finding("spoils", 1.7, "b")
    assert not in_order([small, large])
    assert not in_order([Finding("note", 99.0, "c"), small])
    same = [Finding("spoils", 2.6551, "x"), Finding("spoils", 2.6599, "y")]
    assert worst_first(same[::-1]) == same[::-1]


def test_a_remark_is_a_text_with_a_weight() -> None:
    one = Remark("the model leaves 1.7 % of the scan", "spoils", 1.7)
    assert one.under("a.csv") == "a.csv: the model leaves 1.7 % of the scan"
    assert (one.under("a.csv").weight, one.under("a.csv").percent) == ("spoils", 1.7)
    assert one.under("") is one
    assert of_remarks([one]) == [Finding("spoils", 1.7, str(one))]


def ordered(text: str, *parts: str) -> None:
    """Each of these parts is in a note, in this order, and no other note is there."""
    lines = [line for line in text.splitlines() if re.match("(note|warning|outlier): ", line)]
    assert len(lines) == len(parts), lines
    for line, part in zip(lines, parts, strict=True):
        assert part in line, lines


def test_show_and_build(tmp_path: Path) -> None:
    """A scan without a model for y, whose x is small: the warnings by their size, then the notes."""
    scanner = edited(SCANNER, "- [y.hysteresis]", "- [[y.hysteresis.branches]]")
    scan = write_pair(tmp_path, edited(SCAN, "- [limits]", "x.size_nm = 20.0", "y.band_limit.harmonics = 4"), scanner)
    shown = run("show", scan, "--no-plot")
    ordered(shown.err, "the y axis has a scaling error of", "the x axis has a scaling error of 2.")
    percents = [float(one) for one in re.findall(r"scaling error of ([0-9.]+) %", shown.err)]
    assert percents == sorted(percents, reverse=True)
    ordered(
        shown.out,
        "hysteresis of y is not compensated",
        "the model leaves 0.065 % of the line",
        "the same pixel of trace and retrace shows places up to 0.08 %",
        "a pixel is 2.5 ticks",
        "a frame images 200 x 170 pixels",
    )
    built = run("build", scan, "-o", tmp_path / "out")
    assert built.err == shown.err
    assert run("check", scan).err == shown.err
    ordered(built.out, "hysteresis of y is not compensated")


def test_a_size_with_doubts_an_outlier_and_remarks(tmp_path: Path) -> None:
    """What makes it meaningless, the outlier, what is extrapolated, and what is taken as it was."""
    sizes = actual(DRIVES, 11.0, 0.6, 0.5, 200.0) * (1.0 + 0.0005 * np.random.default_rng(1).standard_normal(11))
    sizes[5] *= 1.2
    path = write_csv(tmp_path / "s.csv", drive_v=DRIVES[4:], actual_nm=sizes[4:])
    done = run("calibrate", "size", path, "--axis", "x", "--v-max", "100", "--no-plot")
    ordered(
        done.out,
        "warning: k_nm_per_v",
        "warning: beta",
        f"outlier: {path}:3: far from the other points",
        "k is extrapolated",
        "the threshold is not determined",
    )


def test_what_means_nothing_comes_before_all(tmp_path: Path) -> None:
    gain = 1.0 + 0.05 * np.random.default_rng(3).standard_normal(15)
    path = write_csv(tmp_path / "f.csv", frequency_hz=np.geomspace(1.0, 3000.0, 15), gain=gain)
    done = run("calibrate", "frequency", path, "--axis", "x", "--v-max", "100")
    ordered(done.out, "warning: alpha = ", "the reference is the lowest frequency", "alpha is set to 0")


def bent_trace() -> Trace:
    """Half of the range, upside down, and 3 % of a bend that no model has."""
    scanner = Scanner()
    trace = scanner.trace(50.0, 3.3, 1000, 0.002 * np.random.default_rng(5).standard_normal((2, 1000)))
    bend = 0.03 * 500.0 * np.sin(6.0 * np.pi * trace.time_s / scanner.period_s)
    return replace(trace, displacement_nm=-(trace.displacement_nm + bend))


def test_hysteresis(tmp_path: Path) -> None:
    trace = bent_trace()
    columns = {"time_s": trace.time_s, "drive_v": trace.drive_v, "displacement_nm": trace.displacement_nm}
    path = write_csv(tmp_path / "t.csv", **columns)
    done = run("calibrate", "hysteresis", path, "--axis", "x", "--v-max", "100", "--no-plot")
    lines = [line for line in done.out.splitlines() if line.startswith("note: ")]
    assert "the harmonic model leaves" in lines[0]
    assert any("beta_max is extrapolated from 0.5 of v_max" in line for line in lines[1:])
    assert "its sign was inverted" in " ".join(lines[2:])
    remarks = fit_hysteresis([trace], 100.0).remarks
    assert in_order(worst_first(of_remarks(remarks)))
    assert not in_order(of_remarks(remarks))  # the fit notes them as they come
    (model,) = (one for one in remarks if "the harmonic model leaves" in one)
    assert model.percent == pytest.approx(float(re.search(r"leaves (\S+) %", model)[1]), rel=0.06)  # type: ignore[index]


def test_correct(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive of another image, whose size is another by more than the two are apart."""
    monkeypatch.chdir(tmp_path)
    Path("scanner.toml").write_text(LAWS, "utf-8")
    save_pair(old_frame("paper", pixels=128, lines=96), tmp_path)
    container = GwyContainer()
    for number, name in enumerate(("trace", "retrace")):
        container[f"/{number}/data/title"] = f"Height ({name.title()})"
        field = GwyDataField(np.load(f"{name}.npy"), xreal=1e-6, yreal=1e-6, si_unit_xy="m", si_unit_z="m")
        container[f"/{number}/data"] = field
    container.tofile("all.gwy")
    drive = ("--scanner", "scanner.toml", "--size-v", "50", "--offset-v", "50", "--rate-hz", "100")
    done = run("correct", "all.gwy", *drive)
    ordered(done.out, "the file has quite another size", "trace and retrace are still apart")


@pytest.mark.common
def test_simulate(tmp_path: Path) -> None:
    """Each model with what it leaves, the worst first; that it is a simulation is the last line."""
    done = run("simulate", write_pair(tmp_path, edited(SCAN, "- [limits]")), "--no-calibration")
    notes = [line for line in done.out.splitlines() if line.startswith("note: ")]
    percents = [abs(float(re.search(r"([+-]?[0-9.]+) %", line)[1])) for line in notes]  # type: ignore[index]
    assert percents == sorted(percents, reverse=True)
    assert any("the harmonic model leaves" in line for line in notes)
    assert any("off in the size of y" in line for line in notes)
    assert done.out.splitlines()[-1].startswith("A simulation, not a measurement")
