"""``[y] like = "x"``: what y takes, what it keeps, and where faults of what it takes are told."""

import json
import tomllib
from pathlib import Path

import pytest
from editing import SCAN, SCANNER, Outcome, edited, run, write_pair
from jsonschema import Draft202012Validator

import tablegen
from tablegen.config.load import Setup

LIKE = "like = 'x'"


def with_like(text: str, own: str = "") -> str:
    """The file with a y that is like x but for ``own`` lines."""
    head = text.split("\n[y]" if "\n[y]\n" in text else "\n[y.", 1)[0]
    limits = "\n[limits]\nmax_error_lsb = 1.0\n" if "[limits]" in text else ""
    return f"{head}\n[y]\n{LIKE}\n{own}{limits}"


def spelt_out(text: str, *tables: str) -> str:
    """The file with the tables of x written once more for y."""
    head = with_like(text).split("\n[y]\n")[0]
    x = "[x" + head.split("[x", 1)[1]
    return head + "\n" + x.replace("[x", "[y") + "\n".join(tables)


def loaded(folder: Path, scan: str = SCAN, scanner: str = SCANNER) -> Setup:
    folder.mkdir(exist_ok=True)
    return tablegen.load(write_pair(folder, scan, scanner))


def test_y_like_x_is_what_x_written_twice_is(tmp_path: Path) -> None:
    short = loaded(tmp_path / "a", with_like(SCAN), with_like(SCANNER))
    long = loaded(tmp_path / "b", spelt_out(SCAN), spelt_out(SCANNER))
    for one, other in ((short.scan.y, long.scan.y), (short.scanner.y, long.scanner.y)):
        for field in other.__struct_fields__:
            assert field == "like" or getattr(one, field) == getattr(other, field), field


OWN = {  # what y writes, and what it then has not of x, and has
    "size_v = 20.0": ({"size_nm": None}, {"size_v": 20.0, "offset_v": 50.0, "turn": 0.5}),
    "offset_nm = 100.0": ({"offset_v": None}, {"offset_nm": 100.0, "size_nm": 200.0}),
    "turn = 0.9": ({}, {"turn": 0.9, "size_nm": 200.0}),
    "[y.band_limit]\ncutoff_hz = 60.0": ({"band_limit.harmonics": None}, {"band_limit.window": (0.1, 0.9)}),
    "[y.band_limit]\nharmonics = 7": ({}, {"band_limit.harmonics": 7, "band_limit.window": (0.1, 0.9)}),
    "[y.table]\nmode = 'direct'": ({"table.length": None}, {"table.bits": 16}),
}


@pytest.mark.parametrize("own", OWN)
def test_own_keys_of_y_go_before_those_of_x(tmp_path: Path, own: str) -> None:
    y = loaded(tmp_path, with_like(SCAN, own)).scan.y
    for key, expected in {**OWN[own][0], **OWN[own][1]}.items():
        value: object = y
        for part in key.split("."):
            value = getattr(value, part)
        assert value == expected, key


def test_ways_of_the_scanner_file_are_not_mixed(tmp_path: Path) -> None:
    points = ", ".join(f"{{ offset_v = {v}, apparent_nm = {nm} }}" for v, nm in ((20, 105), (50, 100), (80, 92)))
    own = f"[y.size]\nbeta = 0.6\n[y.offset]\npoints = [{points}]\n[y.hysteresis]\nmodel = 'triangle'\n"
    y = loaded(tmp_path, scanner=with_like(SCANNER, own)).scanner.y
    assert (y.size.beta, y.size.k_nm_per_v) == (0.6, 10.0)
    assert y.offset is not None
    assert (y.offset.m_minus, len(y.offset.points or [])) == (None, 3)
    assert y.hysteresis is not None
    assert y.hysteresis.model() == "triangle"
    assert y.resonance is not None
    assert y.resonance.frequency_hz == 40e3


def test_a_layer_that_was_learnt_on_x_stays_there(tmp_path: Path) -> None:
    layer = "[x.refinement]\na = [0.001]\nb = [0.0]\nv_amplitude = 20.4\nv_offset = 50.0\nrate_hz = 400.0\nturn = 0.5\n"
    layer += "window = [0.1, 0.9]\ndirections = 'both'\n"
    scan = loaded(tmp_path, with_like(SCAN.replace("[x.table]", layer + "\n[x.table]"))).scan
    assert scan.x.refinement is not None
    assert scan.y.refinement is None


def checked(folder: Path, scan: str = SCAN, scanner: str = SCANNER) -> list[str]:
    outcome: Outcome = run("check", write_pair(folder, scan, scanner))
    assert outcome.status == 2
    return outcome.err.replace(f"{folder}/", "").splitlines()


def test_a_fault_of_x_is_told_once(tmp_path: Path) -> None:
    scan = with_like(edited(SCAN, "x.turn = 1.5", "x.table.bits = 99", "x.hue = 1"), "[y.band_limit]\nharmonics = 0\n")
    assert checked(tmp_path, scan) == [
        "scan.toml:23: x.hue: unknown key; known here: band_limit, frame_refinement, motion, offset_nm, offset_um, "
        "offset_v, park_v, refinement, size_nm, size_of, size_um, size_v, table, turn",
        "scan.toml:26: x.turn: 1.5 is not below 1",
        "scan.toml:37: x.table.bits: 99 is above 24",
        "scan.toml:42: y.band_limit.harmonics: 0 is below 1",
    ]


def test_a_fault_of_y_alone_is_told_at_the_line_it_is_from(tmp_path: Path) -> None:
    """It fits x: its scanner is larger."""
    scanner = edited(SCANNER, "x.size.k_nm_per_v = 20.0")
    found = checked(tmp_path, with_like(edited(SCAN, "x.size_nm = 2000.0")), scanner)
    assert found[0].startswith("scan.toml:23: y.size_nm: 2000 nm needs 1.")
    assert found[0].endswith("fit; y has it from x.size_nm by like")


def test_a_fault_in_the_scanner_file_too(tmp_path: Path) -> None:
    scanner = with_like(edited(SCANNER, "x.size.beta = -1", "- x.offset.m_plus"), "[y.frequency]\nalpha = 9\n")
    assert checked(tmp_path, scanner=scanner) == [
        "scanner.toml:5: x.offset.m_plus: missing beside m_minus",
        "scanner.toml:10: x.size.beta: -1 is not above -0.5",
        "scanner.toml:35: y.frequency.alpha: 9 is above 0.5",
    ]


def test_like_takes_x_alone(tmp_path: Path) -> None:
    scan = SCAN.replace("[y]\n", "[y]\nlike = 'z'\n")
    assert checked(tmp_path, scan) == ["scan.toml:39: y.like: 'z' is not one of 'x'"]
    scan = SCAN.replace("[x]\n", "[x]\nlike = 'y'\n")
    assert "scan.toml:23: x.like: unknown key" in checked(tmp_path, scan)[0]


def test_the_schema_asks_nothing_of_a_y_that_is_like_x() -> None:
    schema = Draft202012Validator(json.loads(run("schema", "scanner").out))
    assert not list(schema.iter_errors(tomllib.loads(with_like(SCANNER))))
    assert list(schema.iter_errors(tomllib.loads(with_like(SCANNER).replace(LIKE, ""))))
    assert not list(Draft202012Validator(json.loads(run("schema").out)).iter_errors(tomllib.loads(with_like(SCAN))))


def test_a_calibration_of_y_reads_what_y_has_of_x_and_writes_its_own(tmp_path: Path) -> None:
    path = tmp_path / "scanner.toml"
    path.write_text(with_like(SCANNER), encoding="utf-8")
    rows = "".join(f"{hz},{1.0 - 0.02 * (i + 1)}\n" for i, hz in enumerate((10, 100, 1000, 10000)))
    (tmp_path / "f.csv").write_text("frequency_hz,gain\n" + rows, encoding="utf-8")
    done = run("calibrate", "frequency", "--axis", "y", tmp_path / "f.csv", "--scanner", path, "--write")
    assert done.status == 0, done.err
    y = tomllib.loads(path.read_text("utf-8"))["y"]
    assert y["like"] == "x"
    assert set(y) == {"like", "frequency"}
    assert tablegen.load(write_pair(tmp_path, scanner=path.read_text("utf-8"))).scanner.y.size.k_nm_per_v == 10.0
