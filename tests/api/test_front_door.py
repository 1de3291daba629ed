"""``import tablegen``: what it names, what it costs, and that scripts get what the command line writes."""

import json
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from building import EXAMPLE, changed
from editing import run

import tablegen
from tablegen.device.played_lines import play_line

SCANNER = EXAMPLE.parent / "scanner.toml"


@pytest.fixture(scope="module")
def scan() -> tablegen.Build:
    return tablegen.build(EXAMPLE)


@pytest.mark.common
def test_names_are_listed_and_loaded_when_they_are_used() -> None:
    code = (
        "import sys, tablegen\n"
        "assert dir(tablegen) == sorted([*tablegen.__all__, '__doc__'])\n"
        "assert not {'numpy', 'msgspec', 'click', 'importlib.metadata'} & set(sys.modules)\n"
        "for name in tablegen.__all__: assert getattr(tablegen, name).__doc__, name\n"
        "assert 'numpy' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_name_that_is_not_there_is_refused() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'bild'; it has load, plan"):
        _ = tablegen.bild  # type: ignore[attr-defined]


def test_no_function_has_the_name_of_a_package() -> None:
    """Importing a package makes it an attribute of ``tablegen``, which would hide the function."""
    folders = {path.parent.name for path in Path(tablegen.__file__).parent.glob("*/__init__.py")}
    modules = {path.stem for path in Path(tablegen.__file__).parent.glob("*.py")}
    assert not (folders | modules) & set(tablegen.__all__)


def test_files_are_those_of_the_command(scan: tablegen.Build, tmp_path: Path) -> None:
    assert run("build", EXAMPLE, "-o", tmp_path / "command").status == 0
    written = scan.write(tmp_path / "script")
    assert written == list(scan.files)
    assert scan.write(tmp_path / "script") == []
    for folder in ("command", "script"):
        assert {path.name: path.read_bytes() for path in (tmp_path / folder).iterdir()} == scan.files
    assert json.loads(scan.manifest)["name"] == scan.name


def test_samples_are_what_the_sequencer_plays(scan: tablegen.Build) -> None:
    """Codes and markers by the model of the device, line by line; volts by the amplifier of the scan file."""
    program, schedule = scan.plan.program, scan.plan.schedule
    x = scan.x
    for number in (0, 77, 199):
        line, y = play_line(program, number), scan.samples("y", number * 1250, (number + 1) * 1250)
        assert np.array_equal(x.codes, line.x)
        assert np.array_equal(y.codes, line.y)
        assert np.array_equal(x.pixel, line.pixel)
        assert np.array_equal(x.backward, line.backward)
        assert np.array_equal(x.line, line.line)
        assert np.array_equal(x.inside & y.inside, line.valid)
        assert np.array_equal(y.start, line.frame)
    assert len(scan.y) == schedule.frame_ticks
    assert x.time_s[1] == 1 / 500e3
    assert x.time_s[-1] == pytest.approx(1249 / 500e3)
    assert x.volts == pytest.approx(10.0 * (-5.0 + 10.0 * x.codes / 65536) + 50.0)  # gain 10, bias 50 V


@pytest.mark.parametrize("axis", ["x", "y"])
def test_samples_follow_the_waveform_as_closely_as_the_certificate_says(scan: tablegen.Build, axis: str) -> None:
    samples, certificate = getattr(scan, axis), scan.certificates[axis]
    lsb = 10.0 * 10.0 / 65536
    errors = (samples.volts - samples.asked_volts) / lsb
    assert np.max(np.abs(errors)) == pytest.approx(certificate.max_error_lsb, abs=2e-6)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(certificate.rms_error_lsb, rel=1e-3)


def test_samples_outside_of_the_period_are_refused(scan: tablegen.Build) -> None:
    with pytest.raises(ValueError, match=r"ticks 0 to 1251 are outside the 1250 ticks of a period of x"):
        scan.samples("x", 0, 1251)


def test_a_plan_needs_no_file(scan: tablegen.Build) -> None:
    """The values of the files, also as tuples and numbers of numpy, make the same integers."""
    values = changed(EXAMPLE, {"x.band_limit.window": (0.1, 0.9), "x.size_nm": np.float64(200.0)})
    plan = tablegen.plan(scan=values, scanner=changed(SCANNER, {}))
    assert np.array_equal(plan.x.program.words, scan.plan.x.program.words)
    built = tablegen.build(scan=values, scanner=changed(SCANNER, {}))
    assert built.files == scan.files
    assert built.setup.files == []


def test_faults_of_values_have_no_line() -> None:
    with pytest.raises(tablegen.Rejected) as refused:
        tablegen.plan(scan=changed(EXAMPLE, {"x.turn": 1.5}), scanner=changed(SCANNER, {"v_max": -1}))
    assert list(map(str, refused.value.problems)) == [
        "scan: x.turn: 1.5 is not below 1",
        "scanner: v_max: -1 is below 0.001",
    ]


@pytest.mark.parametrize("given", [{}, {"scan": {}}, {"source": EXAMPLE, "scan": {}, "scanner": {}}])
def test_half_of_the_input_is_a_mistake_of_the_caller(given: dict[str, object]) -> None:
    with pytest.raises(TypeError, match="give a scan file or a setup"):
        tablegen.plan(**given)  # type: ignore[arg-type]


def test_a_broken_limit_is_an_exception_of_its_own() -> None:
    with pytest.raises(tablegen.BrokenLimit, match=r"limits\.max_error_lsb"):
        tablegen.build(scan=changed(EXAMPLE, {"limits.max_error_lsb": 0.1}), scanner=changed(SCANNER, {}))


def test_an_unknown_format_is_named_where_it_was_asked_for(scan: tablegen.Build) -> None:
    with pytest.raises(
        tablegen.Rejected, match=r"^formats: 'forth' is not a format; formats are arduino, axi-stream, bin, c, "
    ):
        tablegen.build(scan.setup, formats=["forth"])
    with pytest.raises(tablegen.Rejected, match=r"^scan: emit\.formats: 'forth' is not a format"):
        tablegen.build(scan=changed(EXAMPLE, {"emit.formats": ["forth"]}), scanner=changed(SCANNER, {}))


def test_representations_are_short(scan: tablegen.Build, tmp_path: Path) -> None:
    scan.write(tmp_path)
    shown = (scan, scan.plan, scan.plan.x, scan.setup, scan.x, tablegen.read_build(tmp_path))
    for one in (*shown, tablegen.verify(tmp_path, "files")):
        assert len(repr(one)) < 300
        assert len(repr(one).splitlines()) <= 3


class _Elements(HTMLParser):
    """Which elements are open, and all texts."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []
        self.attributes: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [value or "" for _, value in attrs]
        self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [value or "" for _, value in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_a_notebook_shows_drive_error_and_certificate(scan: tablegen.Build) -> None:
    html = scan._repr_html_()
    seen = _Elements()
    seen.feed(html)
    assert seen.open == []
    text = " ".join(seen.texts)
    for wanted in (
        "x drive, one line",
        "drive at the piezo [V]",
        "y: modelled error",
        "compensated",
        "max 0.574 LSB",
        "20.3679 V peak to",
    ):
        assert wanted in text
    assert len(html) < 60_000
    assert not any("http" in value for value in (*seen.attributes, *seen.texts))


def test_html_is_safe_against_names(tmp_path: Path) -> None:
    built = tablegen.build(scan=changed(EXAMPLE, {}), scanner=changed(SCANNER, {"name": "<script>alert(1)</script>"}))
    assert "<script>" not in built._repr_html_()
