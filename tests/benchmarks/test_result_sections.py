"""What sections of the results are made of: splines, searches, inputs of like size, what tools print; and rows."""

from pathlib import Path

import numpy as np
import pytest
from result_rows import tables
from scaling import SECTION_8, worst
from sections import planning, startup, verify, waveforms
from sections import tables as table_sizes
from sections.processes import least_cpu, tool_version


def test_the_spline_is_the_line_in_its_window_and_smooth_everywhere() -> None:
    t = np.arange(1 << 14) / (1 << 14)
    place = np.where(t <= 0.5, 2.0 * t, 2.0 - 2.0 * t)
    inside = (place >= 0.1) & (place <= 0.9)
    w = waveforms.splined(SECTION_8, t)
    np.testing.assert_allclose(w[inside], SECTION_8.value(t[inside]), atol=1e-15)
    slopes = np.diff(np.append(w, w[0])) * len(t)
    bend = waveforms.splined(SECTION_8, t, 2)
    steps = np.abs(np.diff(np.append(slopes, slopes[0]))) * len(t)
    assert np.max(steps) <= 1.01 * np.max(np.abs(bend)), "a corner would be a step of thousands"
    middle = np.abs(t - 0.5) < 0.04
    np.testing.assert_allclose(bend[middle], np.gradient(np.gradient(w, t), t)[middle], rtol=1e-3)


def test_no_other_turn_has_less_mean_square_acceleration() -> None:
    """Bumps that leave the ends as they are only add to it."""
    s = (np.arange(4000) + 0.5) / 4000
    bend = waveforms.splined(SECTION_8, 0.45 + 0.1 * s, 2)
    for n in (1, 2, 3):
        bump = np.gradient(np.gradient(np.sin(np.pi * s) ** 2 * np.cos(n * np.pi * s), s), s)
        assert abs(np.mean(bend * bump)) <= 2e-3 * np.sqrt(np.mean(bend**2) * np.mean(bump**2))


@pytest.mark.common
def test_harmonics_of_the_spline_come_nearer_to_it() -> None:
    errors = [worst(SECTION_8, waveforms.spline(SECTION_8)(harmonics)) for harmonics in (32, 128, 512)]
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.parametrize("what", waveforms.METHODS)
def test_rows_of_equal_bandwidth_are_measured(what: str) -> None:
    (row,) = (row for row in tables("waveforms") if (row["compared at"], row["waveform"]) == ("bandwidth", what))
    series = waveforms.METHODS[what](int(row["harmonics"]))
    assert row["error [%]"] == f"{worst(SECTION_8, series):.2g}"
    assert row["acceleration"] == f"{series.peak_acceleration():.1f}"


def test_no_waveform_of_the_page_is_gentler_than_the_optimum() -> None:
    ratios = [float(row["over least"]) for row in tables("waveforms") if row["over least"]]
    assert len(ratios) >= 20
    assert min(ratios) >= 0.99


@pytest.mark.common
def test_the_smallest_tables_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Against all tables, one by one; and a table of the page is within its bound, a smaller one is not."""
    monkeypatch.setattr(table_sizes, "LENGTHS", (256, 512))
    monkeypatch.setattr(table_sizes, "BITS", range(12, 17))
    found = table_sizes.smallest(tmp_path, "x", "interpolated", 1250)
    every = {
        (length * bits, length, bits): tried[1]
        for length in (256, 512)
        for bits in range(12, 17)
        if (tried := table_sizes.planned(tmp_path, "x", "interpolated", length, bits)) is not None
    }
    for bound in table_sizes.BOUNDS:
        within = [size for size, error in every.items() if error <= bound]
        assert (bound in found) == bool(within)
        if within:
            program = found[bound][0].program
            assert (len(program.words) * program.bits, len(program.words), program.bits) == min(within)
    (row,) = (row for row in tables("tables") if [*row.values()][:3] == ["x", "1", "interpolated"])
    length, bits = int(row["words"]), int(row["bits a word"])
    for fewer in (0, 1):
        tried = table_sizes.planned(tmp_path, "x", "interpolated", length, bits - fewer)
        assert tried is not None
        assert (tried[1] <= 1.0) == (fewer == 0)


def test_modes_are_those_of_the_build() -> None:
    """A mode that is new is measured by ``make bench ONLY=tables``, in seconds."""
    assert {"direct", "interpolated"} <= set(table_sizes.modes())
    shown = {row["mode"] for row in tables("tables") if not row["mode"].startswith("Fourier words")}
    assert shown == set(table_sizes.modes()), "make bench ONLY=tables"


@pytest.mark.parametrize("make", [startup.dbc, startup.rdl, startup.toml])
def test_descriptions_are_of_like_size(make: object) -> None:
    text = startup.of_size(make, 3000)  # type: ignore[arg-type]
    assert 2700 <= len(text) <= 3000


def test_commands_are_shown_without_paths() -> None:
    folder = Path("/somewhere/else")
    command = [startup.PYTHON, "-m", "tablegen", "build", str(startup.EXAMPLE), "-o", str(folder / "out")]
    shown = "`python -m tablegen build examples/annexin_200nm.toml -o build/bench/out`"
    assert startup.shown(command, folder) == shown
    other = [str(startup.OTHERS / "cantools"), "generate_c_source", str(folder / "like.dbc")]
    assert startup.shown(other, folder) == "`cantools generate_c_source build/bench/like.dbc`"


def test_what_the_batch_prints_is_read() -> None:
    shown = (
        "CPU ms, 60 builds                 min   median      max\n"
        "load                             1.00     1.50     2.00\n"
        "plan                            12.00    13.00    14.00   to reach: 5\n"
        "certify                         17.00    18.00    19.00   to reach: 15\n"
        "render                           5.00     5.40     6.00   to reach: 5\n"
        "memory: 70.1 MB after 6 builds, 71.0 MB after 65\n"
    )
    assert planning.batch_figures(shown) == pytest.approx([0.013, 0.018, 0.0054])


def test_ticks_are_those_compared_with_the_model() -> None:
    shown = (
        "x                 integer model       372182 codes       0   0  ok\n"
        "markers           integer model       372182 ticks       0   0  ok\n"
        "requests          integer model       32 states  0 differ    0  ok\n"
        "fill              integer model       372182 ticks  0 differ 0  ok\n"
        "frame             integer model       252429 ticks, multiplier blocks  0 differ 0  ok\n"
    )
    assert verify.ticks_of(shown) == 2 * 372182 + 252429


def test_versions_are_read_and_a_missing_tool_is_named() -> None:
    assert tool_version("gcc")[0].isdigit()
    with pytest.raises(FileNotFoundError, match="no_such_tool"):
        tool_version("no_such_tool")


@pytest.mark.common
def test_cpu_time_is_that_of_the_command() -> None:
    """Of two of which one computes for longer."""
    code = "sum(range({}))"
    commands = {count: [startup.PYTHON, "-c", code.format(count)] for count in ("10", "20_000_000")}
    least = least_cpu(commands, rounds=2)
    assert 2.0 * least["10"] < least["20_000_000"]
