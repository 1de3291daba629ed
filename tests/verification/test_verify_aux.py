"""A build with the second output: what is verified, what the C and the Verilog play, and faults that are found."""

import hashlib
import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from building import run_clean
from editing import run
from test_verify_tilt import ANGLE, NAME, VALID, change, edit, rows_of
from test_verify_tilt_verilog import CLOCKS, PART, SMALL, TOP, emit, memory_word
from tilted_scans import (
    AUX_NM_PER_V,
    AUX_OFFSET_V,
    AUX_X,
    AUX_Y,
    LINES,
    NM_PER_V,
    OFFSET_V,
    SIZE_NM,
    SLOPE_X,
    SLOPE_Y,
    fitted_plane,
    volts_of,
    wanted_places,
    with_aux,
    write_straight,
    write_tilted,
)

import tablegen
from tablegen.api.turned import build_turned
from tablegen.comparison.charts import comparison_charts, differing_charts
from tablegen.comparison.comparison import compared
from tablegen.device.beside import rests
from tablegen.emit.runtime_config import options_of_builds
from tablegen.emit.stored import stored_content
from tablegen.emit.turned_content import content_beside
from tablegen.html_report.page import charts_of, sections
from tablegen.html_report.subject import of_directory
from tablegen.html_report.turned_page import turned_sections
from tablegen.html_report.turned_subject import turned_directory
from tablegen.manifest.read import NotABuild, read_build
from tablegen.manifest.turned import parse_any, read_turned
from tablegen.numerics.arrays import Floats, Ints
from tablegen.verification.run import verify
from tablegen.verification.verilog.turned_play import TurnedPlay


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build of a short frame at 30 degrees with both outputs."""
    path = with_aux(write_tilted(tmp_path_factory.mktemp("tilted"), ANGLE))
    build_turned(path, path.parent / "out")
    return path.parent / "out"


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build of the same frame at 0 degrees, without an operator."""
    path = with_aux(write_straight(tmp_path_factory.mktemp("straight")))
    tablegen.build(path, path.parent / "out")
    return path.parent / "out"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build of a small frame in Verilog."""
    path = with_aux(write_straight(tmp_path_factory.mktemp("small"), *SMALL, emit(CLOCKS, "'verilog'")))
    tablegen.build(path, path.parent / "out")
    return path.parent / "out"


@pytest.mark.common
def test_a_build_with_both_outputs_is_verified(straight: Path) -> None:
    """The plane of each is compared, and every word of both sequencers."""
    report = verify(straight)
    assert report.failures == []
    assert {"z", "aux", "c z", "c, z, steps", "c, z, fills"} < {check.subject for check in report.checks}
    stored = read_build(straight)
    assert stored.program_of_z is not None
    assert not rests(stored.program_of_z)
    assert list(stored.tilts) == ["z", "aux"]
    assert "x is z here, y is aux" in (straight / f"{NAME}_z.h").read_text("ascii").replace("\n * ", " ")


@pytest.mark.common
def test_a_build_at_an_angle_with_both_outputs_is_verified(turned: Path) -> None:
    assert verify(turned).failures == []
    certificate = read_turned(turned).plain["certificate"]
    assert set(certificate["codes"]) == {"x", "y", "z", "aux"}
    assert certificate["aux"]["error_lsb"] < 1.5


def plane_lsb(codes: Ints, x_nm: Floats, y_nm: Floats, slopes: tuple[float, float], of_z: bool) -> float:
    """The largest distance in LSB of codes from a plane about the offset of z or of aux."""
    nm_per_v, offset_v = (NM_PER_V, OFFSET_V) if of_z else (AUX_NM_PER_V, AUX_OFFSET_V)
    nm = nm_per_v * (volts_of(codes) - offset_v)
    return float(np.max(np.abs(nm - slopes[0] * x_nm - slopes[1] * y_nm)) / abs(nm_per_v * 100.0 / 65536.0))


@pytest.mark.common
@pytest.mark.parametrize("angle_deg", [ANGLE, 0.0])
def test_words_of_both_outputs_are_on_their_planes(
    angle_deg: float, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """What the C plays, over places that are computed from the scan alone; planes that are exchanged are far off."""
    build: Path = request.getfixturevalue("turned" if angle_deg else "straight")
    schedule = parse_any((build / "manifest.json").read_bytes()).program.schedule
    options = [f"-D{key}={value}" for key, value in options_of_builds([build])[NAME].items()]
    program, code = tmp_path / "two_sequencers", Path(__file__).with_name("two_sequencers.c")
    own = [path for path in sorted(build.glob("*.c")) if not path.name.startswith(("dac_link", "dac_store"))]
    run_clean(["gcc", "-std=c99", "-O1", "-Wall", "-Wextra", *options, f"-I{build}", code, *own, "-o", program])
    frame = schedule.frame_ticks
    done = subprocess.run([program, str(2 * frame)], capture_output=True, text=True, check=True)
    rows = np.array([line.split() for line in done.stdout.splitlines()], dtype=np.int64)[frame:]
    assert np.array_equal(rows[:, 1] | VALID, rows[:, 2] | VALID)
    valid = (rows[:, 1] & rows[:, 2] & VALID).reshape(LINES, -1) != 0
    assert np.count_nonzero(valid) > 0.5 * frame
    line, tick = np.nonzero(valid)
    places = wanted_places(angle_deg, line, (tick + 0.5) / schedule.ticks)
    z = rows[:, 0].reshape(LINES, -1)[valid]
    aux = rows[:, 3].reshape(LINES, -1)[valid] ^ 0x8000  # twos-complement
    of_z, of_aux = (SLOPE_X, SLOPE_Y), (AUX_X, AUX_Y)
    assert plane_lsb(z, *places, of_z, True) < 1.5
    assert plane_lsb(aux, *places, of_aux, False) < 1.5
    slope_x, slope_y, centre = fitted_plane(*places, AUX_NM_PER_V * volts_of(aux))
    lsb_nm = abs(AUX_NM_PER_V) * 100.0 / 65536.0
    assert max(abs(slope_x - AUX_X), abs(slope_y - AUX_Y)) * SIZE_NM < 0.2 * lsb_nm
    assert abs(centre - AUX_NM_PER_V * AUX_OFFSET_V) < 0.2 * lsb_nm
    assert plane_lsb(aux, *places, of_z, False) > 300.0
    assert plane_lsb(z, *places, of_aux, True) > 300.0


@pytest.mark.common
@pytest.mark.parametrize(
    ("keys", "by", "says"),
    [
        (("aux", "slow", "words", 3), 1, "its plan does not match its hash"),
        (("aux", "slow", "words", 3), 1, f"{NAME}_z.c: a line is"),
        (("aux", "words", 10), 300, "aux: error_lsb of the certificate is"),
        (("aux", "certificate", "codes", "most"), 1, "aux: codes"),
        (("aux", "certificate", "error_lsb"), 0.001, "aux: error_lsb of the certificate is"),
        (("aux", "slope_x"), 0.001, "aux: fast_nm is"),
        (("aux", "offset_v"), 0.1, "aux: error_lsb of the certificate is"),
    ],
)
def test_tampering_is_found(keys: tuple[str | int, ...], by: float, says: str, straight: Path, tmp_path: Path) -> None:
    copytree(straight, tmp_path / "out")
    change(*keys, by=by)(tmp_path / "out")
    failures = verify(tmp_path / "out", "files").failures
    assert any(says in failure for failure in failures), failures
    assert not any(failure.startswith("z: ") for failure in failures), failures


def rewrite(folder: Path, what: Callable[[dict[str, object]], object]) -> None:
    """Change the manifest of a build."""
    path = folder / "manifest.json"
    plain = json.loads(path.read_text("ascii"))
    what(plain)
    path.write_text(json.dumps(plain), "ascii")


@pytest.mark.common
def test_exchanged_slopes_are_found(straight: Path, tmp_path: Path) -> None:
    """Between z and aux, where all the rest of both stays."""

    def exchange(plain: dict[str, object]) -> None:
        z, aux = plain["z"], plain["aux"]
        assert isinstance(z, dict)
        assert isinstance(aux, dict)
        for key in ("slope_x", "slope_y", "fast_nm", "slow_nm"):
            z[key], aux[key] = aux[key], z[key]

    rewrite(copytree(straight, tmp_path / "out"), exchange)
    failures = verify(tmp_path / "out", "files").failures
    for name in ("z", "aux"):
        assert any(failure.startswith(f"{name}: error_lsb of the certificate is") for failure in failures), failures


@pytest.mark.common
def test_a_manifest_that_no_second_sequencer_plays_is_damaged(straight: Path, turned: Path, tmp_path: Path) -> None:
    """aux without z, and z and aux of different converters."""
    for name, folder, read in (("straight", straight, read_build), ("turned", turned, read_turned)):
        inner = (lambda plain: plain) if name == "straight" else (lambda plain: plain["turned"])
        copy = copytree(folder, tmp_path / name)
        rewrite(copy, lambda plain, inner=inner: inner(plain).pop("z"))
        with pytest.raises(NotABuild, match="aux is the y of a sequencer whose x is z, and the scan has no z"):
            read(copy)
        copy = copytree(folder, tmp_path / f"{name} bits")
        rewrite(copy, lambda plain, inner=inner: inner(plain)["aux"]["output"].update(dac_bits=15))
        with pytest.raises(NotABuild, match=r"z and aux differ in output\.dac_bits"):
            read(copy)


@pytest.mark.rest
def test_a_changed_word_is_heard(straight: Path, turned: Path, tmp_path: Path) -> None:
    """In what the C plays of y of the second sequencer, and in nothing else that is played."""
    word = r"(_z_y_table\[\] = \{\n    (?:-?\d+, ){5})-?\d+"
    for name, folder in (("straight", straight), ("turned", turned)):
        out = copytree(folder, tmp_path / name)
        if name == "turned":
            edit(out, f"{NAME}_z.c", word, r"\g<1>77")
        else:
            text, count = re.subn(word, r"\g<1>77", (out / f"{NAME}_z.c").read_text("ascii"))
            assert count == 1
            (out / f"{NAME}_z.c").write_text(text, "ascii")
        failures = verify(out).failures
        assert any(failure.startswith("c, z, steps: y of tick") for failure in failures), failures
        assert not any(failure.startswith(("x:", "y:", "c, steps", "fill:", "program:")) for failure in failures)


def play(folder: Path, ticks: int, work: Path) -> list[str | None]:
    """Play the top of z and aux in a folder as ``verify`` does; return what its checks say."""
    beside = content_beside(stored_content(read_build(folder)))
    assert beside is not None
    return [check.failure for check in TurnedPlay(beside, ticks, ", z").checks(folder, work, "icarus")]


@pytest.mark.rest
def test_the_top_plays_both_outputs_of_the_model(small: Path, tmp_path: Path) -> None:
    """In the coding of each converter; a changed word of the table of aux, and its coding, are heard."""
    assert verify(small, "files").failures == []
    top = (small / TOP).read_text("ascii")
    assert "TWOS_COMPLEMENT(0), .LEFT_ALIGNED(0)\n    ) x_coding" in top
    assert "TWOS_COMPLEMENT(1), .LEFT_ALIGNED(0)\n    ) y_coding" in top
    assert play(small, 60, tmp_path / "work") == [None, None]
    out = copytree(small, tmp_path / "word")
    memory_word("y", 5)(out)
    assert any("at address 5 of region 2" in (failure or "") for failure in play(out, PART, tmp_path / "of_word"))
    out = copytree(small, tmp_path / "coding")
    (out / TOP).write_text(top.replace(".TWOS_COMPLEMENT(1)", ".TWOS_COMPLEMENT(0)"), "ascii")
    assert any("words 0x" in (failure or "") for failure in play(out, PART, tmp_path / "of_coding"))


@pytest.mark.common
def test_pages_and_comparison_state_the_second_output(straight: Path, turned: Path, tmp_path: Path) -> None:
    """Beside z, with charts of their own; beside another plane rows and chart of aux alone differ."""
    for parts in (sections(of_directory(straight)), turned_sections(turned_directory(turned))):
        assert {part.key for part in parts} > {"z", "aux"}
        rows = rows_of(next(part for part in parts if part.key == "aux"))
        assert rows["slope along x"][0].startswith("-0.04, ")
        assert rows["piezo"][0] == "-4 nm/V, taken as linear"
        assert {"z_frame", "aux_frame"} < charts_of(parts).keys()
    out = copytree(straight, tmp_path / "other")
    change("aux", "slope_x", by=0.01)(out)
    change("aux", "slow", "words", 3, by=40)(out)
    outcome = run("compare", straight, out, "--json")
    assert outcome.status == 1
    differing = {(row["section"], row["name"]) for row in json.loads(outcome.out)["quantities"]}
    assert {one for one in differing if one[0] != "build"} == {
        ("aux drive", "slope along x"), ("aux tables", "slow part, content"),
    }  # fmt: skip
    both = compared(straight, out)
    assert [chart.key for chart in differing_charts(comparison_charts(both))] == ["drive-aux"]


@pytest.mark.common
def test_texts_state_the_second_output(straight: Path, turned: Path) -> None:
    """The table of ``build``, what ``show`` prints, and the row and slopes of a scan at an angle."""
    says = "-0.04 of x and +0.015 of y, by -4 nm/V"
    built = tablegen.build(straight.parent / "scan.toml")
    for text in (built.summary(), built.overview(), run("show", straight.parent / "scan.toml").out):
        assert text.count(says) == 1
        assert text.count("+0.02 of x and -0.05 of y, by 5 nm/V") == 1
    assert [chart.key for chart in built.charts().charts][-2:] == ["z_frame", "aux_frame"]
    shown = run("show", turned.parent / "scan.toml").out
    assert re.search(r"\naux {6,}\S", shown), shown
    assert f"aux is {says}; within" in shown


@pytest.mark.common
def test_the_files_of_x_y_and_z_are_those_without_aux(straight: Path, tmp_path: Path) -> None:
    """But for the hash of the plan; of the second sequencer its x is as before."""
    plain = tablegen.build(write_straight(tmp_path)).files
    ours = {path.name: path.read_bytes() for path in straight.iterdir()}
    assert ours.keys() == plain.keys()
    other = {name for name in plain if ours[name] != plain[name]}
    named = {f"{NAME}{end}" for end in (".h", ".c", "_program.h", "_program.c", ".vh", "_top.v")}
    beside = {f"{NAME}_z{end}" for end in (".h", ".c", "_program.h", "_program.c")}
    assert other <= {*named, *beside, "manifest.json"}
    x_table = re.compile(rb"_z_x_table\[\] = \{[^}]*\}")
    assert x_table.findall(ours[f"{NAME}_z.c"]) == x_table.findall(plain[f"{NAME}_z.c"]) != []
    digests = json.loads(ours["manifest.json"])["files"]
    assert digests[f"{NAME}_z.c"] == hashlib.sha256(ours[f"{NAME}_z.c"]).hexdigest()
