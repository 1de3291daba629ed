"""Files in sub-folders of a build: written, verified and removed as others, and never outside the directory."""

import errno
import json
import os
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from building import NAME
from editing import run, write_pair

from tablegen.emit import write as writer
from tablegen.emit.write import CannotWrite, NoPlace, write_files

FILES = {"a.h": b"one", "zephyr/module.yml": b"two", "zephyr/deep/x.c": b"three", "manifest.json": b"four"}
MODULE = "zephyr/module.yml"


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# The writer


def test_only_what_changed_is_written(tmp_path: Path) -> None:
    assert write_files(tmp_path, FILES) == list(FILES)
    assert contents(tmp_path) == FILES
    before = (tmp_path / MODULE).stat().st_mtime_ns
    changed = {**FILES, "zephyr/deep/x.c": b"other"}
    assert write_files(tmp_path, changed) == ["zephyr/deep/x.c"]
    assert contents(tmp_path) == changed
    assert (tmp_path / MODULE).stat().st_mtime_ns == before


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "../a.h", "zephyr/../../a.h", "zephyr/../a.h", "./a.h", "zephyr//a.h", "zephyr/", "/tmp/a.h"],
)
def test_a_name_that_leads_elsewhere_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(NoPlace, match="is no name of a file in "):
        write_files(tmp_path / "out", {"a.h": b"one", name: b"two"})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        ("link", "is a symbolic link, where a directory has to go"),
        ("link to nothing", "is a symbolic link, where a directory has to go"),
        ("file", "is a file, where a directory has to go"),
        ("pipe", "is a pipe, where a directory has to go"),
    ],
)
@pytest.mark.parametrize("place", ["zephyr", "zephyr/deep"])
def test_something_else_in_place_of_a_sub_folder_is_refused(tmp_path: Path, kind: str, why: str, place: str) -> None:
    """Also where the link leads to the very files: those are somebody else's."""
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    (out / place).parent.mkdir(parents=True)
    write_files(elsewhere, FILES)
    before = contents(elsewhere)
    if kind == "file":
        (out / place).write_bytes(b"mine")
    elif kind == "pipe":
        os.mkfifo(out / place)
    else:
        (out / place).symlink_to(elsewhere / place if kind == "link" else tmp_path / "nothing")
    with pytest.raises(NoPlace, match=why):
        write_files(out, {**FILES, MODULE: b"other"})
    assert contents(elsewhere) == before
    assert not (out / "manifest.json").exists()
    assert not (tmp_path / "nothing").exists()


def test_a_directory_in_place_of_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / MODULE).mkdir(parents=True)
    with pytest.raises(CannotWrite, match=r"module\.yml: is a directory, where a file has to go"):
        write_files(tmp_path, FILES)
    assert contents(tmp_path) == {}


@pytest.mark.parametrize("fail_at", range(8))
def test_a_failure_at_any_step_leaves_what_stood(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fail_at: int) -> None:
    """The disk fills at the n-th file that is opened for writing, or the n-th rename is refused."""
    old = {"a.h": b"one", "manifest.json": b"four"}
    write_files(tmp_path, old)
    new = {name: content + b", and more" for name, content in FILES.items()}
    name, count = ("fdopen", fail_at) if fail_at < 4 else ("replace", fail_at - 4)
    real, calls = getattr(os, name), 0

    def full(*arguments: Any, **keywords: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls > count:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(*arguments, **keywords)

    monkeypatch.setattr(os, name, full)
    with pytest.raises(CannotWrite, match="No space left on device"):
        write_files(tmp_path, new)
    after = contents(tmp_path)
    assert after["manifest.json"] == old["manifest.json"]
    if fail_at <= 4:
        assert after == old
        assert not (tmp_path / "zephyr").exists()
    assert not any(path.name.startswith(".tablegen-") for path in tmp_path.rglob("*"))


def test_a_disk_that_is_full_at_a_sub_folder_leaves_what_stood(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = {"a.h": b"old", "manifest.json": b"old"}
    write_files(tmp_path, old)
    mkdir = Path.mkdir

    def full(path: Path, *arguments: Any, **keywords: Any) -> None:
        if path.name == "deep":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        mkdir(path, *arguments, **keywords)

    monkeypatch.setattr(Path, "mkdir", full)
    with pytest.raises(CannotWrite, match="No space left on device"):
        write_files(tmp_path, FILES)
    assert contents(tmp_path) == old
    assert not (tmp_path / "zephyr").exists()


def test_outdated_files_go_with_their_empty_sub_folders(tmp_path: Path) -> None:
    write_files(tmp_path, FILES)
    (tmp_path / "zephyr" / "mine.c").write_bytes(b"mine")
    write_files(tmp_path, {"manifest.json": b"other"}, [MODULE, "zephyr/deep/x.c"])
    assert contents(tmp_path) == {"a.h": b"one", "manifest.json": b"other", "zephyr/mine.c": b"mine"}
    assert not (tmp_path / "zephyr" / "deep").exists()


def test_nothing_that_a_linked_sub_folder_leads_to_is_removed(tmp_path: Path) -> None:
    elsewhere, out = tmp_path / "elsewhere", tmp_path / "out"
    write_files(elsewhere, FILES)
    write_files(out, {"manifest.json": b"four"})
    (out / "zephyr").symlink_to(elsewhere / "zephyr")
    write_files(out, {"manifest.json": b"other"}, [MODULE])
    assert contents(elsewhere) == FILES
    assert (out / "zephyr").is_symlink()


def test_sub_folders_reach_the_disk_before_the_manifest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[str] = []
    settle, replace = writer.settle, os.replace

    def settled(folder: Path) -> None:
        events.append(f"settled {folder.relative_to(tmp_path).as_posix()}")
        settle(folder)

    def renamed(old: Path, new: Path) -> None:
        events.append(new.name)
        replace(old, new)

    monkeypatch.setattr(writer, "settle", settled)
    monkeypatch.setattr(os, "replace", renamed)
    write_files(tmp_path, FILES)
    settles = ["settled zephyr/deep", "settled zephyr", "settled ."]
    assert events == ["a.h", "module.yml", "x.c", *settles, "manifest.json", *settles]


# A build


@pytest.fixture
def built(tmp_path: Path) -> Path:
    """A build whose manifest lists a file in a sub-folder, which an earlier version wrote."""
    assert run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-q").status == 0
    return tmp_path / "out"


def list_file(built: Path, name: str, content: bytes = b"two") -> None:
    """Let the manifest list a file, with the hash of its content."""
    manifest = json.loads((built / "manifest.json").read_bytes())
    manifest["files"][name] = sha256(content).hexdigest()
    (built / "manifest.json").write_text(json.dumps(manifest), "ascii")


def put(path: Path, content: bytes = b"two") -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def test_a_stale_file_of_a_package_is_removed(built: Path) -> None:
    put(built / MODULE)
    list_file(built, MODULE)
    checked = run("build", built.parent / "scan.toml", "-o", built, "--check")
    assert checked.status == 1
    assert f"{built / MODULE}: left over from an earlier build" in checked.out
    outcome = run("build", built.parent / "scan.toml", "-o", built)
    assert outcome.status == 0
    assert f"removed files of an earlier build: {MODULE}" in outcome.out
    assert not (built / "zephyr").exists()


def test_an_edited_file_of_a_package_is_reported_and_stays(built: Path) -> None:
    put(built / MODULE, b"mine")
    list_file(built, MODULE)
    outcome = run("build", built.parent / "scan.toml", "-o", built)
    assert outcome.status == 0
    assert outcome.messages == [f"note: {built / MODULE}: left over from an earlier build, and edited since; remove it"]
    assert (built / MODULE).read_bytes() == b"mine"


@pytest.mark.parametrize("name", ["dac_old/a.c", "sub/dac_old.c", "zephyr/mine.c", f"sub/{NAME}.h"])
def test_a_manifest_cannot_have_files_of_somebody_removed(built: Path, name: str) -> None:
    put(built / name)
    list_file(built, name)
    assert run("build", built.parent / "scan.toml", "-o", built, "-q").status == 0
    assert (built / name).read_bytes() == b"two"


@pytest.mark.parametrize("name", ["../precious", "zephyr/../../precious", "/precious", "zephyr//module.yml", "zephyr/"])
def test_a_manifest_whose_names_lead_elsewhere_is_damaged(built: Path, name: str) -> None:
    put(built.parent / "precious")
    list_file(built, name)
    outcome = run("verify", "--target", "files", built)
    assert outcome.status == 2
    assert "is damaged" in outcome.err
    assert run("build", built.parent / "scan.toml", "-o", built, "-q").status == 0
    assert (built.parent / "precious").exists()


def test_a_linked_sub_folder_is_neither_verified_nor_emptied(built: Path) -> None:
    elsewhere = built.parent / "elsewhere"
    put(elsewhere / "module.yml")
    (built / "zephyr").symlink_to(elsewhere)
    list_file(built, MODULE)
    outcome = run("verify", "--target", "files", built)
    assert outcome.status == 2
    assert f"{built / 'zephyr'}: is a symbolic link, where a directory of the build has to be" in outcome.err
    assert run("build", built.parent / "scan.toml", "-o", built, "-q").status == 0
    assert (elsewhere / "module.yml").exists()


def test_a_file_in_place_of_a_sub_folder_is_not_verified(built: Path) -> None:
    put(built / "zephyr")
    list_file(built, MODULE)
    outcome = run("verify", "--target", "files", built)
    assert outcome.status == 2
    assert f"{built / 'zephyr'}: is a file, where a directory of the build has to be" in outcome.err
