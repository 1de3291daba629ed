"""The seam for models of the piezo: those of tablegen, and a foreign one through the whole chain."""

import ast
import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from building import HELPERS
from editing import SCAN, SCANNER, edited, run

import tablegen
from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.compensation import models
from tablegen.compensation.line import AppliedBranch, LineShape, Sweep, WholeLine
from tablegen.compensation.models.harmonic import HarmonicModel
from tablegen.compensation.models.operator import OperatorModel
from tablegen.compensation.models.sinusoidal import SinusoidalModel
from tablegen.compensation.models.triangle import TriangleModel
from tablegen.config.load import load
from tablegen.manifest.read import read_build
from tablegen.planning.line_plan import make_plan
from tablegen.planning.refinement_layer import model_digest
from tablegen.virtual.simulation import models_of, with_model
from tablegen.waveform.closed_form import fourier_series
from tablegen.waveform.series import FourierSeries

PACKAGE = Path(tablegen.__file__).parent
PLAY = 0.012  # of the line
TABLE = '+ [x.hysteresis]\nmodel = "play"\noperator = "x.operator.json"'
PLAYS = edited(SCANNER, "- [x.hysteresis]", "- [[x.hysteresis.branches]]", TABLE)


@pytest.fixture
def pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The example on a scanner with the foreign model in x, which is installed: a file, and its entry point."""
    packages, folder = tmp_path / "packages", tmp_path / "pair"
    about = packages / "tablegen_play-1.0.dist-info"
    about.mkdir(parents=True)
    folder.mkdir()
    shutil.copy(HELPERS / "play_model.py", packages / "foreign_play.py")
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: tablegen-play\nVersion: 1.0\n", "utf-8")
    (about / "entry_points.txt").write_text(f"[{models.GROUP}]\nplay = foreign_play:Play\n", "utf-8")
    monkeypatch.syspath_prepend(packages)
    models.get.cache_clear()
    (folder / "scan.toml").write_text(edited(SCAN, "- [limits]"), "utf-8")
    (folder / "scanner.toml").write_text(PLAYS, "utf-8")
    (folder / "x.operator.json").write_text(json.dumps({"play": PLAY}), "utf-8")
    yield folder
    models.get.cache_clear()
    sys.modules.pop("foreign_play", None)


def displaced(w: np.ndarray, play: float) -> np.ndarray:
    """A play, step by step, over three periods; the last."""
    place, found = w[0], []
    for one in np.tile(w, 3):
        place = min(max(place, one - play), one + play)
        found.append(place)
    return np.array(found[-len(w) :])


def test_names_stand_with_the_models() -> None:
    assert models.names() == ["harmonic", "operator", "sinusoidal", "triangle"]
    assert models.own() == [HarmonicModel, OperatorModel, SinusoidalModel, TriangleModel]
    assert {models.DEFAULT, models.UNCOMPENSATED} < set(models.names())
    assert all(kind.purpose for kind in models.own())
    assert sorted(kind.order for kind in models.own()) == [0, 1, 2, 3]


# What says the equations once more does so on purpose; what is compared are operators, in files of their own.
OTHER_NAMES = {
    *("verification/checks/scaling.py", "compensation/models/__init__.py"),
    *("comparison/side.py", "comparison/operators.py"),
}
# Bouc-Wen's equation has a gamma of its own, which is none of (17).
ANOTHER_GAMMA = {
    *("compensation/operator/bouc_wen.py", "compensation/operator/file.py"),
    *("calibration/operator/bouc_wen_fit.py", "calibration/operator/file_of_fit.py"),
}


@pytest.mark.common
def test_names_and_parameters_of_models_stand_in_no_other_module() -> None:
    known, names, parameters = models.names(), set(), set()
    for path in PACKAGE.rglob("*.py"):
        where, tree = path.relative_to(PACKAGE).as_posix(), ast.parse(path.read_text("utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and node.value in known:
                names.add(where)
            if isinstance(node, ast.Name | ast.Attribute | ast.arg):
                called = getattr(node, "id", None) or getattr(node, "attr", None) or getattr(node, "arg", None)
                if called in {"xi", "xi_gamma"} or (called == "gamma" and where not in ANOTHER_GAMMA):
                    parameters.add(where)
    assert names == OTHER_NAMES | {f"compensation/models/{name}.py" for name in models.names()}
    assert parameters == {"compensation/hysteresis.py", "verification/checks/scaling.py"}


def test_a_foreign_model_makes_a_line_that_is_straight_on_it(pair: Path) -> None:
    plan = make_plan(load(pair / "scan.toml"))
    assert (plan.x.drive.model, plan.y.drive.model) == ("play", "harmonic")
    w = plan.x.target.on_grid(1 << 14)
    place = displaced(w, PLAY)
    t = np.arange(len(w)) / len(w)
    for wanted, inside in ((2.0 * t, (t > 0.05) & (t < 0.45)), (2.0 - 2.0 * t, (t > 0.55) & (t < 0.95))):
        assert np.max(np.abs(place - wanted)[inside]) < 2e-4
        assert np.max(np.abs(w - wanted)[inside]) > 0.9 * PLAY  # the drive itself is not straight there
    assert isinstance(plan.x.drive.shape, WholeLine)
    assert plan.x.drive.shape.series == plan.x.target


@pytest.mark.common
def test_it_is_built_shown_verified_and_simulated(pair: Path) -> None:
    built = run("build", pair / "scan.toml", "-o", pair / "out", "--depfile", pair / "out.d")
    assert built.status == 0, built.err
    axis = read_build(pair / "out").manifest.axes.x
    assert axis.drive.model == "play"
    certificate = axis.certificate.scaling_error_percent
    assert certificate is not None
    for side in ("forward", "backward"):
        assert certificate[side]["total"] < 0.5
        assert abs(certificate[side]["size"]) < 0.05
    assert "x.operator.json" in (pair / "out.d").read_text("utf-8")
    shown = run("show", pair / "scan.toml", "--all")
    assert shown.status == 0
    assert "play; forward beta " in shown.out
    verified = run("verify", pair / "out", "--target", "files")
    assert verified.status == 0, verified.err
    assert "scaling errors of the model play were not compared" in verified.out + verified.err


def test_without_the_package_its_build_is_not_believed(pair: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run("build", pair / "scan.toml", "-o", pair / "out", "--quiet").status == 0
    monkeypatch.setattr(sys, "path", [path for path in sys.path if not path.endswith("packages")])
    verified = run("verify", pair / "out", "--target", "files")
    assert verified.status != 0
    assert "drive.model is 'play', which neither tablegen nor a package here has" in verified.out + verified.err


def test_it_is_compared_with_the_models_that_its_table_serves(pair: Path) -> None:
    setup = load(pair / "scan.toml")
    assert models_of(setup) == ("triangle", "harmonic", "play")
    assert with_model(setup, "play") == setup
    plain = with_model(setup, "triangle")
    assert [type(axis.hysteresis) for axis in (plain.scanner.x, plain.scanner.y)] == [TriangleModel, TriangleModel]
    only_y = with_model(setup, "harmonic")
    assert only_y.scanner.x.hysteresis == setup.scanner.x.hysteresis


def test_a_refinement_belongs_to_the_content_of_the_file(pair: Path) -> None:
    setup = load(pair / "scan.toml")
    drive = make_plan(setup).x.drive
    before = model_digest(setup, "x", drive)
    (pair / "x.operator.json").write_text(json.dumps({"play": 1.01 * PLAY}), "utf-8")
    assert model_digest(setup, "x", drive) != before


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            TABLE.replace('"play"', '"prey"'),
            "model: 'prey' is not one of 'harmonic', 'operator', 'sinusoidal', 'triangle'",
        ),
        (TABLE.replace("operator =", "operater ="), "operater: unknown key; did you mean operator?"),
        (TABLE.replace('= "x.operator.json"', "= 3"), "operator: 3 is not a text in quotes"),
        (TABLE.replace("x.operator", "z"), "operator: z.json cannot be read"),
        (TABLE + "\nbranches = []", "branches: unknown key; known here: model, operator"),
    ],
)
def test_its_faults_have_their_lines(pair: Path, table: str, message: str) -> None:
    text = PLAYS.replace(TABLE[2:], table[2:])
    (pair / "scanner.toml").write_text(text, "utf-8")
    with pytest.raises(Rejected) as caught:
        make_plan(load(pair / "scan.toml"))
    (problem,) = caught.value.problems
    key, why = message.split(": ", 1)
    assert problem.key == f"x.hysteresis.{key}"
    assert problem.why.startswith(why)
    assert text.splitlines()[problem.line - 1].startswith(key)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("play = foreign_play:Learning", "'play' of tablegen-play is no tablegen.compensation.model.Hysteresis"),
        ("play = foreign_play:Prey", "'play' of tablegen-play cannot be loaded: AttributeError: "),
        ("play = foreign_play:Play\n[x]", None),
    ],
)
def test_a_package_without_such_a_model_is_refused(pair: Path, entry: str, message: str | None) -> None:
    about = pair.parent / "packages" / "tablegen_play-1.0.dist-info"
    (about / "entry_points.txt").write_text(f"[{models.GROUP}]\n{entry}\n", "utf-8")
    if message is None:
        assert models.get("play").model() == "play"
        return
    with pytest.raises(models.UnknownModel, match=message):
        models.get("play")


class Bowed(Sweep):
    """u = s + s (1 - s) / 10: a sweep of no model of tablegen."""

    def value(self, tau: np.ndarray | float) -> np.ndarray:
        tau = np.asarray(tau)
        return tau + 0.1 * tau * (1.0 - tau)

    def slope(self, tau: np.ndarray | float) -> np.ndarray:
        return 1.1 - 0.2 * np.asarray(tau)


def test_a_sweep_needs_a_value_and_a_slope_alone() -> None:
    tau = np.linspace(0.0, 1.0, 101)
    sweep = Bowed()
    assert np.max(np.abs(sweep.inverse(sweep.value(tau)) - tau)) < 1e-12
    assert AppliedBranch.of(sweep).beta == pytest.approx(0.025, abs=1e-6)
    assert LineShape(0.5, sweep, sweep).peaks[1].u_peak == pytest.approx(0.525, abs=1e-3)
    with pytest.raises(Unphysical, match="use method = 'window'"):
        fourier_series(LineShape(0.5, sweep, sweep), 4)


def test_the_sweeps_of_a_waveform() -> None:
    series = FourierSeries(0.5, np.array([-0.45]), np.array([0.0]))
    line = WholeLine.of(series, 0.5)
    inside = np.linspace(0.1, 0.9, 33)
    for sweep in (line.forward, line.backward):
        assert np.allclose(sweep.value(inside), 0.5 - 0.45 * np.cos(np.pi * inside), atol=1e-15)
        assert np.allclose(sweep.slope(inside), 0.45 * np.pi * np.sin(np.pi * inside), atol=1e-14)
        assert np.allclose(sweep.inverse(sweep.value(inside)), inside, atol=1e-9)
    assert np.allclose(line.value(0.5 * inside), line.forward.value(inside), atol=1e-15)
    error, speed = line.followed("forward", inside, series, line.value(0.5 * inside), line.slope(0.5 * inside))
    assert np.max(np.abs(error)) == 0.0
    assert np.max(np.abs(speed - 1.0)) == 0.0


# What fails in the package of a model


def broken(pair: Path, name: str, body: str) -> None:
    """Another module of the package, whose model has one method that is as given."""
    source = (HELPERS / "play_model.py").read_text("utf-8")
    subclass = f'\n\nclass Broken(Play, frozen=True, tag="play"):\n    {body}\n'
    (pair.parent / "packages" / f"{name}.py").write_text(source + subclass, "utf-8")
    about = pair.parent / "packages" / "tablegen_play-1.0.dist-info"
    (about / "entry_points.txt").write_text(f"[{models.GROUP}]\nplay = {name}:Broken\n", "utf-8")
    models.get.cache_clear()


@pytest.mark.parametrize(
    ("body", "why"),
    [
        (
            "def line(self, request, problems): return 1 / 0",
            "'play' of tablegen-play failed: ZeroDivisionError: division by zero",
        ),
        ("def line(self, request, problems): raise SystemExit", "'play' of tablegen-play failed: SystemExit"),
        (
            "def line(self, request, problems): return 3",
            "'play' of tablegen-play: line() returned an object of type int",
        ),
        (
            "def line(self, request, problems): return None",
            "'play' of tablegen-play: line() returned None, and no problem",
        ),
        ("def faults(self): return 1 / 0", "a plug-in of tablegen-play failed: ZeroDivisionError: division by zero"),
        ("def files(self): raise SystemExit", "a plug-in of tablegen-play failed: SystemExit"),
        ("def described(self, line): raise KeyError('x')", "a plug-in of tablegen-play failed: KeyError: 'x'"),
    ],
)
def test_a_model_that_fails_is_told_with_its_package(pair: Path, body: str, why: str) -> None:
    broken(pair, f"broken_{abs(hash(body))}", body)
    outcome = run("build", pair / "scan.toml", "-o", pair / "out", explains=True)
    assert outcome.status == 2, outcome.err
    assert why in outcome.err
    assert not (pair / "out").exists()


@pytest.mark.parametrize("source", ["raise SystemExit(0)", "import sys; sys.exit('so long')"])
def test_a_package_that_exits_as_it_is_loaded_is_told(pair: Path, source: str) -> None:
    name = f"leaving_{abs(hash(source))}"
    broken(pair, name, "")
    (pair.parent / "packages" / f"{name}.py").write_text(source, "utf-8")
    outcome = run("build", pair / "scan.toml", "-o", pair / "out")
    assert outcome.status == 2
    assert "x.hysteresis.model: 'play' of tablegen-play cannot be loaded: SystemExit: " in outcome.err
