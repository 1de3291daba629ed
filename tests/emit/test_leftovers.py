"""What a build no longer makes: removed if an earlier manifest lists it as it stands there, reported otherwise."""

import json
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from building import NAME
from editing import SCAN, edited, run, write_pair

from tablegen.emit.write import leftover_files, outdated_files


@pytest.fixture
def built(tmp_path: Path) -> Path:
    """A build of C and Verilog in ``out``, beside its scan."""
    assert run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-q").status == 0
    return tmp_path / "out"


def edit_manifest(folder: Path, **files: Any) -> None:
    """Let the manifest list more files."""
    manifest = json.loads((folder / "manifest.json").read_bytes())
    manifest["files"] |= files
    (folder / "manifest.json").write_text(json.dumps(manifest), "ascii")


def listed(folder: Path) -> set[str]:
    found: set[str] = set(json.loads((folder / "manifest.json").read_bytes())["files"])
    return found


def test_files_of_a_format_that_is_no_longer_chosen_are_removed(built: Path) -> None:
    before = {path.name for path in built.iterdir()}
    checked = run("build", built.parent / "scan.toml", "-o", built, "-f", "c", "--check")
    assert checked.status == 1
    assert f"{built / 'dac_axis.v'}: left over from an earlier build" in checked.out
    assert {path.name for path in built.iterdir()} == before  # --check writes nothing
    assert f"run: tablegen build {built.parent / 'scan.toml'} -o {built} -f c\n" in checked.err
    outcome = run("build", built.parent / "scan.toml", "-o", built, "-f", "c")
    assert outcome.status == 0
    after = {path.name for path in built.iterdir()}
    assert after == listed(built) | {"manifest.json"}
    assert {Path(name).suffix for name in before - after} == {".v", ".vh", ".mem"}
    assert "removed files of an earlier build: annexin_200nm.vh, " in outcome.out
    assert run("build", built.parent / "scan.toml", "-o", built, "-f", "c", "--check").status == 0


def test_files_of_another_name_are_removed(built: Path) -> None:
    scan = write_pair(built.parent, edited(SCAN, 'name = "other"'))
    assert run("build", scan, "-o", built).status == 0
    assert not any(path.name.startswith(NAME) for path in built.iterdir())
    assert (built / "other.h").exists()


def test_a_scan_that_becomes_header_only_loses_its_c_file(built: Path) -> None:
    scan = write_pair(built.parent, edited(SCAN, "+ [emit]\nheader_only = true"))
    assert run("build", scan, "-o", built).status == 0
    assert not (built / f"{NAME}.c").exists()


def test_a_module_of_an_older_runtime_is_removed(built: Path) -> None:
    (built / "dac_old.v").write_bytes(b"module dac_old; endmodule\n")
    edit_manifest(built, **{"dac_old.v": sha256(b"module dac_old; endmodule\n").hexdigest()})
    outcome = run("build", built.parent / "scan.toml", "-o", built)
    assert outcome.status == 0
    assert "removed files of an earlier build: dac_old.v" in outcome.out
    assert not (built / "dac_old.v").exists()


def test_files_of_packages_are_removed_unless_somebody_edited_them(built: Path) -> None:
    names = {"arduino": "library.properties", "platformio": "library.json", "esp-idf": "idf_component.yml"}
    formats = [word for each in names for word in ("-f", each)]
    scan = built.parent / "scan.toml"
    assert run("build", scan, "-o", built, *formats).status == 0
    assert all((built / name).exists() for name in (*names.values(), "tablegen_options.h"))
    (built / "CMakeLists.txt").write_text("# mine\n", "ascii")
    outcome = run("build", scan, "-o", built, "-f", "c")
    assert outcome.status == 0
    assert not any((built / name).exists() for name in (*names.values(), "tablegen_options.h"))
    assert outcome.messages == [
        f"note: {built}/CMakeLists.txt: left over from an earlier build, and edited since; remove it"
    ]
    assert (built / "CMakeLists.txt").read_text("ascii") == "# mine\n"


def test_a_module_that_no_manifest_lists_is_reported(built: Path) -> None:
    (built / "dac_old.v").write_bytes(b"module dac_old; endmodule\n")
    told = f"{built / 'dac_old.v'}: is not a file of this build but matches dac_*.v; remove it"
    checked = run("build", built.parent / "scan.toml", "-o", built, "--check")
    assert checked.status == 1
    assert told in checked.out
    outcome = run("build", built.parent / "scan.toml", "-o", built)
    assert outcome.status == 0
    assert outcome.messages == [f"note: {told}"]
    assert (built / "dac_old.v").exists()


def test_a_file_that_was_edited_is_reported_and_stays(built: Path) -> None:
    (built / f"{NAME}.vh").write_text("// mine\n", "ascii")
    outcome = run("build", built.parent / "scan.toml", "-o", built, "-f", "c")
    assert outcome.status == 0
    told = f"note: {built / NAME}.vh: left over from an earlier build, and edited since; remove it"
    assert outcome.messages == [told]
    assert (built / f"{NAME}.vh").read_text("ascii") == "// mine\n"


def test_files_of_somebody_else_are_neither_removed_nor_reported(built: Path) -> None:
    for name in ("main.c", "README", "mine.vh", "dac_notes.txt"):
        (built / name).write_text("mine\n", "ascii")
    assert outdated_files(built, listed(built)) == []
    assert leftover_files(built, listed(built)) == []
    assert run("build", built.parent / "scan.toml", "-o", built, "--check").status == 0


@pytest.mark.common
@pytest.mark.parametrize(
    "name",
    [
        "../precious.h",
        "sub/precious.h",
        "/precious.h",
        "..",
        ".",
        "",
        ".precious",
        "sub",
        "a\0b",
        "\ud800",
        "x" * 5000,
    ],
)
def test_a_hostile_manifest_removes_nothing(built: Path, name: str) -> None:
    content = b"precious\n"
    (built / "sub").mkdir()
    for place in (built.parent / "precious.h", built / "sub" / "precious.h", built / ".precious"):
        place.write_bytes(content)
    edit_manifest(built, **{name: sha256(content).hexdigest()})
    before = set(built.parent.rglob("*"))
    outcome = run("build", built.parent / "scan.toml", "-o", built)
    assert outcome.status == 0
    assert set(built.parent.rglob("*")) == before
    assert name not in listed(built)


@pytest.mark.common
@pytest.mark.parametrize("content", ["", "[]", "{", "3", '{"files": 3}', '{"files": {"a.h": 3}}', "[" * 100_000])
def test_a_damaged_manifest_lists_nothing(built: Path, content: str) -> None:
    (built / "manifest.json").write_text(content, "ascii")
    (built / "a.h").write_text("mine\n", "ascii")
    assert outdated_files(built, []) == []
    assert run("build", built.parent / "scan.toml", "-o", built).status == 0
    assert (built / "a.h").exists()


@pytest.mark.parametrize("kind", ["of another program", "claims a hash", "edited", "lists what no build has"])
def test_a_foreign_manifest_removes_nothing(built: Path, kind: str) -> None:
    """Only what a manifest of ours says, whose hash is that of its plan, and of it only names that a build can have."""
    for name in ("main.c", f"{NAME}_mine.h"):
        (built / name).write_text("mine\n", "ascii")
    digest = sha256(b"mine\n").hexdigest()
    own = json.loads((built / "manifest.json").read_bytes())
    files = {"main.c": digest} if kind == "lists what no build has" else {"main.c": digest, f"{NAME}_mine.h": digest}
    manifest: dict[str, Any] = {"name": "a page of the web", "files": files}
    if kind == "claims a hash":
        manifest |= {"tablegen": own["tablegen"], "hash": own["hash"], "axes": {}}
    elif kind == "edited":
        manifest = own | {"files": own["files"] | files}
        manifest["axes"]["x"]["table"]["words"][3] += 1
    elif kind == "lists what no build has":
        manifest = own | {"files": own["files"] | files}
    (built / "manifest.json").write_text(json.dumps(manifest), "ascii")
    assert run("build", built.parent / "scan.toml", "-o", built, "-q").status == 0
    assert (built / "main.c").exists()
    assert (built / f"{NAME}_mine.h").exists()


def test_a_link_is_removed_and_not_what_it_leads_to(built: Path) -> None:
    content = b"precious\n"
    (built.parent / "precious.h").write_bytes(content)
    (built / f"{NAME}_old.h").symlink_to(built.parent / "precious.h")
    edit_manifest(built, **{f"{NAME}_old.h": sha256(content).hexdigest()})
    assert run("build", built.parent / "scan.toml", "-o", built).status == 0
    assert not (built / f"{NAME}_old.h").is_symlink()
    assert (built.parent / "precious.h").read_bytes() == content


def test_the_input_is_never_removed(tmp_path: Path) -> None:
    """A manifest of somebody else lists the scan and its scanner, with their digests, beside a file of its own."""
    scan = write_pair(tmp_path)
    assert run("build", scan, "-o", tmp_path, "-q").status == 0
    (tmp_path / "annexin_200nm_old.mem").write_text("00", "ascii")
    names = (scan.name, "scanner.toml", "annexin_200nm_old.mem")
    edit_manifest(tmp_path, **{name: sha256((tmp_path / name).read_bytes()).hexdigest() for name in names})
    assert run("build", scan, "-o", tmp_path, "-q").status == 0
    assert [(tmp_path / name).exists() for name in names] == [True, True, False]
