"""The core of FuseSoC: its files are those of the build, and FuseSoC itself lints and plays it."""

from pathlib import Path

import pytest
import yaml
from building import NAME
from formatted import Formatted, check_finds_a_flip, formatted
from fusesoc_project import expected, fusesoc, played, write_bench
from short_scans import short

PARTS = "dac", "dac_pair"  # of the runtime, of a scan at 0 degrees


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("fusesoc"), "short", "fusesoc")


def test_its_files_are_the_verilog_of_the_build(built: Formatted) -> None:
    core = yaml.safe_load(built.file(".core"))
    assert core["name"] == f"tablegen::{NAME}"
    rtl, memories = (core["filesets"][name]["files"] for name in ("rtl", "memories"))
    needed = [yaml.safe_load(built.files[f"tablegen.{part}.core"]) for part in PARTS]
    assert core["filesets"]["rtl"]["depend"] == [each["name"] for each in needed]
    modules = [name for each in needed for name in each["filesets"]["rtl"]["files"]]
    files = [name for each in (*rtl, *memories) for name in (each if isinstance(each, dict) else [each])]
    cores = [f"{NAME}.core", *(f"tablegen.{part}.core" for part in PARTS)]
    assert sorted([*files, *modules, *cores, "manifest.json"]) == sorted(built.files)
    assert all(each == {name: {"copyto": name}} for each in memories for name in each)


def test_a_changed_name_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "fusesoc"), "fusesoc", [f"{NAME}.core"])


@pytest.mark.rest
def test_fusesoc_lints_it_and_a_core_that_depends_on_it_plays_the_model(tmp_path: Path) -> None:
    built = short(tmp_path, {"emit.formats": ["fusesoc"]})
    write_bench(tmp_path / "user", f"tablegen::{NAME}")
    linted = fusesoc(tmp_path, "run", "--target", "lint", f"tablegen::{NAME}")
    assert linted.returncode == 0, linted.stderr
    assert "%Warning" not in linted.stdout + linted.stderr
    rows = played(fusesoc(tmp_path, "run", "--target", "sim", "user::bench"))
    assert rows == expected(built, len(rows))


@pytest.mark.rest
def test_two_scans_in_one_design_share_the_modules(tmp_path: Path) -> None:
    """Cores of two builds: each module is there once. Where a core has modules of its own, Icarus finds them twice."""
    built = short(tmp_path, {"emit.formats": ["fusesoc"]})
    short(tmp_path / "other", {"emit.formats": ["fusesoc"], "name": "other"})
    bench = write_bench(tmp_path / "user", f"tablegen::{NAME}, 'tablegen::other'")
    with_other = "\n    other_top other(.clock(clock), .reset(1'b1), .tick(1'b0));\nendmodule"
    top = bench.with_name("top_bench.v")
    top.write_text(top.read_text().replace("\nendmodule", with_other, 1))
    rows = played(fusesoc(tmp_path, "run", "--target", "sim", "user::bench"))
    assert rows == expected(built, len(rows))
    other = tmp_path / "other" / "out" / "other.core"
    text = other.read_text()
    other.write_text(text.replace("      - other_top.v\n", "      - other_top.v\n      - dac_sequencer.v\n"))
    assert other.read_text() != text
    twice = fusesoc(tmp_path, "run", "--target", "sim", "--clean", "user::bench")
    assert twice.returncode != 0
    assert "already" in twice.stdout + twice.stderr


@pytest.mark.rest
def test_without_a_memory_file_fusesoc_stops(tmp_path: Path) -> None:
    built = short(tmp_path, {"emit.formats": ["fusesoc"]})
    (built.folder / f"{NAME}_x.mem").unlink()
    stopped = fusesoc(tmp_path, "run", "--target", "lint", f"tablegen::{NAME}")
    assert stopped.returncode != 0
    assert f"{NAME}_x.mem" in stopped.stdout + stopped.stderr
