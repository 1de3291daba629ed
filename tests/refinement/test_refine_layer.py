"""A layer in the scan file: what it adds to the drive, what the certificate says of it, and which scans it serves."""

import json
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, SCANNER, edited, run, write_pair
from hypothesis import given, settings
from hypothesis import strategies as st
from sets import long

from tablegen.base.input_errors import Rejected
from tablegen.certificate.certificate import certify
from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import LineShape
from tablegen.config.load import load
from tablegen.config.schema import BandLimit
from tablegen.emit.render import render
from tablegen.fixedpoint.synthesis import FourierWords, synthesize
from tablegen.link.prepare import PreparedScan
from tablegen.manifest.read import read_build
from tablegen.planning.band_limit import band_limited
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.refinement_layer import model_digest
from tablegen.virtual.played import intended, played
from tablegen.waveform.series import FourierSeries

A, B = [0.001, -0.0004, 0.0, 0.0002], [-0.0015, 0.0006, 0.0003, -0.0001]
LEARNT = """+ [x.refinement]
a = [0.001, -0.0004, 0.0, 0.0002]
b = [-0.0015, 0.0006, 0.0003, -0.0001]
v_amplitude = 20.3679
v_offset = 50.0
rate_hz = 400.0
turn = 0.5
window = [0.1, 0.9]
directions = "both"
"""
SHAPE = LineShape(0.5, BranchShape.harmonic(0.035, 0.37), BranchShape.harmonic(0.085, 0.48))


def at(axis: str, *edits: str) -> list[str]:
    """The layer on an axis, with keys replaced by lines such as ``turn = 0.6``."""
    lines = LEARNT.replace("[x.", f"[{axis}.").splitlines()
    for edit in edits:
        key = edit.split(" = ")[0]
        lines = [edit if line.startswith(f"{key} = ") else line for line in lines]
        if edit not in lines:
            lines.append(edit)
    return ["\n".join(lines)]


def planned(folder: Path, *edits: str, scanner: str = SCANNER) -> Plan:
    return make_plan(load(write_pair(folder, edited(SCAN, *edits), scanner)))


def refused(folder: Path, *edits: str, scanner: str = SCANNER) -> list[str]:
    with pytest.raises(Rejected) as caught:
        planned(folder, *edits, scanner=scanner)
    return [f"{problem.key}: {problem.why}" for problem in caught.value.problems]


def by_numpy(a: list[float], b: list[float], t: np.ndarray) -> np.ndarray:
    angle = 2.0 * np.pi * np.outer(t, np.arange(1, len(a) + 1))
    return np.cos(angle) @ np.array(a) + np.sin(angle) @ np.array(b)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return planned(tmp_path_factory.mktemp("plain"))


@pytest.fixture(scope="module")
def refined(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return planned(tmp_path_factory.mktemp("refined"), *at("x"))


def test_the_window_has_the_layer_over_the_model(plain: Plan, refined: Plan) -> None:
    x = np.linspace(0.1, 0.9, 401)
    t = np.concatenate([0.5 * x, 0.5 + 0.5 * (1.0 - x)])
    added = refined.x.target.value(t) - plain.x.target.value(t)
    assert np.max(np.abs(added - by_numpy(A, B, t))) < 2e-5
    assert np.max(np.abs(added)) > 1e-3
    assert refined.y.series.b.tolist() == plain.y.series.b.tolist()
    # The emitted integers follow it: codes less those without are the layer, to the rounding of both.
    k = np.arange(refined.x.program.ticks)
    inside = np.isin(k, np.r_[125 // 2 + 1 : 562, 688:1187])
    codes = (refined.x.codes(0, len(k)) - plain.x.codes(0, len(k)))[inside]
    through = codes / refined.x.codes_per_unit - by_numpy(A, B, k / len(k))[inside]
    assert np.max(np.abs(through)) < 0.02 * np.max(np.abs(by_numpy(A, B, k / len(k)))) + 2.0 / refined.x.codes_per_unit


@given(
    st.lists(st.floats(-0.01, 0.01), min_size=1, max_size=8),
    st.sampled_from(["truncate", "lanczos", "window"]),
    st.integers(20, 40),
)
@settings(max_examples=30, deadline=None)
def test_every_method_adds_it_and_the_range_is_held(a: list[float], method: str, harmonics: int) -> None:
    layer = FourierSeries(0.0, np.array(a), np.array(a[::-1]))
    limit = BandLimit(method=method)
    with_it, without = band_limited(SHAPE, limit, harmonics, layer), band_limited(SHAPE, limit, harmonics)
    if method == "window":
        x = np.linspace(0.1, 0.9, 101)
        t = np.concatenate([0.5 * x, 1.0 - 0.5 * x])
        assert np.max(np.abs((with_it.value(t) - without.value(t)) - layer.value(t))) < 0.002 * np.max(np.abs(a)) + 1e-4
        w = with_it.on_grid(4096)
        assert w.min() > -1e-6
        assert w.max() < 1.0 + 1e-6
    else:
        assert with_it.less(without).a[: len(a)] == pytest.approx(a, abs=1e-15)
        assert np.max(np.abs(with_it.less(without).b[len(a) :]), initial=0.0) == 0.0


def test_the_certificate_does_not_take_the_layer_for_an_error(plain: Plan, refined: Plan) -> None:
    before, after = certify(plain)["x"], certify(refined)["x"]
    assert before.refinement is None
    assert after.refinement is not None
    assert after.max_error_lsb < 1.0
    for side in ("forward", "backward"):
        assert after.scaling[side].total == pytest.approx(before.scaling[side].total, abs=0.2)
        assert after.scaling[side].band_limit < 0.02
        assert abs(after.scaling[side].size) < 0.001
        # By the exact inverse of the branch, and not to first order.
        x = np.linspace(0.1, 0.9, 4001)
        branch = getattr(refined.x.drive.shape, side)
        r = by_numpy(A, B, 0.5 * x if side == "forward" else 1.0 - 0.5 * x)
        sweep = x if side == "forward" else 1.0 - x
        moved = branch.inverse(branch.value(sweep) + (r if side == "forward" else -r)) - sweep
        found = after.refinement[side]
        assert found.position == pytest.approx(100.0 * np.max(np.abs(moved)), rel=0.01)
        assert found.scaling == pytest.approx(100.0 * np.ptp(np.gradient(moved, x)), rel=0.02)


def test_a_layer_that_the_boost_limit_holds_back_is_an_error_of_the_model(tmp_path: Path) -> None:
    scanner = edited(SCANNER, "x.resonance.frequency_hz = 1000", "x.resonance.max_boost_db = 0.0")
    errors = []
    for layer in ([], at("x", "v_amplitude = 20.3679")):
        plan = planned(tmp_path, "- [limits]", "timing.line_rate_hz = 400", *layer, scanner=scanner)
        errors.append(certify(plan)["x"].scaling["forward"])
    assert errors[1].model != errors[0].model
    assert errors[1].band_limit == pytest.approx(errors[0].band_limit, abs=0.01)


def test_what_is_printed_and_recorded(tmp_path: Path, plain: Plan, refined: Plan) -> None:
    files, without = render(refined, certify(refined)), render(plain, certify(plain))
    manifest, bare = (json.loads(found["manifest.json"]) for found in (files, without))
    x, y = manifest["axes"]["x"], manifest["axes"]["y"]
    assert x["fourier"]["refinement"] == {"harmonics": 4, "a": A, "b": B}
    assert set(x["certificate"]["refinement_percent"]) == {"forward", "backward"}
    assert manifest["hash"] != bare["hash"]
    # Of what has no layer nothing is new.
    assert y == bare["axes"]["y"]
    assert "refinement" not in bare["axes"]["x"]["fourier"]
    assert "refinement_percent" not in bare["axes"]["x"]["certificate"]
    header = files["annexin_200nm.h"].decode("ascii")
    assert "4 harmonics learnt" in header
    assert "takes away" in header
    path = write_pair(tmp_path, edited(SCAN, *at("x")))
    assert "refined forward   moves up to" in run("show", path, "--no-plot", "--all").out
    built = run("build", path, "-o", tmp_path / "out")
    assert "x     refinement, backward: moves up to" in built.out
    stored = read_build(tmp_path / "out")
    assert stored.own_hash == stored.manifest.hash
    k = np.arange(1250)
    assert np.max(np.abs(stored.manifest.axes.x.unrounded_codes(k) - refined.x.codes(0, 1250))) < 1.0


@pytest.mark.common
@pytest.mark.parametrize("options", long([("c",)], [("verilog", "--axis", "blocks"), ("c",)]), ids=["verilog", "c"])
def test_such_a_build_verifies(options: tuple[str, ...], tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, "timing.lines = 6", *at("x")))
    assert run("build", path, "-o", tmp_path / "out", "-q").status == 0
    outcome = run("verify", tmp_path / "out", "--target", *options)
    assert outcome.status == 0, outcome.err


def test_such_a_scan_uploads_as_it_plays(tmp_path: Path, plain: Plan, refined: Plan) -> None:
    """From the plan and from the build the same image, whose Fourier words render the words that are played."""
    path = write_pair(tmp_path, edited(SCAN, *at("x")))
    assert run("build", path, "-o", tmp_path / "out", "-q").status == 0
    of_plan, of_build = PreparedScan.of_plan(refined), PreparedScan.of_build(tmp_path / "out")
    assert of_plan.digest == of_build.digest != PreparedScan.of_plan(plain).digest
    assert of_plan.image("fourier") == of_build.image("fourier") != PreparedScan.of_plan(plain).image("fourier")
    a, b = np.split(of_build.x_fourier[1:], 2)
    fourier = FourierWords(int(of_build.x_fourier[0]), a, b)
    program = refined.x.program
    assert np.array_equal(synthesize(fourier, len(program.words), program.bits), program.words)


REMEDY = "remove [x.refinement], build, and run tablegen refine on a new trace"
REFUSED = [
    (
        ["v_amplitude = 22.0"],
        "x.refinement.v_amplitude: learnt at 22 V, this scan drives 20.3679 V, -7.42 % of it; up to 5 % are served",
    ),
    (
        ["v_offset = 56.0"],
        "x.refinement.v_offset: learnt at 56 V, this scan is at 50 V, -6 V off; up to 5 V are served",
    ),
    (
        ["rate_hz = 300.0"],
        "x.refinement.rate_hz: learnt at 300 Hz, this scan has 400 Hz, +33.3 % of it; up to 20 % are served",
    ),
    (["turn = 0.53"], "x.refinement.turn: learnt at 0.53, this scan turns at 0.5, -0.03 off; up to 0.02 are served"),
    (
        ["window = [0.2, 0.9]"],
        "x.refinement.window: learnt over 0.2..0.9, this scan images 0.1..0.9, 0.1 beyond; up to 0.02 are served",
    ),
    (
        ['directions = "forward"'],
        "x.refinement.directions: learnt forward only, and this scan images both directions",
    ),
    (
        ['model = "0123456789abcdef"'],
        "x.refinement.model: learnt over another x.hysteresis or x.resonance of the scanner file, or by tablegen "
        "before 0.3.0, which left the converter's hold to the layer",
    ),
]


@pytest.mark.parametrize(("edits", "says"), REFUSED, ids=lambda value: str(value)[:30])
def test_another_scan_than_the_one_it_was_learnt_at(edits: list[str], says: str, tmp_path: Path) -> None:
    assert refused(tmp_path, *at("x", *edits)) == [f"{says}; {REMEDY}"]


def test_all_of_it_is_said_at_once_and_at_its_line(tmp_path: Path) -> None:
    found = refused(tmp_path, *at("x", "v_offset = 60.0", "rate_hz = 100.0", "turn = 0.7"))
    assert [text.split(":")[0] for text in found] == [f"x.refinement.{key}" for key in ("v_offset", "rate_hz", "turn")]
    outcome = run("check", tmp_path / "scan.toml")
    assert outcome.status == 2
    line = (tmp_path / "scan.toml").read_text().splitlines().index("rate_hz = 100.0") + 1
    assert any(f"scan.toml:{line}: x.refinement.rate_hz: " in message for message in outcome.messages)


def test_what_is_near_enough_is_built(tmp_path: Path) -> None:
    near = ["v_amplitude = 21.4", "v_offset = 54.9", "rate_hz = 480.0", "turn = 0.52", "window = [0.12, 0.9]"]
    assert planned(tmp_path, *at("x", *near)).x.layer is not None


def test_harmonics_that_do_not_fit(tmp_path: Path) -> None:
    assert refused(tmp_path, *at("x"), "x.band_limit.harmonics = 3", "- [limits]") == [
        f"x.refinement.a: 4 harmonics, and the band limit passes 3; {REMEDY}"
    ]
    assert refused(tmp_path, *at("x", "b = [0.1]")) == ["x.refinement.b: 1 harmonics, and 4 in a"]
    assert "x.refinement.a[1]: 0.7 is above 0.5" in refused(tmp_path, *at("x", "a = [0.0, 0.7, 0.0, 0.0]"))
    assert "x.refinement.a: 0 entries are too few, at least 1 are needed" in refused(tmp_path, *at("x", "a = []"))


def test_a_new_calibration_is_another_model(tmp_path: Path) -> None:
    setup = load(write_pair(tmp_path))
    digest = model_digest(setup, "x", make_plan(setup).x.drive)
    known = at("x", f'model = "{digest}"')
    assert planned(tmp_path, *known).x.layer is not None
    # The size is no part of the shape; hysteresis and resonance are, of this axis.
    for edit in ("x.size.base_nm = 201.0", "x.offset.m_plus = 1.26", "y.size.beta = 0.5"):
        assert planned(tmp_path, *known, scanner=edited(SCANNER, edit)).x.layer is not None
    for edit in ("x.resonance.quality = 19.0", "x.resonance.max_boost_db = 5.0", "- [x.resonance]"):
        assert len(refused(tmp_path, *known, scanner=edited(SCANNER, edit))) == 1
    other = SCANNER.replace("beta_max = 0.080", "beta_max = 0.081", 1)
    assert len(refused(tmp_path, *known, scanner=other)) == 1


def test_a_response_measured_anew_is_another_model(tmp_path: Path) -> None:
    rows = "hz,gain,phase_deg\n100,1.0,0\n20000,1.2,-9\n60000,0.7,-120\n"
    scanner = edited(SCANNER, "- [x.resonance]", '+ [x.resonance]\nresponse = "response.csv"')
    digests = []
    for text in (rows, rows, rows.replace("1.2", "1.3")):
        (tmp_path / "response.csv").write_text(text, "utf-8")
        setup = load(write_pair(tmp_path, scanner=scanner))
        digests.append(model_digest(setup, "x", make_plan(setup).x.drive))
    assert digests[0] == digests[1] != digests[2]


def test_the_virtual_scanner_is_asked_for_the_line_alone(plain: Plan, refined: Plan) -> None:
    """The layer is there for what the model does not know: it asks for no other position."""
    positions = [intended(plan.x, played(plan.x)) for plan in (plain, refined)]
    inside = np.r_[70:560, 690:1180]
    assert np.max(np.abs(positions[1] - positions[0])[inside]) < 1e-4


def test_y_has_a_layer_of_its_own(tmp_path: Path) -> None:
    mine = ["rate_hz = 2.0", "turn = 0.95", "window = [0.05, 0.95]", 'directions = "forward"', "v_amplitude = 19.864"]
    plan = planned(tmp_path, "- [limits]", *at("y", *mine))
    assert plan.x.layer is None
    t = 0.95 * np.linspace(0.05, 0.95, 101)
    added = plan.y.target.value(t) - planned(tmp_path, "- [limits]").y.target.value(t)
    assert np.max(np.abs(added - by_numpy(A, B, t))) < 1e-5
