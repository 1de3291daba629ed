"""The README and the docs say what the program does: output, errors, figures and keys are made again and compared."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from click.testing import CliRunner
from editing import SCAN, edited, run, write_pair
from scaling import SECTION_8, worst

from tablegen.base.input_errors import Rejected
from tablegen.certificate.certificate import certify
from tablegen.cli import cli
from tablegen.config.load import load
from tablegen.config.schema import BandLimit
from tablegen.planning.band_limit import band_limited
from tablegen.planning.line_plan import make_plan

README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
BUILDING = (REPOSITORY / "docs" / "building.md").read_text(encoding="utf-8")
ACCURACY = (REPOSITORY / "docs" / "accuracy.md").read_text(encoding="utf-8")


def block(command: str, page: str = BUILDING) -> str:
    """The text block of a page that starts with a command, without that command."""
    found = re.search(r"```text\n\$ " + re.escape(command) + r"\n(.*?)```", page, re.DOTALL)
    assert found, f"the page shows no {command!r}"
    return found[1]


def test_the_readme_and_the_page_have_the_same_files() -> None:
    """What a build writes stands in both."""
    rows = [
        [line.replace("docs/", "") for line in text.splitlines() if re.match(r"\| `(?:NAME|dac_|manifest)", line)]
        for text in (README, BUILDING)
    ]
    assert rows[0] == rows[1]
    assert len(rows[0]) == 9


def test_the_build_prints_what_the_readme_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "examples").symlink_to(REPOSITORY / "examples")
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, ["build", "examples/annexin_200nm.toml", "-o", "build/demo"])
    for page in (README, BUILDING):
        assert result.stdout == block("tablegen build examples/annexin_200nm.toml -o build/demo", page)


def test_the_errors_are_what_the_readme_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    wrong = edited(SCAN, "- x.size_nm", "x.size = 200.0", "dac.bits = 30", "y.turn = 1.5")
    too_large = edited(SCAN, "x.size_nm = 1350.0")
    for name, text in (("scan", wrong), ("large", too_large)):
        write_pair(tmp_path, text).replace(tmp_path / f"{name}.toml")
        with pytest.raises(Rejected) as caught:
            make_plan(load(f"{name}.toml"))
        assert [str(p) for p in caught.value.problems] == block(f"tablegen check {name}.toml").splitlines()


def test_the_warning_is_what_the_readme_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_pair(tmp_path, edited(SCAN, "- [limits]", "x.size_nm = 20.0")).replace(tmp_path / "small.toml")
    shown = " ".join(block("tablegen check small.toml").split())
    (said,) = run("check", "small.toml").messages
    number = re.compile(r"\d+(?:\.\d+)?")
    assert number.sub("#", said) == number.sub("#", shown)
    for one, other in zip(number.findall(said), number.findall(shown), strict=True):
        assert float(one) == pytest.approx(float(other), rel=0.05, abs=1e-3)


def test_the_accuracy_table_is_measured(tmp_path: Path) -> None:
    rows = re.findall(
        r"^\| (\d+) \| (\d+) words of (\d+) bits[^|]*\|([^|]*)\|([^|]*)\|([^|]*)\|([^|]*)\|$", ACCURACY, re.M
    )
    assert len(rows) == 5
    for dac, length, bits, x_error, y_error, x_scaling, y_scaling in rows:
        tables = [f"{axis}.table.{key}" for axis in "xy" for key in (f"length = {length}", f"bits = {bits}")]
        path = write_pair(tmp_path, edited(SCAN, f"dac.bits = {dac}", *tables))
        certificates = certify(make_plan(load(path)))
        for axis, error, scaling in (("x", x_error, x_scaling), ("y", y_error, y_scaling)):
            c = certificates[axis]
            assert error.strip() == f"{c.max_error_lsb:.3f}, {c.rms_error_lsb:.3f}", (dac, axis)
            assert scaling.strip() == f"{c.scaling['forward'].total:.3f}", (dac, axis)


def band_limit_figures(harmonics: int) -> dict[str, tuple[float, float]]:
    """Worst scaling error in percent and peak acceleration of each method, section-8 parameters."""
    found = {}
    for method in ("truncate", "lanczos", "window"):
        series = band_limited(SECTION_8, BandLimit(method=method), harmonics)
        found[method] = worst(SECTION_8, series), series.peak_acceleration()
    return found


def same(shown: str, measured: float) -> bool:
    """Whether a figure is what it says, to the digits that it shows."""
    return shown == f"{measured:.{len(shown.partition('.')[2])}f}"


def test_the_band_limit_tables_are_measured() -> None:
    page = (REPOSITORY / "docs" / "waveform.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| (\d+) \| (\d+) \|$", page, re.M)
    short = re.findall(r"^\| (\d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", ACCURACY, re.M)
    assert [row[0] for row in rows] == ["8", "16", "21", "32", "64"]
    assert [row[0] for row in short] == ["16", "21", "32"]
    for harmonics, *shown in [*rows, *short]:
        figures = band_limit_figures(int(harmonics))
        measured = [figures[method][0] for method in ("truncate", "lanczos", "window")]
        measured += [figures[method][1] for method in ("truncate", "window")][: len(shown) - 3]
        assert [same(s, m) for s, m in zip(shown, measured, strict=True)] == [True] * len(shown), (harmonics, measured)


def test_uncompensated_errors_are_measured(tmp_path: Path) -> None:
    """Of section 8, through the branches themselves; and of the example, by its certificate."""
    x = np.linspace(0.1, 0.9, 5001)
    found = []
    for branch in (SECTION_8.forward, SECTION_8.backward):
        slope = 1.0 / branch.slope(branch.inverse(x))
        found.append(100.0 * float(slope.max() - slope.min()) / float(np.interp(0.5, x, slope)))
    text = " ".join(ACCURACY.split())
    assert f"any correction has {found[0]:.0f} forward and {found[1]:.0f} backward" in text
    certificates = certify(make_plan(load(write_pair(tmp_path))))
    x_scaling, y_scaling = certificates["x"].scaling, certificates["y"].scaling
    assert (
        f"uncompensated the example has {x_scaling['forward'].uncompensated:.1f} % forward and "
        f"{x_scaling['backward'].uncompensated:.1f} % backward in x, {y_scaling['forward'].uncompensated:.1f} % in y"
    ) in text


def test_the_configuration_page_is_the_schema() -> None:
    sys.path.insert(0, str(REPOSITORY / "docs"))
    try:
        from make_configuration import page
    finally:
        sys.path.pop(0)
    assert (REPOSITORY / "docs" / "configuration.md").read_text(encoding="utf-8") == page()
