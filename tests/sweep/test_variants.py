"""Many scans of one file: what differs, how they are called, and where a fault of one of them is said to be."""

from pathlib import Path

import pytest
from editing import run, write_pair
from libraries import BASE, NAMES, write_library

from tablegen.api.many import variants
from tablegen.base.input_errors import Rejected
from tablegen.config.load import load
from tablegen.config.names import why_not_a_name


def test_every_combination_with_the_last_setting_fastest(tmp_path: Path) -> None:
    found = variants(
        write_pair(tmp_path), {"x.size_nm": [100, 150.5], "y.size_nm": (50,), "x.offset_v": range(40, 61, 20)}
    )
    sizes = [(one.setup.scan.x.size_nm, one.setup.scan.y.size_nm, one.setup.scan.x.offset_v) for one in found]
    assert sizes == [(100, 50, 40), (100, 50, 60), (150.5, 50, 40), (150.5, 50, 60)]
    assert found[2].settings == {"x.size_nm": 150.5, "y.size_nm": 50, "x.offset_v": 40}
    assert [one.setup.scan.name for one in found] == [one.name for one in found]


def test_what_was_not_set_is_that_of_the_file(tmp_path: Path) -> None:
    path = write_pair(tmp_path)
    (one,) = variants(path)
    assert one.setup.scan == load(path).scan
    assert one.settings == {}
    (other,) = variants(path, {"x.band_limit.harmonics": [21]})
    assert other.setup.scan.x.band_limit.window == load(path).scan.x.band_limit.window
    assert other.setup.scan.x.band_limit.harmonics == 21


def test_the_scans_of_a_file_have_what_differs(tmp_path: Path) -> None:
    found = variants(write_library(tmp_path))
    assert tuple(one.name for one in found) == NAMES
    base = load(write_pair(tmp_path, BASE)).scan
    narrow, broad, even = (one.setup.scan for one in found)
    assert (narrow.x.size_nm, narrow.x.offset_v, narrow.timing) == (150.0, base.x.offset_v, base.timing)
    assert (broad.x.size_nm, broad.x.offset_v, broad.timing.lines) == (400.0, 45.0, 10)
    assert (even.x.band_limit.harmonics, even.y.size_nm, even.x.band_limit.window) == (20, 300.0, (0.1, 0.9))
    assert found[2].settings == {"y.size_nm": 300.0, "x.band_limit.harmonics": 20}


def test_settings_go_over_the_scans_of_a_file(tmp_path: Path) -> None:
    found = variants(write_library(tmp_path), {"timing.settle_lines": [1, 3]})
    assert [one.name for one in found][:3] == ["narrow_settle_lines_1", "narrow_settle_lines_3", "broad_settle_lines_1"]
    assert [one.setup.scan.timing.settle_lines for one in found] == [1, 3] * 3
    assert found[2].setup.scan.x.size_nm == 400.0


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"x.size_nm": [1.5]}, "annexin_200nm_size_nm_1p5"),
        ({"x.size_nm": [-2.0]}, "annexin_200nm_size_nm_m2"),
        ({"x.size_nm": [1e-7]}, "annexin_200nm_size_nm_1em07"),
        ({"x.size_nm": [5], "y.size_nm": [7]}, "annexin_200nm_x_size_nm_5_y_size_nm_7"),
        ({"dac.coding": ["twos-complement"]}, "annexin_200nm_coding_twos_complement"),
        ({"scanner": ["../other.toml"]}, "annexin_200nm_scanner_other_toml"),
        ({"timing.line_rate_hz": [123.456], "x.size_nm": [100], "y.size_nm": [100]}, "annexin_200nm_0"),
    ],
)
def test_names_say_what_was_set_and_are_identifiers(
    tmp_path: Path, settings: dict[str, list[object]], name: str
) -> None:
    (one,) = variants(write_pair(tmp_path), settings)
    assert one.name == name
    assert why_not_a_name(name) is None


def test_a_fault_is_said_where_it_stands(tmp_path: Path) -> None:
    """At the line of the entry, at the option that set it, or at the line of the file."""
    scans = '[[scans]]\nname = "wild"\nx.size_nm = -5.0\n\n[[scans]]\nname = "tame"\n[scans.x.table]\nbits = 99\n'
    path = write_library(tmp_path, scans, BASE)
    lines = path.read_text("utf-8").splitlines()
    wild, tame = variants(path, {"timing.lines": [0]})
    for variant, text, key in ((wild, "x.size_nm = -5.0", "x.size_nm"), (tame, "bits = 99", "x.table.bits")):
        with pytest.raises(Rejected) as caught:
            assert variant.setup
        places = {problem.key: (problem.file, problem.line) for problem in caught.value.problems}
        assert places[key] == (str(path), lines.index(text) + 1)
        assert places["timing.lines"] == ("settings", 0)
        assert len(places) == 2


@pytest.mark.parametrize(
    ("scans", "why"),
    [
        ("[[scans]]\nx.size_nm = 5.0\n", "name is missing"),
        ('[[scans]]\nname = "one"\n[[scans]]\nname = "One"\n', "one name on some disks"),
        ('[[scans]]\nname = "one"\n[[scans]]\nname = "one"\n', "is the name of two scans"),
        ('[[scans]]\nname = "lines_library"\n', "is the name of the index"),
        ('[[scans]]\nname = "small"\n', "is a reserved word"),
        ('[[scans]]\nname = "one"\n[[scans.scans]]\nname = "two"\n', "holds no others"),
        ('[scans]\nname = "one"\n', "not an array of tables"),
    ],
)
def test_a_library_that_cannot_be_is_refused_as_a_whole(tmp_path: Path, scans: str, why: str) -> None:
    with pytest.raises(Rejected, match=why):
        variants(write_library(tmp_path, scans))


def test_what_is_set_takes_the_place_of_what_says_the_same(tmp_path: Path) -> None:
    """In the words of `tablegen init`, whose y is like x, and in those of axes."""
    assert run("init", tmp_path).status == 0
    path = tmp_path / "annexin_200nm.toml"
    (size,) = variants(path, {"x.size_nm": [150]})
    assert (size.setup.scan.x.size_nm, size.setup.scan.y.size_nm) == (150, 150)
    (image,) = variants(path, {"image_um": [0.1], "timing.frame_rate_hz": [1.0], "x.offset_nm": [400]})
    assert "image_nm" not in image.values
    assert image.setup.scan.x.offset_v is None
    (written,) = variants(write_pair(tmp_path, BASE), {"image_nm": [120]})
    assert "size_nm" not in written.values["x"]
    assert "size_nm" not in written.values["y"]
    (both,) = variants(path, {"image_nm": [120], "x.size_nm": [150]})
    with pytest.raises(Rejected):
        assert both.setup, "what is set twice is not chosen between"


@pytest.mark.parametrize("key", ["name", "scans"])
def test_names_are_not_set(tmp_path: Path, key: str) -> None:
    with pytest.raises(Rejected, match="names follow from what is"):
        variants(write_pair(tmp_path), {key: ["one", "two"]})


def test_a_text_is_no_list_of_values(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"\['window'\]"):
        variants(write_pair(tmp_path), {"x.band_limit.method": "window"})


@pytest.mark.parametrize("command", ["build", "show", "check"])
def test_commands_of_one_scan_say_what_a_library_is(tmp_path: Path, command: str) -> None:
    path = write_library(tmp_path)
    done = run(command, path)
    line = next(at for at, text in enumerate(path.read_text("utf-8").splitlines(), 1) if text == "[[scans]]")
    assert done.status == 2
    why = "this file is a library of scans; `tablegen sweep` builds them, each into a directory of its own"
    assert done.messages == [f"{path}:{line}: scans: {why}"]


def test_unknown_keys_of_an_entry_are_faults(tmp_path: Path) -> None:
    (one,) = variants(write_library(tmp_path, '[[scans]]\nname = "one"\nx.size_mm = 5.0\n'))
    with pytest.raises(Rejected, match=r"x\.size_mm: unknown"):
        assert one.setup
