"""``tablegen build --depfile``: what stands in it, whether make and Ninja read it so, and when it is there at all."""

import json
import os
import time
from pathlib import Path

import pytest
from building import run as run_tool
from editing import SCAN, SCANNER, edited, run, write_pair
from installing import python

from tablegen.api import build as module
from tablegen.base.resources import resource_folder
from tablegen.config.schema import DEFAULT_FORMATS
from tablegen.emit.depfile import deciding_files, depfile, why_unsafe

# What a file may have in its name and make can take.
NAMES = [
    "plain",
    "a b",
    "a  b",
    "a#b",
    "a$b",
    "a$$b",
    "a\\b",
    "a\\ b",
    "a:b",
    "d/a~b",
    "ä,b",
    "a!(b){c}@d+e]f",
    "$(x) b",
    "-b",
    ".b",
    "(b",
    "export x",
]
# What none can have: what make would run or take for a pattern or an assignment, and what Ninja cannot read.
UNSAFE = [
    *(f"a{character}b" for character in "\"%&'*;<=>?[^`|\n\t\r\v\x01\x7f"),
    *("a\\#b", "a\\$b", "a\\:b", "a\\", "a:", "a ", "a(b)", "~b", ".PHONY", ".SILENT", ".c", ".c.o"),
]
# Builds a scan, and prints what of the file system and of the package it has read.
WATCHED = """
import json, sys
opened = []
sys.addaudithook(lambda event, what: opened.append(what[0]) if event == "open" else None)
from tablegen.cli import cli
cli.main(["build", *sys.argv[1:], "--quiet"], standalone_mode=False)
modules = [module.__file__ for name, module in sys.modules.items() if name.split(".")[0] == "tablegen"]
print(json.dumps([[str(name) for name in opened if not isinstance(name, int)], modules]))
"""


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """The shipped pair, in a folder of its own."""
    return write_pair(tmp_path)


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """A scan on a scanner whose axes have measured responses."""
    for axis in "xy":
        (tmp_path / f"{axis}.csv").write_text("hz,gain,phase_deg\n1,1,0\n40e3,1.2,-5\n90e3,1.1,-90\n", "ascii")
    resonances = [f"+ [{axis}.resonance]\nresponse = '{axis}.csv'" for axis in "xy"]
    return write_pair(tmp_path, SCAN, edited(SCANNER, "- [x.resonance]", *resonances))


def names(file: Path) -> tuple[str, list[str], list[str]]:
    """Target, prerequisites and targets without a rule of a dependency file in which nothing is escaped."""
    rule, *others = file.read_text("utf-8").replace(" \\\n", "").split("\n\n")
    target, prerequisites = rule.split(":", 1)
    return target, prerequisites.split(), [other.strip().removesuffix(":") for other in others]


# The format


def test_it_is_a_rule_and_a_target_for_each_prerequisite() -> None:
    written = depfile("out", [Path("a.toml"), Path("b c.toml")])
    assert written == b"out: \\\n a.toml \\\n b\\ c.toml\n\na.toml:\n\nb\\ c.toml:\n"


def makes(folder: Path, target: str, prerequisite: str) -> bool:
    """Whether make finds the target out of date, by the dependency file with a recipe; then it is made."""
    rule, others = depfile(target, [Path(prerequisite)]).split(b"\n\n", 1)
    (folder / "Makefile").write_bytes(rule + b'\n\t@echo made; : > "$$TARGET"\n\n' + others)
    done = run_tool(["make"], folder, {**os.environ, "TARGET": target, "MAKEFLAGS": ""})
    assert (done.returncode, done.stderr) == (0, "")
    return "made" in done.stdout


@pytest.mark.common
@pytest.mark.parametrize("name", NAMES)
def test_make_reads_every_name_as_it_is(tmp_path: Path, name: str) -> None:
    """A target is made again when its prerequisite is newer, and when that is gone, and at no other time."""
    (tmp_path / "d").mkdir()
    assert why_unsafe(name) is None
    for target, prerequisite in (("out", name), *([] if name.startswith(".") else [(name, "in")])):
        file = tmp_path / prerequisite
        file.touch()
        assert [makes(tmp_path, target, prerequisite) for _ in range(2)] == [True, False]
        os.utime(tmp_path / target, (time.time() - 10, time.time() - 10))
        assert [makes(tmp_path, target, prerequisite) for _ in range(2)] == [True, False]
        file.unlink()
        assert makes(tmp_path, target, prerequisite)


@pytest.mark.common
def test_ninja_reads_every_name_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "d").mkdir()
    for name in NAMES:
        (tmp_path / name).touch()
    (tmp_path / "written.d").write_bytes(depfile("out", [Path(name) for name in NAMES]))
    (tmp_path / "build.ninja").write_text(
        "rule copy\n  command = cp written.d read.d && touch out\n  depfile = read.d\n  deps = gcc\nbuild out: copy\n",
        "ascii",
    )
    assert run_tool(["ninja"], tmp_path).returncode == 0
    listed = run_tool(["ninja", "-t", "deps", "out"], tmp_path).stdout.splitlines()
    assert [line.removeprefix("    ") for line in listed[1:] if line] == NAMES
    assert "no work to do" in run_tool(["ninja"], tmp_path).stdout


@pytest.mark.parametrize("name", UNSAFE)
def test_a_name_that_make_or_ninja_reads_otherwise_is_unsafe(name: str) -> None:
    assert why_unsafe(name) is not None


def test_make_would_run_what_stands_in_an_unsafe_name(tmp_path: Path) -> None:
    """The negative control: of a name with a semicolon, the rest is a recipe."""
    (tmp_path / "Makefile").write_bytes(depfile("out", [Path("a;echo>run;b")]).split(b"\n\n")[0] + b"\na:\n")
    run_tool(["make"], tmp_path, {**os.environ, "MAKEFLAGS": ""})
    assert (tmp_path / "run").exists()


# What stands in it


def test_it_names_what_was_read_in_a_fixed_order(measured: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the scan names it, by paths as they were given; the package after the files of the user."""
    monkeypatch.chdir(measured.parent)
    Path("scans").mkdir()
    Path("scans/scan.toml").write_text(edited(SCAN, "scanner = '../scanner.toml'"), "utf-8")
    assert run("build", "scans/scan.toml", "-o", "out", "--depfile", "deep/er/build.d").status == 0
    target, prerequisites, without_rule = names(Path("deep/er/build.d"))
    assert target == "out/manifest.json"
    own = ["scans/scan.toml", "scans/../scanner.toml", "scans/../x.csv", "scans/../y.csv"]
    assert prerequisites == [*own, *sorted(map(str, deciding_files(DEFAULT_FORMATS)))]
    assert without_rule == prerequisites
    before = Path("deep/er/build.d").read_bytes()
    assert run("build", "scans/scan.toml", "-o", "out", "--depfile", "deep/er/build.d").status == 0
    assert Path("deep/er/build.d").read_bytes() == before


def test_a_response_of_both_axes_is_named_once(measured: Path) -> None:
    scanner = measured.with_name("scanner.toml")
    scanner.write_text(scanner.read_text("utf-8").replace("'y.csv'", "'x.csv'"), "utf-8")
    run("build", measured, "-o", measured.parent / "out", "--depfile", measured.parent / "build.d")
    _, prerequisites, _ = names(measured.parent / "build.d")
    assert len(set(prerequisites)) == len(prerequisites)
    assert [name for name in prerequisites if name.endswith(".csv")] == [str(measured.parent / "x.csv")]


def test_the_target_is_what_is_asked_for(scan: Path) -> None:
    file = scan.parent / "build.d"
    run("build", scan, "-o", scan.parent / "out", "--depfile", file, "--depfile-target", "stamp")
    assert names(file)[0] == "stamp"


@pytest.mark.rest
def test_nothing_else_is_read(measured: Path, installed: Path) -> None:
    """Held against the interpreter, which tells what it opens: of the user's folder, of the templates, and modules."""
    folder = measured.parent
    shown = python(folder, "-c", WATCHED, measured, "-o", "out", "--depfile", "build.d", path=installed)
    opened, modules = json.loads(shown)
    _, listed, _ = names(folder / "build.d")
    own = {name for name in opened if Path(name).is_relative_to(folder) and Path(name).suffix in (".toml", ".csv")}
    others = {name for name in opened if Path(name).is_relative_to(folder)} - own
    assert own == {name for name in listed if not Path(name).is_relative_to(installed)}
    assert {Path(name).name.split("-")[0] for name in others if "out" not in Path(name).parts} <= {".tablegen"}
    package = installed / "tablegen"
    templates = {name for name in opened if Path(name).is_relative_to(package / "firmware_templates")}
    assert {name for name in templates if not name.endswith(".pyc")} <= set(listed)
    assert len([name for name in templates if name.endswith((".j2", ".c", ".v"))]) > 20
    outside = tuple(package / name for name in ("api", "cli", "examples", "firmware_templates"))
    deciding = [name for name in modules if not any(Path(name).is_relative_to(folder) for folder in outside)]
    assert len(deciding) > 20
    assert set(deciding) <= set(listed)


@pytest.mark.rest
def test_of_an_installation_the_record_is_named_which_has_the_version(installed: Path) -> None:
    code = "from tablegen.emit.depfile import deciding_files; print(*deciding_files(['c']), sep='\\n')"
    listed = python(installed.parent, "-c", code, path=installed).splitlines()
    (record,) = installed.glob("piezo_tablegen-*.dist-info/RECORD")
    assert [name for name in listed if "dist-info" in name] == [str(record)]


def test_what_builds_do_not_read_is_not_named() -> None:
    folders = {path.parent.name for path in deciding_files(DEFAULT_FORMATS)}
    assert {"c", "verilog", "config", "emit", "fixedpoint"} <= folders
    others = {
        "api",
        "calibration",
        "cli",
        "link",
        "verification",
        "virtual",
        "examples",
        "make",
        "cmake",
        "fusesoc",
        "__pycache__",
    }
    assert not others & folders
    assert resource_folder("firmware_templates") / "c" / "tables.h.j2" in deciding_files(DEFAULT_FORMATS)


# When it is there


@pytest.mark.common
@pytest.mark.parametrize(
    ("edit", "status"), [("dac.bits = 30", 2), ("limits.max_error_lsb = 0.1", 3), ("scanner = 'absent.toml'", 2)]
)
def test_a_build_that_fails_leaves_none(scan: Path, edit: str, status: int) -> None:
    out, file = scan.parent / "out", scan.parent / "build.d"
    assert run("build", scan, "-o", out, "--depfile", file).status == 0
    assert file.exists()
    scan.write_text(edited(SCAN, edit), "utf-8")
    for _ in range(2):
        assert run("build", scan, "-o", out, "--depfile", file).status == status
        assert not file.exists()


def test_a_build_that_cannot_write_leaves_none(scan: Path) -> None:
    out, file = scan.parent / "out", scan.parent / "build.d"
    run("build", scan, "-o", out, "--depfile", file)
    (out / "manifest.json").unlink()
    (out / "manifest.json").mkdir()
    assert run("build", scan, "-o", out, "--depfile", file).status == 4
    assert not file.exists()


def test_a_depfile_that_cannot_be_written_is_an_error(scan: Path) -> None:
    outcome = run("build", scan, "-o", scan.parent / "out", "--depfile", scan / "build.d")
    assert (outcome.status, outcome.out) == (4, "")
    assert outcome.messages == [f"{scan / 'build.d'}: {scan} is no directory"]


def test_it_is_written_anew_when_nothing_else_is(scan: Path) -> None:
    """It is the stamp that make looks at: newer than what was read, though all files were right already."""
    out, file = scan.parent / "out", scan.parent / "build.d"
    run("build", scan, "-o", out, "--depfile", file)
    before = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    scan.write_text(SCAN + "# a comment\n", "utf-8")
    assert run("build", scan, "-o", out, "--depfile", file).status == 0
    assert file.stat().st_mtime_ns > scan.stat().st_mtime_ns
    assert {path: path.stat().st_mtime_ns for path in out.iterdir()} == before


def test_a_file_that_is_edited_during_the_build_is_newer(scan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was read is no longer what stands there: the next make has to build again."""
    render = module.render_scan

    def edit_and_render(*arguments: object, **options: object) -> dict[str, bytes]:
        scan.write_text(edited(SCAN, "timing.lines = 100"), "utf-8")
        return render(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "render_scan", edit_and_render)
    file = scan.parent / "build.d"
    assert run("build", scan, "-o", scan.parent / "out", "--depfile", file).status == 0
    assert file.stat().st_mtime_ns < scan.stat().st_mtime_ns


def test_a_file_from_the_future_is_named(scan: Path) -> None:
    """With it make would never be done, since nothing that is built now can be newer."""
    scanner, file = scan.with_name("scanner.toml"), scan.parent / "build.d"
    os.utime(scanner, (time.time() + 3600, time.time() + 3600))
    outcome = run("build", scan, "-o", scan.parent / "out", "--depfile", file)
    assert outcome.status == 2
    assert outcome.err.startswith(f"{scanner}: was changed 35")
    assert outcome.err.endswith(" s in the future by its time stamp; set the clock, or touch the file\n")
    assert not file.exists()
    os.utime(scanner)
    assert run("build", scan, "-o", scan.parent / "out", "--depfile", file).status == 0


# What is refused


def test_a_file_that_is_no_depfile_is_kept(scan: Path) -> None:
    """Nothing that a slip names is removed."""
    link = scan.parent / "link.d"
    link.symlink_to(scan)
    for file, why in ((scan, "is the scan file"), (link, "is not a regular file")):
        outcome = run("build", scan, "-o", scan.parent / "out", "--depfile", file)
        assert (outcome.status, outcome.out) == (2, "")
        assert outcome.messages == [f"{file}: {why}; --depfile needs its own file"]
    assert scan.read_text("utf-8") == SCAN
    assert link.is_symlink()
    assert not (scan.parent / "out").exists()


@pytest.mark.common
@pytest.mark.parametrize("name", ["a\nb", "a\tb", "R&D"])
def test_a_path_that_no_depfile_can_name_is_refused_before_anything_is_written(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    scan = write_pair(tmp_path / name)
    outcome = run("build", scan, "-o", tmp_path / "out", "--depfile", tmp_path / "build.d")
    assert outcome.status == 2
    why = f"has {name[1]!r}, which make or Ninja does not take for a part of a name; rename it"
    assert f"{str(scan)!r}: {why}" in outcome.messages
    assert sorted(path.name for path in tmp_path.iterdir()) == [name]
    assert run("build", scan, "-o", tmp_path / "out").status == 0


@pytest.mark.parametrize("key", ["scanner", "x.resonance.response"])
def test_an_unsafe_name_is_refused_at_the_line_that_has_it(tmp_path: Path, key: str) -> None:
    name = "a;touch run;b"
    scan = write_pair(tmp_path)
    scanner = tmp_path / "scanner.toml"
    if key == "scanner":
        scanner.rename(tmp_path / name)
        scan.write_text(edited(SCAN, f"scanner = '{name}'"), "utf-8")
    else:
        (tmp_path / name).write_text("hz,gain,phase_deg\n1,1,0\n40e3,1.2,-5\n90e3,1.1,-90\n", "ascii")
        scanner.write_text(edited(SCANNER, "- [x.resonance]", f"+ [x.resonance]\nresponse = '{name}'"), "utf-8")
    document = scan if key == "scanner" else scanner
    lines = document.read_text("utf-8").splitlines()
    line = next(number for number, text in enumerate(lines, 1) if name in text)
    outcome = run("build", scan, "-o", tmp_path / "out", "--depfile", tmp_path / "build.d")
    why = "has ';', which make or Ninja does not take for a part of a name; rename it"
    assert (outcome.status, outcome.messages) == (2, [f"{document}:{line}: {key}: {str(tmp_path / name)!r} {why}"])
    assert not (tmp_path / "out").exists()


def test_an_unsafe_target_is_refused(scan: Path) -> None:
    outcome = run("build", scan, "-o", scan.parent / "out", "--depfile", scan.parent / "d", "--depfile-target", "a=b")
    assert outcome.status == 2
    assert outcome.messages == ["'a=b': has '=', which make or Ninja does not take for a part of a name; rename it"]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--depfile-target", "stamp"), "--depfile-target needs --depfile FILE"),
        (("--depfile", "build.d", "--check"), "--check cannot be used with --depfile"),
    ],
)
def test_options_that_contradict_each_other_are_wrong_usage(scan: Path, arguments: tuple[str, ...], why: str) -> None:
    outcome = run("build", scan, *arguments)
    assert outcome.status == 2
    assert outcome.messages[-1] == f"Error: {why}"
