"""Charts of every command: title, labels with units, legend, directions in two colours, line styles and marks."""

import os
import re
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

import click
import numpy as np
import pytest
from chart_rules import drawn_charts, faults, text_faults
from editing import run
from plotting_lab import PLOTTING, REPORTING, make_lab
from replacing import replace
from sets import quick

from tablegen.charts import style
from tablegen.charts.chart import Band, Chart, DrawnCurve, Mark, Raster
from tablegen.charts.picture_file import picture
from tablegen.cli import cli


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder, as the working one."""
    folder, before = tmp_path_factory.mktemp("lab"), Path.cwd()
    os.chdir(folder)
    make_lab(folder)
    yield folder
    os.chdir(before)


@pytest.mark.common
@pytest.mark.parametrize("name", quick(["show", "refine", "calibrate hysteresis"], [*PLOTTING]))
def test_every_picture_of_a_command(name: str, lab: Path) -> None:
    """In the file, and in a terminal of 80 and of 120 characters, with Unicode and without."""
    with drawn_charts() as charts:
        done = run(*PLOTTING[name], "--plot", "a.svg")
    assert done.status == 0, done.err
    assert charts
    text = " ".join(ElementTree.fromstring((lab / "a.svg").read_bytes()).itertext())
    for chart in charts:
        assert faults(chart) == [], chart.title
        for words in (chart.x_label, chart.y_label, *(curve.name for curve in chart.needed_legend)):
            assert words in text
        for width in (80, 120):
            for unicode in (True, False):
                assert text_faults(chart, width, unicode) == [], chart.title


@pytest.mark.common
@pytest.mark.parametrize("name", quick(["report"], [*REPORTING]))
def test_every_chart_of_a_page(name: str, lab: Path) -> None:
    if name == "report of a build":
        assert run(*PLOTTING["build"]).status == 0
    with drawn_charts() as charts:
        done = run(*REPORTING[name])
    assert done.status == 0, done.err
    assert charts
    for chart in charts:
        assert faults(chart) == [], chart.title


def test_no_command_that_plots_is_left_out() -> None:
    """By the options of all commands, and the other way round."""

    def commands(group: click.Group, before: str = "") -> Iterator[tuple[str, click.Command]]:
        context = click.Context(group)
        for name in group.list_commands(context):
            one = group.get_command(context, name)
            assert one is not None
            if isinstance(one, click.Group):
                yield from commands(one, f"{before}{name} ")
            else:
                yield f"{before}{name}", one

    found = {name for name, one in commands(cli) if any("--plot" in option.opts for option in one.params)}
    assert found == set(PLOTTING) - {"simulate own", "show of a line"}
    assert {"show", "build", "refine", "simulate", "correct"} < found
    assert sum(name.startswith("calibrate") for name in found) == 8


X = np.linspace(0.0, 1.0, 50)
SIDES = (DrawnCurve("forward", "forward", X, X), DrawnCurve("backward", "backward", X, -X))
GOOD = Chart("k", "a title", "time [ms]", "error [nm]", SIDES, (Band(0.1, 0.4, "imaged"),), (Mark(0.0, "", "y"),))


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"title": " "}, "no title"),
        ({"x_label": "time"}, "'time' has no unit"),
        ({"y_label": "[nm]"}, "'[nm]' has no unit"),
        ({"curves": (*SIDES, DrawnCurve("", "other", X, X))}, "a curve without a name"),
        ({"curves": (SIDES[0], DrawnCurve("backward", "forward", X, X))}, "'backward' is drawn as forward"),
        ({"curves": (DrawnCurve("other", "forward", X, X),)}, "'other' is drawn as forward"),
        ({"curves": (*SIDES, DrawnCurve("a", "other", X, X), DrawnCurve("b", "other", X, X))}, "'b' looks as 'a' does"),
        ({"raster": Raster(np.eye(3), (0, 1), (0, 1), 0, 1)}, "the shades have no unit"),
    ],
)
def test_faults_of_a_chart_are_found(changed: dict[str, object], fault: str) -> None:
    """Negative controls."""
    assert faults(GOOD) == []
    assert fault in faults(replace(GOOD, **changed))  # type: ignore[arg-type]


def test_the_page_and_files_have_the_same_colours() -> None:
    """The light scheme of the style sheet."""
    sheet = (resources.files("tablegen.html_report") / "page.css").read_text("utf-8")
    light = sheet.split("prefers-color-scheme")[0]
    for role, look in style.ROLES.items():
        assert f"--{role}:{look.stroke};" in light, role


def test_directions_that_look_the_same_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    from tablegen.charts import text as text_plot

    monkeypatch.setitem(style.ROLES, "backward", style.ROLES["forward"])
    assert faults(GOOD) == ["both directions have one colour", "both directions have one line style"]
    monkeypatch.setitem(text_plot._MARKS, "backward", ">")
    assert faults(GOOD)[2:] == ["both directions have one mark"]


def test_faults_of_a_plot_in_characters_are_found() -> None:
    assert text_faults(GOOD, 60, True) == []
    assert text_faults(replace(GOOD, x_label="x" * 90), 60, True)
    hidden = replace(GOOD, curves=(SIDES[0], replace(SIDES[1], y=np.full(50, np.nan))))
    assert text_faults(hidden, 60, True) == ["no mark of 'backward'"]


def places(path: str) -> np.ndarray:
    """The points of a path of relative steps."""
    first, steps = path.removeprefix("M").split("l")
    return np.vstack([np.array(first.split(), float), np.array(steps.split(), float).reshape(-1, 2)]).cumsum(axis=0)


def test_a_curve_in_a_file_is_the_data() -> None:
    """Read back from the places in the drawing, by the frame of the axes."""
    curve = DrawnCurve("sine", "other", X, np.sin(6.0 * X))
    chart = Chart("k", "t", "x [V]", "y [nm]", (curve,), x_range=(0.0, 1.0), y_range=(-1.0, 1.0))
    text = picture([chart], "svg").decode("utf-8")
    width, height = map(float, re.search(r'class="inner".*?viewBox="0 0 (\S+) (\S+)"', text).groups())  # type: ignore[union-attr]
    at = places(re.search(r'data-name="sine" d="(M[^"]+)"', text)[1])  # type: ignore[index]
    assert at[:, 0] / width == pytest.approx(curve.x, abs=1e-4)
    assert 1.0 - 2.0 * at[:, 1] / height == pytest.approx(curve.y, abs=1e-4)


def test_the_shades_of_an_image_are_the_values() -> None:
    """From the palette image within the SVG, upright, with what has no value in a colour of its own."""
    from base64 import b64decode
    from io import BytesIO

    from PIL import Image

    values = np.array([[0.0, 1.0], [0.5, np.nan]])
    raster = Raster(values, (0.0, 2.0), (0.0, 2.0), 0.0, 1.0, "grey", "height [nm]")
    text = picture([Chart("k", "t", "x [nm]", "y [nm]", (), raster=raster, equal=True)], "svg").decode("utf-8")
    (first, *_) = re.findall(r"base64,([A-Za-z0-9+/=]+)", text)
    shown = np.array(Image.open(BytesIO(b64decode(first))).convert("RGB"))
    assert shown[0].tolist() == [[0, 0, 0], [255, 255, 255]]
    assert shown[1, 0].tolist() == [128, 128, 128]
    assert len(set(shown[1, 1].tolist())) > 1  # no grey


@pytest.mark.common
def test_the_three_kinds_show_the_same() -> None:
    """PNG and SVG have the same size, and colours of both directions; each file is the same twice."""
    from io import BytesIO

    from PIL import Image

    both = [picture([GOOD], "png", "h") for _ in range(2)]
    assert both[0] == both[1]
    image = np.array(Image.open(BytesIO(both[0])).convert("RGB")).astype(int)
    root = ElementTree.fromstring(picture([GOOD], "svg", "h"))
    size = float(root.get("width", "0")), float(root.get("height", "0"))
    assert image.shape[1] / size[0] == pytest.approx(1.5, rel=0.01)
    assert image.shape[0] / size[1] == pytest.approx(1.5, rel=0.01)
    for colour in ((0x00, 0x72, 0xB2), (0xC4, 0x4E, 0x00)):
        assert np.sum(np.max(np.abs(image - np.array(colour)), axis=2) < 30) > 100
    assert picture([GOOD], "pdf").startswith(b"%PDF")
    assert picture([GOOD], "pdf") == picture([GOOD], "pdf")
    with pytest.raises(ValueError, match="gif: is none of png, svg, pdf"):
        picture([GOOD], "gif")
