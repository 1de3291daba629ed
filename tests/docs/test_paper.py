"""The paper's printed numbers beside ours: the page is what comes out, its verdicts are computed and can be lost."""

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import make_paper
import numpy as np
import pytest
from building import REPOSITORY
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread
from paper import figure_3, figure_5_growth, figure_5_laws, figure_6, laws, measured, page
from paper.rows import Printed, Row, Source, about, between, exact, exactly, faults, limits
from replacing import replace

from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.size import SizeLaw
from tablegen.numerics.arrays import Floats

pytestmark = pytest.mark.rest

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
PAGE = REPOSITORY / "docs" / "paper" / "README.md"

# What text and captions print of a result, by section of the page; read from the paper, not from the rows.
PRINTED = {
    "Table 1": "30 25 15 5 10 1 2 3 4 20 order",
    "Figure 2": "12 20 17.7 22.3 25 16.3 8 30 1.2 1.3 0.85 0.95",
    "Figure 3": "16.4 8 7 25 0.53 0.5 1 6 436 467 9 17 0.13",
    "Figures 5b": "-3 -6 -9 0.53 0.56 0.59 0.9 0.48 -3.5 0.37 0.5 0.65",
    "Figures 5a": "-3.5 +8.5 2 0.35 0.55 0.45 0.035 0.37 0.085 0.48 6 30 60 half ±1.5 15 ±0.5 ±1 third 5 11",
    "Figures 5k": "0.037 4 0.08 1.5 0 beta_max 2 3 10 25 1/3",
    "Figure 6": "14 18.3 3 50 40 0.03 1 2",
}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("paper")
    make_paper.write(folder)
    return folder


@pytest.fixture(scope="module")
def rows() -> dict[str, list[Row]]:
    return dict(page.all_rows())


@pytest.fixture
def row(rows: dict[str, list[Row]]) -> Callable[[str, str], Row]:
    def find(figure: str, what: str) -> Row:
        (found,) = [r for section in rows.values() for r in section if r.figure == figure and r.what == what]
        return found

    return find


@pytest.mark.rest
def test_the_page_is_what_comes_out(written: Path) -> None:
    """Word for word, and number for number to one unit of the last digit, which may differ between machines."""
    shown, made = (path.read_text(encoding="utf-8") for path in (PAGE, written / "README.md"))
    assert NUMBER.sub("#", shown) == NUMBER.sub("#", made), "run `make paper`"
    for one, other in zip(NUMBER.findall(shown), NUMBER.findall(made), strict=True):
        unit = 10.0 ** -len(one.partition(".")[2]) if "." in one else 0.0
        assert abs(float(one) - float(other)) <= 1.001 * unit, (one, other)


def test_the_operator_has_a_column(rows: dict[str, list[Row]]) -> None:
    """Wherever a row says what a correction leaves, which it makes smaller but for sizes; no verdict counts it."""
    found = [row for section in rows.values() for row in section if row.operator is not None]
    figures = Counter(row.figure for row in found)
    assert figures == {"abstract": 3, "3f": 1, "5d": 2, "5f": 2, "5i": 3, "5j": 2}
    for row in found:
        assert row.operator is not None
        if row.what.startswith("residual, ratio"):
            assert row.operator > row.ours / 0.6
        elif row.printed.unit == "times":  # sizes, of which the virtual scanner was made to follow the laws
            assert row.operator > 0.6 * row.ours
        else:
            assert row.operator < 0.6 * row.ours
        assert f"| {row.ours_text} | {row.operator_text} | {row.source} |" in PAGE.read_text(encoding="utf-8")
        assert replace(row, operator=None).verdict == row.verdict


def test_every_picture_is_drawn_and_linked(written: Path) -> None:
    linked = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", PAGE.read_text(encoding="utf-8"))
    assert linked == [f"{name}.png" for name in page.PICTURES]
    assert sorted(linked) == sorted(path.name for path in PAGE.parent.glob("*.png"))
    for name in linked:
        data = (written / name).read_bytes()
        width, height = struct.unpack(">II", data[16:24])
        assert data.startswith(b"\x89PNG\r\n\x1a\n")
        assert 500 <= width <= 1500
        assert 350 <= height <= 900
        assert b"Software" not in data
        assert struct.unpack(">II", (PAGE.parent / name).read_bytes()[16:24]) == (width, height)
        pixels = imread(written / name)[..., :3]
        assert 0.01 < float(np.mean(np.min(pixels, axis=-1) < 0.9)) < 0.5, f"{name} is blank, or black"


def test_links_lead_somewhere() -> None:
    for target, anchor in re.findall(r"[^!]\[[^\]]+\]\(([^)#]+)#?([^)]*)\)", PAGE.read_text(encoding="utf-8")):
        path = PAGE.parent / target
        assert path.exists(), target
        headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.M) if anchor else []
        slugs = [re.sub(r"[^a-z0-9 -]", "", heading.lower()).replace(" ", "-") for heading in headings]
        assert not anchor or anchor in slugs, (target, anchor)


def test_pictures_are_the_same_every_time(written: Path) -> None:
    for name in ("figure_2e", "figure_5gh"):
        assert page.png(page.PICTURES[name][1]()) == (written / f"{name}.png").read_bytes()


@pytest.mark.parametrize("section", PRINTED)
def test_every_printed_number_has_a_row(section: str, rows: dict[str, list[Row]]) -> None:
    (texts,) = [[r.printed.text for r in found] for title, found in rows.items() if title.startswith(section)]
    words = {word for text in texts for word in re.split(r"[ ,]+", text)}
    assert set(PRINTED[section].split()) <= words


def test_no_verdict_hangs_on_a_last_digit(rows: dict[str, list[Row]]) -> None:
    """Otherwise another processor could turn it."""
    for one in (r for found in rows.values() for r in found if r.printed.low != r.printed.high):
        for edge in filter(np.isfinite, (one.printed.low, one.printed.high)):
            assert abs(one.ours - edge) > 1e-5 * max(abs(edge), 1e-3), one


def test_sources_are_told_apart(rows: dict[str, list[Row]]) -> None:
    """Nothing is called a law in a section whose rows play a waveform, but what has no scanner in it."""
    every = [r for found in rows.values() for r in found]
    assert {r.source for r in every} == set(Source)
    played = [r for r in every if re.match(r"5[acdefij]\b", r.figure) and r.source is not Source.ARITHMETIC]
    assert {r.source for r in played} == {Source.IDENTIFIED, Source.SIMULATED}
    assert all(r.source is Source.LAW for r in every if r.figure in ("5b", "5g", "5h"))


# The verdict


@pytest.mark.parametrize(
    ("printed", "same", "other"),
    [
        (exact("17.7"), (17.66, 17.74), (17.64, 17.76)),
        (exact("-3.5"), (-3.46, -3.54), (-3.44, 3.5)),
        (exactly("-3"), (-3.0029, -2.9971), (-3.004, -2.996)),
        (about("25"), (22.6, 27.4), (22.4, 27.6)),
        (about("5"), (4.51, 5.49), (4.49, 5.51)),
        (about("1"), (0.51, 1.49), (0.49, 1.51)),
        (about("0.35"), (0.316, 0.384), (0.314, 0.386)),
        (about("22.3"), (22.21, 22.39), (22.19, 22.41)),
        (between("1.2", "1.3"), (1.16, 1.34), (1.14, 1.36)),
        (between("5", "10"), (4.6, 10.4), (4.4, 10.6)),
        (limits("below 2", high=2.0), (-9.0, 2.0), (2.001,)),
        (limits("more than 2", low=2.0), (2.0, 9.0), (1.999,)),
    ],
    ids=lambda p: p.text if isinstance(p, Printed) else None,
)
def test_what_counts_as_same(printed: Printed, same: tuple[float, ...], other: tuple[float, ...]) -> None:
    assert [printed.agrees(v) for v in same] == [True] * len(same)
    assert [printed.agrees(v) for v in other] == [False] * len(other)


@given(st.integers(-9999, 9999), st.integers(0, 3), st.floats(-0.49, 0.49))
def test_exact_is_rounding(digits: int, decimals: int, off: float) -> None:
    """What rounds to the printed digits is the same, and the next number is not."""
    text = f"{digits / 10**decimals:.{decimals}f}"
    unit = 10.0**-decimals
    assert exact(text).agrees(float(text) + off * unit)
    assert not exact(text).agrees(float(text) + (off + (1.0 if off >= 0 else -1.0)) * unit)


def test_reasons_are_for_rows_that_differ() -> None:
    same = Row("5g", "peak", exactly("-3", "%"), -3.0, Source.LAW)
    other = replace(same, ours=-3.3)
    assert faults([same, replace(other, why="a reason")]) == []
    assert (same.verdict, replace(other, why="a reason").verdict) == ("same", "a reason")
    (needless,) = faults([replace(same, why="a reason")])
    (missing,) = faults([other])
    (nothing,) = faults([replace(same, ours=float("nan"), why="a reason")])
    (rounded,) = faults([Row("5l", "turn", about("10", "%"), 8.98, Source.SIMULATED, "a reason")])
    assert "the same, with a reason" in needless
    assert "without a reason" in missing
    assert "no number" in nothing
    assert "show more digits" in rounded


def test_a_number_that_is_its_own_source_is_not_called_the_same() -> None:
    for source in Source:
        met = Row("5g", "peak", exactly("-3", "%"), -3.0, source)
        assert met.verdict == ("made so" if source in (Source.IDENTIFIED, Source.INPUT) else "same")
        assert replace(met, ours=-3.3, why="a reason").verdict == "a reason"


def test_the_page_begins_with_the_evidence(rows: dict[str, list[Row]]) -> None:
    """The numbers that follow from others, and how many of them agree; nothing that was put in is called the same."""
    text = PAGE.read_text(encoding="utf-8")
    first = text.split("\n## ")[1]
    evidence = [r for found in rows.values() for r in found if r.source is Source.SIMULATED]
    agree = sum(r.same for r in evidence)
    assert first.startswith(f"What is evidence: {agree} of {len(evidence)}\n")
    assert first.count("| simulation |") == len(evidence)
    assert first.count("| simulation | same |") == agree
    assert not re.search(r"\| (simulation, identified|input) \| same \|", text)
    every = sum(map(len, rows.values()))
    assert f"There are {len(evidence)} of them, of {every}; {agree} agree\n" in first


def test_the_page_refuses_a_row_without_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = [Row("5g", "peak", exactly("-3", "%"), -3.3, Source.LAW)]
    monkeypatch.setattr(page, "SECTIONS", (("title", "text", lambda: wrong, {}),))
    with pytest.raises(ValueError, match="without a reason"):
        page.page()


# Negative controls: laws that are a tenth off


def _differing(found: list[Row]) -> set[str]:
    return {f"{r.figure} {r.what}" for r in found if not r.same}


@pytest.fixture
def tenth_more(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Every beta a tenth too large."""
    for name in ("harmonic", "sinusoidal"):
        true = getattr(BranchShape, name)
        monkeypatch.setattr(BranchShape, name, lambda beta, *peak, true=true: true(1.1 * beta, *peak))
    size = SizeLaw.calibrated
    monkeypatch.setattr(SizeLaw, "calibrated", lambda k, v, beta, *more: size(k, v, 1.1 * beta, *more))
    growth = laws.beta_at
    monkeypatch.setattr(laws, "beta_at", lambda v, beta_max, rho: growth(v, 1.1 * beta_max, rho))
    gain = figure_6.frequency_gain
    monkeypatch.setattr(figure_6, "frequency_gain", lambda f, alpha, reference: gain(f, 1.1 * alpha, reference))
    yield
    monkeypatch.undo()


@pytest.mark.usefixtures("tenth_more")
@pytest.mark.parametrize("module", [figure_5_laws, figure_3, figure_5_growth, figure_6], ids=lambda m: m.__name__)
def test_a_broken_law_is_not_the_same(module: object, rows: dict[str, list[Row]]) -> None:
    broken = module.rows()  # type: ignore[attr-defined]
    title = module.TITLE  # type: ignore[attr-defined]
    lost = _differing(broken) - _differing(rows[title])
    assert lost
    assert faults(broken)
    if module is figure_5_laws:
        assert {name for name in lost if "peak residual" in name} == {
            f"{r.figure} {r.what}" for r in broken if "peak residual" in r.what
        }
    if module is figure_3:
        assert {"sec. 6 400 nm uncorrected, beta = 0.5", "sec. 6 400 nm uncorrected, beta = 1"} <= lost


# Held against something else: plain numpy, from the equations as they are printed


def _printed_17(tau: Floats, beta: float, u_peak: float) -> Floats:
    """(17) to (21) with gamma, as the paper has them."""
    u0 = u_peak - beta
    tangent = np.tan(np.pi * u0 / 2.0)
    gamma = np.pi / 2.0 * (tangent**2 - 1.0) / (tangent**2 - np.pi * tangent + 1.0)
    xi = beta / (gamma * (np.cos(np.pi * u0) + 2.0 * u0 - 1.0) + np.sin(np.pi * u0))
    wave: Floats = np.sin(np.pi * tau) + gamma * (np.cos(np.pi * tau) - 1.0)
    return (1.0 + 2.0 * xi * gamma) * tau + xi * wave


def _peak_of(u_of_tau: Callable[[Floats], Floats]) -> tuple[float, float]:
    """Where the inverse is farthest from the diagonal, by a table that is read backwards."""
    tau, u = np.linspace(0.0, 1.0, 200001), np.linspace(0.0, 1.0, 40001)
    left = np.interp(u, u_of_tau(tau), tau) - u
    i = int(np.argmax(np.abs(left)))
    return 100.0 * float(left[i]), float(u[i])


@pytest.mark.parametrize("beta", [0.03, 0.06, 0.09])
def test_peaks_of_the_sinusoidal_model(row: Callable[[str, str], Row], beta: float) -> None:
    value, at = _peak_of(lambda tau: tau + beta * np.sin(np.pi * tau))
    what = f"sinusoidal model, beta = {beta:g}"
    assert row("5b", f"{what}: peak residual").ours == pytest.approx(value, abs=1e-5)
    assert row("5b", f"{what}: at u").ours == pytest.approx(at, abs=1e-4)


@pytest.mark.parametrize(
    ("figure", "beta", "u_peak"),
    [("5g", b, 0.48) for b in (0.03, 0.06, 0.09)] + [("5h", 0.035, u) for u in (0.37, 0.5, 0.65)],
)
def test_peaks_of_the_harmonic_model(row: Callable[[str, str], Row], figure: str, beta: float, u_peak: float) -> None:
    value, at = _peak_of(lambda tau: _printed_17(tau, beta, u_peak))
    what = f"harmonic model, beta = {beta:g}, u_peak = {u_peak:g}"
    assert row(figure, f"{what}: peak residual").ours == pytest.approx(value, abs=1e-5)
    assert row(figure, f"{what}: at u").ours == pytest.approx(at, abs=1e-4)


def test_sizes_by_hand(row: Callable[[str, str], Row]) -> None:
    """(6): at 0.2 and 0.4 of v_max; 3d at a base of 0.13, from nothing to full scale with (10)."""
    for beta in (0.5, 1.0):
        expected = 200.0 * (0.4 * (1.0 + beta * 0.4)) / (0.2 * (1.0 + beta * 0.2))
        assert row("sec. 6", f"400 nm uncorrected, beta = {beta:g}").ours == pytest.approx(expected, rel=1e-12)
    per_volt = 1.0 + 0.53 * 0.13
    assert row("3d", "error of small scans").ours == pytest.approx(100.0 * (per_volt - 1.0), rel=0.01)
    full = (1.0 + 2.0 * 0.53 * 0.5) - 0.53 * 0.5**2
    assert row("3d", "error of large scans").ours == pytest.approx(100.0 * (1.0 - per_volt / full), rel=1e-9)


def test_growth_and_rate_by_hand(row: Callable[[str, str], Row]) -> None:
    expected = 3.7 * (1.0 - np.exp(-4.0 * 0.13)) / (1.0 - np.exp(-4.0))
    assert row("sec. 9", "forward at 200 nm = 13 V, (22)").ours == pytest.approx(expected, rel=1e-12)
    lattice = 17.7 / (1.0 - 0.03 * np.log10(7.3 / 0.5))
    assert row("6b", "lattice at 7.3 fps, 17.7 nm at 0.5 fps, (23)").ours == pytest.approx(lattice, rel=1e-12)


@pytest.mark.parametrize(
    ("model", "figures"), [("triangle", ("5a, 5c", "5e")), ("sinusoidal", ("5d", "5f")), ("harmonic", ("5i", "5j"))]
)
def test_played_lines_by_hand(row: Callable[[str, str], Row], model: str, figures: tuple[str, str]) -> None:
    """Residual and scaling error from displacements in the middle of ticks; the codes fill 16 bits."""
    line = measured.full_scale(model)  # type: ignore[arg-type]
    codes, moved = line.drive.codes, line.displacement_nm
    assert np.issubdtype(codes.dtype, np.integer)
    assert 0 <= codes.min() < 200 < 65300 < codes.max() <= 65535
    assert line.drive.volts == pytest.approx(codes * 100.0 / 65536.0, abs=1e-9)
    y = (moved - moved.min()) / (moved.max() - moved.min())
    half = len(y) // 2
    name = model if model == "triangle" else f"{model} model"
    for side, branch in (("forward", y[:half]), ("backward", y[half:][::-1])):
        x = (np.arange(half) + 0.5) / half
        inside = (x >= 0.1) & (x <= 0.9)
        residual = float(np.max(np.abs((branch - x)[inside])))
        chord = half // 20
        slope = (branch[chord:] - branch[:-chord]) * half / chord
        centre = x[: -chord or None] + 0.5 * chord / half
        within = (x[:-chord] >= 0.1) & (x[chord:] <= 0.9)
        scaling = 100.0 * float(np.ptp(slope[within])) / float(np.interp(0.5, centre, slope))
        assert abs(row(figures[0], f"{name}: peak residual, {side}").ours) == pytest.approx(100.0 * residual, abs=0.02)
        found = row(figures[1], f"{name}: scaling error peak to peak, {side}").ours
        assert found == pytest.approx(scaling, abs=0.2)
