"""The CMSIS-Pack: read by cmsis-pack-manager, and its component compiled and played with what its description says."""

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from building import NAME, Build, run_clean
from cmsis_pack_manager.cmsis_pack_manager import ffi, lib
from editing import run, write_pair
from formatted import Formatted, check_finds_a_flip, formatted
from packed_library import MAIN, plays_the_model
from short_scans import CUBIC, short

from tablegen.version import __version__

FILE = f"tablegen.{NAME}.pdsc"
VERSION = r"\d+\.\d+\.\d+(-[0-9A-Za-z.-]+)?"  # of a component; one of Python before a release is none


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("cmsis_pack"), "short", "cmsis-pack")


def components(path: Path) -> list[dict[str, Any]]:
    """The components that cmsis-pack-manager reads in a description; none of one that it refuses."""
    index = lib.update_pdsc_index_new()
    lib.update_pdsc_index_push(index, ffi.new("char[]", str(path).encode()))
    packs = lib.parse_packs(index)
    text = lib.dumps_components(packs)
    if text == ffi.NULL:
        return []
    listed: list[dict[str, Any]] = json.loads(ffi.string(text))
    lib.cstring_free(text)
    lib.parse_packs_free(packs)
    return listed


def test_cmsis_pack_manager_reads_the_component(built: Formatted) -> None:
    (component,) = components(built.folder / FILE)
    expected = {"vendor": "tablegen", "class": "Scan", "group": "Sequencer", "version": __version__, "sub_group": None}
    assert {key: component[key] for key in expected} == expected
    c_files = {name for name in built.files if name.endswith((".c", ".h"))}
    assert c_files == set(built.files) - {FILE, "manifest.json"}
    kinds = {"c": "SourceC", "h": "Header"}
    assert {file["path"]: file["category"] for file in component["files"]} == {
        name: kinds[name.rpartition(".")[2]] for name in c_files
    }


@pytest.mark.parametrize(
    "text",
    ["<vendor>tablegen</vendor>", ' Cgroup="Sequencer"', "</component>"],
    ids=["no vendor", "no group", "no XML"],
)
def test_cmsis_pack_manager_refuses_a_description_that_is_none(built: Formatted, tmp_path: Path, text: str) -> None:
    """Negative controls: it reads the elements and attributes."""
    whole = built.files[FILE].decode("ascii")
    assert text in whole
    (tmp_path / FILE).write_text(whole.replace(text, ""), "ascii")
    assert components(tmp_path / FILE) == []


def test_cmsis_pack_manager_skips_files_of_no_category(built: Formatted, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(built.files[FILE].replace(b'"header"', b'"none"'))
    (component,) = components(tmp_path / FILE)
    assert {file["category"] for file in component["files"]} == {"SourceC"}


def test_its_names_are_those_that_the_schema_has(built: Formatted, tmp_path: Path) -> None:
    """Vendor and name make the name of the file, parts of names are short, and versions have three numbers."""
    long = short(tmp_path, {"emit.formats": ["cmsis-pack"], "name": "a" * 48})
    for content in (built.files[FILE], long.files[f"tablegen.{'a' * 48}.pdsc"]):
        package = ElementTree.fromstring(content)
        assert [child.tag for child in package] == [
            "vendor", "name", "description", "url", "releases", "taxonomy", "components"
        ]  # fmt: skip
        assert all(re.fullmatch("[A-Za-z0-9_-]+", package.findtext(key, "")) for key in ("vendor", "name"))
        (component,) = package.iter("component")
        assert re.fullmatch(VERSION, component.attrib["Cversion"])
        assert all(2 <= len(component.attrib[key]) <= 32 for key in ("Cclass", "Cgroup"))
        (release,) = package.iter("release")
        assert release.attrib == {"version": __version__}


def test_a_changed_build_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "cmsis-pack"), "cmsis-pack", [FILE])


def test_another_format_removes_the_description(tmp_path: Path) -> None:
    scan, out = write_pair(tmp_path), tmp_path / "out"
    assert run("build", scan, "-o", out, "-f", "cmsis-pack", "-q").status == 0
    assert (out / FILE).exists()
    assert run("build", scan, "-o", out, "-f", "c", "-q").status == 0
    assert not (out / FILE).exists()


def compiled(tmp_path: Path, built: Build, *, options: bool = True, without: str = "") -> Path:
    """Compile the component of a pack with a main program, as its description says; return the program."""
    (component,) = ElementTree.fromstring((built.folder / FILE).read_bytes()).iter("component")
    project = tmp_path / "project"
    project.mkdir()
    files = [(file.attrib["category"], file.attrib["name"]) for file in component.iter("file")]
    for _, name in files:
        (project / name).write_bytes((built.folder / name).read_bytes())
    (project / "Pre_Include_Global.h").write_text(component.findtext("Pre_Include_Global_h", "") * options, "ascii")
    (project / "main.c").write_text(MAIN, "ascii")
    sources = [project / name for category, name in files if category == "sourceC" and name != without]
    before = ("-include", project / "Pre_Include_Global.h", f"-I{project}")
    run_clean(["gcc", "-std=c99", "-O1", *before, project / "main.c", *sources, "-o", project / "play"])
    return project / "play"


WIDE = {"dac.bits": 18, "x.table.bits": 18, "y.table.bits": 18}


@pytest.mark.rest
@pytest.mark.parametrize(
    "changes",
    [{}, WIDE, {"dac.shaping": "second", "x.table": CUBIC}],
    ids=["16 bits", "18 bits", "shaped and cubic"],
)
def test_the_component_plays_the_model(tmp_path: Path, changes: dict[str, object]) -> None:
    built = short(tmp_path / "built", {"emit.formats": ["cmsis-pack", "verilog"], **changes})
    assert plays_the_model(compiled(tmp_path, built), built.plan.program)


@pytest.mark.rest
def test_without_its_options_a_wide_scan_does_not_compile(tmp_path: Path) -> None:
    """A negative control: the description sets the options."""
    built = short(tmp_path / "built", {"emit.formats": ["cmsis-pack"], **WIDE})
    with pytest.raises(AssertionError, match="compile_with_the_DAC_TABLE_STORAGE_BITS_of_the_table"):
        compiled(tmp_path, built, options=False)


@pytest.mark.rest
def test_a_source_that_the_component_lacks_is_missed(tmp_path: Path) -> None:
    built = short(tmp_path / "built", {"emit.formats": ["cmsis-pack"]})
    with pytest.raises(AssertionError, match="undefined reference to `dac_sequencer_init'"):
        compiled(tmp_path, built, without="dac_sequencer.c")
