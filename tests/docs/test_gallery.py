"""docs/gallery.md: its table is that of the scans, each has a picture, and `tablegen verify` finds each build whole."""

import re
import sys
from pathlib import Path

import pytest
from building import REPOSITORY
from editing import run
from sets import one_of

import tablegen

DOCS = REPOSITORY / "docs"
PAGE = (DOCS / "gallery.md").read_text("utf-8")
sys.path.insert(0, str(DOCS / "figures"))
try:
    import make_gallery
finally:
    sys.path.pop(0)

pytestmark = pytest.mark.common


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(3, make_gallery.SCANS))
def test_the_table_is_what_the_scan_gives(name: str, tmp_path: Path) -> None:
    shown = [line for line in PAGE.splitlines() if line.startswith(f"| {name} |")]
    assert make_gallery.rows(name, make_gallery.SCANS[name]) == shown
    assert make_gallery.picture(name).relative_to(DOCS).as_posix() in PAGE
    assert make_gallery.picture(name).stat().st_size > 10_000
    path = make_gallery.SCANS[name].relative_to(REPOSITORY).as_posix()
    assert f"tablegen build {path} -o" in PAGE
    assert run("check", REPOSITORY / path).messages == []
    build = tablegen.build(REPOSITORY / path, tmp_path / "build")
    assert not build.warnings
    assert tablegen.verify(tmp_path / "build", "files").failures == []


def test_every_scan_of_the_folder_is_there() -> None:
    folders = {path.parent.name for path in (REPOSITORY / "examples" / "gallery").glob("*/scan.toml")}
    assert folders == set(re.findall(r"examples/gallery/(\w+)/scan\.toml\)", PAGE))
