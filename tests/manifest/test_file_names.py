"""Names of files: what a build accepts, every command that reads it back accepts too."""

import json
from pathlib import Path

import pytest
from editing import SCAN, edited, run, write_pair
from operator_files import operator_file, write_operator_scan
from replacing import replace

from tablegen.api.build import build
from tablegen.base.input_errors import Rejected
from tablegen.base.reading import Kind
from tablegen.manifest import write as writer
from tablegen.manifest.write import TooLongManifest, UnreadableManifest, require_readable

NAMES = [
    "my operator.toml",
    "operator (1).toml",
    ".operator.toml",
    "öperator.toml",
    "o'p\"e*r?a[t]o;r|.toml",
    "folder of mine/$(op)`er`.toml",
    "back\\slash\\",
    "line\nend.toml",
]


@pytest.mark.rest
@pytest.mark.parametrize("name", NAMES)
def test_an_operator_may_have_any_name(tmp_path: Path, name: str) -> None:
    scan, out = write_operator_scan(tmp_path, operator_file(), "- [limits]"), tmp_path / "out"
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / "operator.toml").rename(tmp_path / name)
    scanner = tmp_path / "scanner.toml"
    text = scanner.read_text("utf-8").replace("'operator.toml'", json.dumps(name, ensure_ascii=False))
    scanner.write_text(text, "utf-8")
    assert run("build", scan, "-o", out, "-q").status == 0
    assert list(json.loads((out / "manifest.json").read_bytes())["axes"]["x"]["drive"]["model_files"]) == [
        Path(name).name
    ]
    for command in (
        ("verify", out, "--target", "files"),
        ("report", out, "-o", tmp_path / "report.html"),
        ("upload", out, "--dry-run"),
    ):
        outcome = run(*command)
        assert outcome.status == 0, outcome.err


@pytest.mark.common
@pytest.mark.parametrize("name", NAMES)
def test_scan_scanner_response_and_output_may_have_any_name(tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    folder.mkdir(parents=True)
    scan = write_pair(folder, edited(SCAN, f"scanner = {json.dumps(name, ensure_ascii=False)}"))
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / "response").write_text("hz,gain,phase_deg\n1,1,0\n40e3,1.2,-5\n90e3,1.1,-90\n", "ascii")
    (folder / "response").rename((folder / name).parent / f"{Path(name).name}.csv")
    response = json.dumps(f"{Path(name).name}.csv", ensure_ascii=False)
    text = (folder / "scanner.toml").read_text("utf-8")
    (folder / name).write_text(edited(text, "- [x.resonance]", f"+ [x.resonance]\nresponse = {response}"), "utf-8")
    scan = scan.rename(folder / f"{Path(name).name}.scan")
    out = folder / "out"
    assert run("build", scan, "-o", out, "-q").status == 0
    assert run("build", scan, "-o", out, "--check").status == 0
    assert run("verify", out, "--target", "files").status == 0
    assert run("upload", out, "--dry-run").status == 0


def test_a_build_that_its_own_reader_refuses_is_not_written(tmp_path: Path) -> None:
    """So many lines no plan settles for."""
    built = build(write_pair(tmp_path))
    schedule = replace(built.plan.schedule, settle_lines=300)
    built.plan = replace(built.plan, schedule=schedule)
    with pytest.raises(Rejected) as refused:
        built.write(tmp_path / "out")
    assert str(refused.value).startswith(f"{tmp_path / 'scan.toml'}:1: manifest.json of this build would be refused")
    assert "$.sequence.settle_lines" in str(refused.value)
    assert not (tmp_path / "out").exists()


def test_a_manifest_that_is_too_long_is_refused_at_its_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scan = write_pair(
        tmp_path, edited(SCAN, "- x.table.length", "x.table.mode = 'direct'", "y.table.length = 1024", "- [limits]")
    )
    monkeypatch.setattr(writer, "MANIFEST_KIND", Kind("a manifest", 1 << 12))
    with pytest.raises(TooLongManifest):
        require_readable(b" " * 5000)
    with pytest.raises(UnreadableManifest):
        require_readable(b"{")
    outcome = run("build", scan, "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "x.table.mode: 'direct' takes 1250 words, and manifest.json of this build" in outcome.err
    assert not (tmp_path / "out").exists()
