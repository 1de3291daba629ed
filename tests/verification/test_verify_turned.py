"""``tablegen verify`` of a scan at an angle: what passes, and the tampering that is found."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import pytest
from replacing import replace
from sets import long
from turned_scans import turned_setup

from tablegen.api.turned import build_turned
from tablegen.manifest.format import content_hash
from tablegen.manifest.read import NotABuild, read_build
from tablegen.manifest.turned import read_turned
from tablegen.verification.run import verify

NAME = "annexin_200nm"


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short frame at 30 degrees."""
    folder = tmp_path_factory.mktemp("turned")
    setup = turned_setup(folder, 30.0, "timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")
    build_turned(setup, folder / "out")
    return folder / "out"


def signed(folder: Path) -> None:
    """Make hash and digests of the manifest those of what stands there."""
    path = folder / "manifest.json"
    plain = json.loads(path.read_text("ascii"))
    plain["hash"] = content_hash({key: plain[key] for key in ("name", "scanner", "sequence", "turned")})
    plain["files"] = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in plain["files"]}
    path.write_text(json.dumps(plain), "ascii")


def edit(name: str, old: str, new: str) -> Callable[[Path], None]:
    """Replace a text that stands once in a file."""

    def do(folder: Path) -> None:
        text = (folder / name).read_text("ascii")
        assert text.count(old) == 1, (name, old, text.count(old))
        (folder / name).write_text(text.replace(old, new), "ascii")

    return do


def word(*keys: str | int, by: int = 1) -> Callable[[Path], None]:
    """Change a number of the manifest."""

    def do(folder: Path) -> None:
        path = folder / "manifest.json"
        plain = place = json.loads(path.read_text("ascii"))
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] += by
        path.write_text(json.dumps(plain), "ascii")

    return do


@pytest.mark.common
def test_a_build_is_verified(build: Path) -> None:
    report = verify(build)
    assert report.failures == []
    assert [check.subject for check in report.checks][-2:] == ["c, steps", "c, fills"]
    ticks = 2 * read_turned(build).program.schedule.frame_ticks
    assert all(int(check.compared.split()[0]) > ticks for check in report.checks[-2:])


@pytest.mark.common
@pytest.mark.parametrize("shaping", long(["second"], ["first", "second"]))
def test_a_shaped_build_is_verified(shaping: str, tmp_path: Path) -> None:
    """And without its order of shaping the C is refused."""
    edits = ("timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")
    build_turned(turned_setup(tmp_path, 30.0, *edits, "dac.bits = 14", f"dac.shaping = '{shaping}'"), tmp_path / "out")
    assert verify(tmp_path / "out").failures == []
    order = read_turned(tmp_path / "out").program.y.output.shaping.order
    assert order == {"first": 1, "second": 2}[shaping]
    header = tmp_path / "out" / f"{NAME}.h"
    header.write_text(header.read_text("ascii").replace(f"_Y_SHAPING_ORDER {order}", "_Y_SHAPING_ORDER 0"), "ascii")
    assert any(failure.startswith("c, ") for failure in verify(tmp_path / "out").failures)


def test_files_alone(build: Path) -> None:
    report = verify(build, "files")
    assert report.failures == []
    assert not any(check.against == "the model" for check in report.checks)


@pytest.mark.common
def test_a_part_of_a_frame_is_named(build: Path) -> None:
    (note,) = verify(build, ticks=1000).notes
    assert note == "1000 of the 20000 ticks of a frame were played; --ticks 20000 plays them all"


X = ("turned", "axes", "x")
SECOND, RATIOS = "int8_t annexin_200nm_x_second[] = {\n    ", "int16_t annexin_200nm_y_ratios[] = {"
# What is changed, whether hash and digests are made right again, and what the report says.
TAMPERING: dict[str, tuple[Callable[[Path], None], bool, str]] = {
    "a word of C": (edit(f"{NAME}.c", SECOND, f"{SECOND}1"), True, "c files: annexin_200nm.c: a line is"),
    "a limit": (edit(f"{NAME}.h", "_X_MAX_STEP", "_X_MAX_STEP 1 + "), True, "c files: annexin_200nm.h"),
    "a file": (edit(f"{NAME}.c", RATIOS, f"{RATIOS} "), False, "stale or edited"),
    "the manifest": (word(*X, "gains", "words", 3), False, "its plan does not match its hash"),
    "a gain": (word(*X, "gains", "words", 3), True, "annexin_200nm.c: a line is"),
    "the certificate": (word("certificate", "codes", "y", "most"), True, "the certificate has"),
    "the runtime": (edit("dac_slow.c", '"dac_slow.h"', '"dac_slow.h" '), True, "dac_slow.c: is not that of tablegen"),
}


@pytest.mark.parametrize("what", TAMPERING)
def test_tampering_is_found_in_the_files(what: str, build: Path, tmp_path: Path) -> None:
    change, hidden, says = TAMPERING[what]
    copytree(build, tmp_path / "out")
    change(tmp_path / "out")
    if hidden:
        signed(tmp_path / "out")
    failures = verify(tmp_path / "out", "files").failures
    assert any(says in failure for failure in failures), failures


@pytest.mark.rest
@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        (f"{NAME}_program.c", "annexin_200nm_x_gains, ", "annexin_200nm_y_gains, "),
        (f"{NAME}_program.c", "annexin_200nm_y_ratios, ", "annexin_200nm_x_ratios, "),
        (f"{NAME}_program.c", "annexin_200nm_X_TABLE_LENGTH", ""),
    ],
)
def test_other_words_are_heard_in_what_is_played(file: str, old: str, new: str, build: Path, tmp_path: Path) -> None:
    """Whatever the files say: the C that was changed plays something else, or does not compile."""
    copytree(build, tmp_path / "out")
    text = (tmp_path / "out" / file).read_text("ascii")
    changed = text.replace(old, new) if old in text else text.replace("_X_TABLE_LENGTH + DAC", "_X_TABLE_LENGTH - DAC")
    assert changed != text
    (tmp_path / "out" / file).write_text(changed, "ascii")
    failures = verify(tmp_path / "out").failures
    assert any(failure.startswith("c") and "files" not in failure for failure in failures), failures


def test_other_targets_and_readers_say_what_it_is(build: Path) -> None:
    with pytest.raises(NotABuild, match="is a scan at an angle, which no emulator plays"):
        verify(build, "cortex-m")
    with pytest.raises(NotABuild, match="is of a scan at an angle; of the commands that read a build"):
        read_build(build)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (word("sequence", "frame_lines", by=40), "the gains reach"),
        (word("turned", "axes", "y", "output", "dac_bits", by=900), "Expected"),
        (word("sequence", "line_ticks", by=-(10**6)), "Expected"),
        (word("turned", "axes", "x", "slow", "offset_word", by=1 << 42), "does not fit"),
    ],
)
def test_a_damaged_manifest_is_refused(change: Callable[[Path], None], says: str, build: Path, tmp_path: Path) -> None:
    copytree(build, tmp_path / "out")
    change(tmp_path / "out")
    with pytest.raises(NotABuild, match=f"is damaged: .*{says}"):
        read_turned(tmp_path / "out")


def test_another_version_is_not_compared(build: Path, tmp_path: Path) -> None:
    copytree(build, tmp_path / "out")
    edit("manifest.json", '"tablegen": "0.3.0"', '"tablegen": "0.2.9"')(tmp_path / "out")
    (failure,) = verify(tmp_path / "out", "files").failures
    assert "built by tablegen 0.2.9" in failure
    assert verify(tmp_path / "out", "files", other_version=True).failures == []


def test_the_program_read_back_is_the_one_that_was_planned(build: Path) -> None:
    stored = read_turned(build)
    assert stored.own_hash == stored.manifest.hash
    assert replace(stored.manifest, files={}).name == NAME
