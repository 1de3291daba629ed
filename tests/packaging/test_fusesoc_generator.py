"""The generator of FuseSoC: what FuseSoC plays of a scan that a user's core names, and what it refuses."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml
from building import BENCHES, NAME, REMOVED, REPOSITORY, Build
from fusesoc_project import TICKS, expected, fusesoc, played, write_bench
from installing import python, write_command
from short_scans import short
from tilted_scans import write_tilted

from tablegen import __version__

FOLDER = REPOSITORY / "firmware_templates" / "fusesoc"
GENERATOR = FOLDER / "tablegen_generator.py"
CORE = "tablegen:utils:generator"
SCAN = f"{NAME}.toml"
MODELS = ("user__bench_0", "Vtop_bench")  # of Icarus and of Verilator
INSTANCE = "generate:\n  scan: {{generator: tablegen, parameters: {}}}\n"


def scan(folder: Path, changes: dict[str, object] | None = None) -> Build:
    """Write the short scan, without limits, and return what its build plays."""
    return short(folder, {"limits": REMOVED, **(changes or {})})


def project(folder: Path, parameters: dict[str, object]) -> Path:
    """Write a core of a user with an instance of the generator, and return its file."""
    return write_bench(folder, CORE, INSTANCE.format(json.dumps(parameters)), "scan")


def run(folder: Path, target: str = "sim", *options: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run FuseSoC on the core of a folder, with the generator."""
    return fusesoc(folder, "run", "--target", target, *options, "user::bench", roots=[FOLDER], **environment)


# What it plays


@pytest.mark.rest
@pytest.mark.parametrize("target", ["sim", "sim_verilator"])
def test_a_core_that_names_a_scan_plays_the_model_of_it(tmp_path: Path, target: str) -> None:
    """On Icarus and on Verilator; a changed scan plays its own codes, an equal one compiles nothing."""
    project(tmp_path, {"scan": SCAN})
    first = scan(tmp_path)
    shutil.rmtree(tmp_path / "out")  # of the helper: the files are those that FuseSoC has made
    rows = played(run(tmp_path, target))
    assert rows == expected(first, len(rows))
    with (tmp_path / SCAN).open("a", encoding="utf-8") as file:
        file.write("\n# a comment\n")
    (model,) = (path for name in MODELS for path in (tmp_path / "build").glob(f"*/{target}/{name}"))
    compiled = model.stat().st_mtime_ns
    assert played(run(tmp_path, target)) == rows
    assert model.stat().st_mtime_ns == compiled
    second = scan(tmp_path, {"x.size_nm": 40.0, "x.table.length": 64})
    shutil.rmtree(tmp_path / "out")
    changed = played(run(tmp_path, target))
    assert changed == expected(second, len(changed))
    assert changed != rows
    assert model.stat().st_mtime_ns != compiled


@pytest.mark.rest
def test_the_core_of_the_page_plays_the_model(tmp_path: Path) -> None:
    page = (REPOSITORY / "docs" / "build_step.md").read_text("utf-8")
    (core,) = re.findall(r"^```yaml\n(CAPI=2:\n.*?)^```$", page, re.MULTILINE | re.DOTALL)
    command = "fusesoc --cores-root . run --target sim my::scanner"
    assert f"    {command}\n" in page
    built = scan(tmp_path)
    shutil.rmtree(tmp_path / "out")
    (tmp_path / SCAN).rename(tmp_path / "my_scan.toml")
    (tmp_path / "my.core").write_text(core)
    bench = (BENCHES / "top_bench.v").read_text().replace("module top_bench", "module my_scanner")
    (tmp_path / "my_scanner.v").write_text(bench.replace("TICKS = 1;", f"TICKS = {TICKS};"))
    rows = played(fusesoc(tmp_path, *command.split()[3:], roots=[FOLDER]))
    assert rows == expected(built, len(rows))


@pytest.mark.rest
def test_scans_of_one_list_share_the_modules(tmp_path: Path) -> None:
    """Two instances of the generator do not: the simulator finds each module twice."""
    first, _ = scan(tmp_path), scan(tmp_path / "other", {"name": "other"})
    other = f"other/{SCAN}"
    core = project(tmp_path, {"scan": [SCAN, other]})
    for folder in (tmp_path / "out", tmp_path / "other" / "out"):
        shutil.rmtree(folder)
    rows = played(run(tmp_path))
    assert rows == expected(first, len(rows))
    exported = tmp_path / "build" / "user__bench_0" / "sim"
    assert len(list(exported.rglob("src/**/dac_sequencer.v"))) == 1
    for name in (NAME, "other"):
        assert len(list(exported.rglob(f"src/**/{name}_top.v"))) == 1
        assert (exported / f"{name}_x.mem").is_file()
    text = core.read_text().replace("generate: [scan]", "generate: [scan, further]")
    further = f"  further: {{generator: tablegen, parameters: {{scan: {other}}}}}\n"
    core.write_text(text.replace(json.dumps([SCAN, other]), SCAN) + further)
    twice = run(tmp_path, "sim", "--clean")
    assert twice.returncode != 0
    assert "already" in twice.stdout + twice.stderr


@pytest.mark.rest
def test_an_installed_generator_runs_its_own_tablegen(wheel: Path, tmp_path: Path) -> None:
    """Of the environment where it is installed, though neither that nor another tablegen is on PATH."""
    packages = tmp_path / "venv" / "lib" / "python3" / "site-packages"
    packages.parent.mkdir(parents=True)
    shutil.unpack_archive(wheel, packages, "zip")
    program = write_command(tmp_path / "venv" / "bin", packages)
    project(tmp_path / "user", {"scan": SCAN})
    built = scan(tmp_path / "user")
    python3 = tmp_path / "path" / "python3"
    python3.parent.mkdir()
    python3.write_text(f"#!/bin/sh\nexec '{sys.executable}' \"$@\"\n")
    python3.chmod(0o755)
    folder = python(tmp_path, "-m", "tablegen", "paths", "--fusesoc", path=packages).strip()
    others = [each for each in os.environ["PATH"].split(os.pathsep) if not (Path(each) / "tablegen").exists()]
    path = os.pathsep.join([str(python3.parent), *others])
    done = fusesoc(tmp_path / "user", "run", "--target", "sim", "user::bench", roots=[Path(folder)], PATH=path)
    rows = played(done)
    assert rows == expected(built, len(rows))
    assert f"build {tmp_path / 'user' / SCAN} " in (program.parent / "log").read_text()


# What FuseSoC passes on


@pytest.mark.common
def test_what_is_refused_ends_fusesoc_with_the_file(tmp_path: Path) -> None:
    scan(tmp_path)
    core = project(tmp_path, {"scan": SCAN, "scna": SCAN})
    refused = run(tmp_path, "sim", "--setup")
    assert refused.returncode == 1
    assert f"error: {core}: generate.scan.parameters.scna: is no parameter" in refused.stderr
    assert "Failed to run generator 'scan'" in refused.stdout + refused.stderr
    project(tmp_path, {"scan": SCAN})
    assert run(tmp_path, "sim", "--setup").returncode == 0
    text = (tmp_path / SCAN).read_text("utf-8")
    (tmp_path / SCAN).write_text(text.replace("pixels = 50", "pixels = -50"), "utf-8")
    refused = run(tmp_path, "sim", "--setup")
    assert refused.returncode == 1
    number = text.splitlines().index("pixels = 50") + 1
    assert f"{tmp_path / SCAN}:{number}: timing.pixels: " in refused.stderr
    assert "Failed to run generator 'scan'" in refused.stdout + refused.stderr


@pytest.mark.common
def test_fusesoc_shows_the_parameters_and_has_the_version(tmp_path: Path) -> None:
    shown = fusesoc(tmp_path, "gen", "show", "tablegen", roots=[FOLDER])
    assert shown.returncode == 0, shown.stderr
    for parameter in ("scan", "formats", "strict"):
        assert f"\n  {parameter} " in shown.stdout
    assert f"{CORE}:{__version__}" in shown.stdout


# The script by itself


def generate(
    folder: Path,
    parameters: object,
    command: Sequence[str | Path] = (sys.executable, GENERATOR),
    environment: Mapping[str, str] | None = None,
    **more: str,
) -> subprocess.CompletedProcess[str]:
    """Run the generator as FuseSoC does, in the folder ``made``; ``more`` are parts of its input."""
    made = folder / "made"
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir(parents=True)
    content = {"files_root": str(folder), "gapi": "1.0", "parameters": parameters, "vlnv": "user::bench-scan:0", **more}
    (made / "input.yml").write_text(yaml.safe_dump(content))
    arguments = [*map(str, command), str(made / "input.yml")]
    changed = {**os.environ, **(environment or {})}
    return subprocess.run(arguments, cwd=made, env=changed, capture_output=True, text=True, check=False)


def generated(folder: Path) -> dict[str, Any]:
    """Read the core that the generator has written."""
    content: dict[str, Any] = yaml.safe_load((folder / "made" / "generated.core").read_text().removeprefix("CAPI=2:\n"))
    return content


def files_of_the_core(folder: Path) -> list[str]:
    """Return the paths of all files of it."""
    entries = [each for fileset in generated(folder)["filesets"].values() for each in fileset["files"]]
    return [each if isinstance(each, str) else next(iter(each)) for each in entries]


def manifest(folder: Path, name: str = NAME) -> dict[str, Any]:
    """Read the manifest of the build in a folder of a name."""
    content: dict[str, Any] = json.loads((folder / "made" / name / "manifest.json").read_text("ascii"))
    return content


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({}, ".scan: is missing"),
        (None, ".scan: is missing"),
        ({"scan": []}, ".scan: is missing"),
        ({"scan": 3}, ".scan: is 3, and has to be a name or a list of names"),
        ({"scan": ["a.toml", ["b.toml"]]}, ".scan: is ['a.toml', ['b.toml']], and has to be"),
        ({"scan": "absent.toml"}, ".scan: there is no file {folder}/absent.toml"),
        ({"scan": "scan.toml", "strict": "yes"}, ".strict: is 'yes', and has to be true or false"),
        ({"scan": "scan.toml", "formats": {"c": 1}}, ".formats: is {{'c': 1}}, and has to be"),
        ({"scan": "scan.toml", "formats": ["c", "fusesoc"]}, ".formats: takes no fusesoc"),
        ({"name": "x", "scan": "scan.toml"}, ".name: is no parameter of the generator tablegen; it has scan, formats"),
    ],
)
def test_parameters_are_refused_by_their_name(tmp_path: Path, parameters: object, told: str) -> None:
    (tmp_path / "scan.toml").write_text("")
    core = project(tmp_path, {"scan": "scan.toml"})
    (tmp_path / "broken.core").write_text("CAPI=2:\n- [")
    done = generate(tmp_path, parameters)
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {core}: generate.scan.parameters{told.format(folder=tmp_path)}")
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "made" / "generated.core").exists()


@pytest.mark.parametrize(
    ("vlnv", "found"),
    [
        ("user::bench-scan:0", True),
        ("user::bench-scan:1.2", True),  # the core gives no version
        ("other::bench-scan:0", False),
        ("user::bench-other:0", False),
    ],
)
def test_the_core_of_an_instance_is_found_by_its_name(tmp_path: Path, vlnv: str, found: bool) -> None:
    core = project(tmp_path, {})
    place = f"{core}: generate.scan" if found else f"{tmp_path}: generated core {vlnv}"
    assert generate(tmp_path, {}, vlnv=vlnv).stderr.startswith(f"error: {place}.parameters.scan: ")


def test_another_interface_of_fusesoc_is_refused(tmp_path: Path) -> None:
    done = generate(tmp_path, {}, gapi="2.0")
    assert done.returncode == 2
    assert "gapi '2.0' is not 1.0" in done.stderr


@pytest.mark.common
def test_further_formats_have_the_types_of_their_files(tmp_path: Path) -> None:
    scan(tmp_path)
    done = generate(tmp_path, {"scan": SCAN, "formats": ["systemverilog", "vhdl", "constraints", "csv"]})
    assert done.returncode == 0, done.stderr
    core = generated(tmp_path)
    assert core["name"] == "user::bench-scan:0"
    types = {path: each["file_type"] for entry in core["filesets"]["rtl"]["files"] for path, each in entry.items()}
    assert types.pop(f"{NAME}/{NAME}_pkg.sv") == "systemVerilogSource"
    assert types.pop(f"{NAME}/{NAME}_pkg.vhd") == "vhdlSource-2008"
    assert types.pop(f"{NAME}/{NAME}.xdc") == "xdc"
    assert f"{NAME}/dac_synchronise.v" in types
    assert set(types.values()) == {"verilogSource-2005"}
    assert {f"{NAME}/{NAME}_x.csv", f"{NAME}/{NAME}.lpf"} < set(core["filesets"]["others"]["files"])
    named = files_of_the_core(tmp_path)
    assert sorted(named) == sorted(f"{NAME}/{name}" for name in manifest(tmp_path)["files"])


@pytest.mark.common
def test_a_scan_at_an_angle_has_all_of_its_files(tmp_path: Path) -> None:
    """With the output z: the modules of the slow part, and a second top with its memories."""
    path = write_tilted(tmp_path, 30.0)
    done = generate(tmp_path, {"scan": path.name})
    assert done.returncode == 0, done.stderr
    named = files_of_the_core(tmp_path)
    assert sorted(named) == sorted(f"{path.stem}/{name}" for name in manifest(tmp_path, path.stem)["files"])
    assert {f"{path.stem}/{NAME}_z_top.v", f"{path.stem}/dac_slow_part.v", f"{path.stem}/{NAME}_z_slow.mem"} < set(
        named
    )


@pytest.mark.common
def test_the_status_of_tablegen_is_passed_on(tmp_path: Path) -> None:
    """A warning is an error with ``strict``: 3. A format that there is not is a wrong option: 2."""
    scan(tmp_path)
    done = generate(tmp_path, {"scan": SCAN})
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.startswith(f"warning: {tmp_path / SCAN}:")
    assert generate(tmp_path, {"scan": SCAN, "strict": False}).returncode == 0
    done = generate(tmp_path, {"scan": SCAN, "strict": True})
    assert done.returncode == 3
    assert not (tmp_path / "made" / "generated.core").exists()
    done = generate(tmp_path, {"scan": SCAN, "formats": "vhld"})
    assert done.returncode == 2
    assert "vhld" in done.stderr


@pytest.mark.common
def test_scans_of_one_name_are_refused(tmp_path: Path) -> None:
    """The same scan twice is no fault. Folders of scans in files of one name differ."""
    scan(tmp_path)
    scan(tmp_path / "other", {"x.size_nm": 40.0})
    core = project(tmp_path, {})
    assert generate(tmp_path, {"scan": [SCAN, SCAN]}).returncode == 0
    done = generate(tmp_path, {"scan": [SCAN, f"other/{SCAN}"]})
    assert done.returncode == 2
    told = done.stderr.splitlines()[-1]
    assert told.startswith(f"error: {core}: generate.scan.parameters.scan: {tmp_path / SCAN} and ")
    assert told.endswith(": give them different names")


def pretend(path: Path, name: str) -> None:
    """Write a program ``tablegen`` that prints a name and fails."""
    path.parent.mkdir(parents=True)
    path.write_text(f"#!/bin/sh\necho {name} runs $1; exit 7\n")
    path.chmod(0o755)


def test_tablegen_is_that_of_the_variable_then_its_own_then_that_on_path(tmp_path: Path) -> None:
    """And at last that of the interpreter, which has nothing but PyYAML here."""
    (tmp_path / SCAN).write_text("")
    own = tmp_path / "venv" / "lib" / "python3" / "site-packages" / "tablegen" / "fusesoc" / GENERATOR.name
    own.parent.mkdir(parents=True)
    shutil.copy(GENERATOR, own)
    pretend(tmp_path / "given" / "tablegen", "given")
    pretend(tmp_path / "venv" / "bin" / "tablegen", "installed")
    pretend(tmp_path / "path" / "tablegen", "found")
    module = tmp_path / "modules" / "tablegen" / "__main__.py"
    module.parent.mkdir(parents=True)
    module.write_text("import sys\nprint('module runs', sys.argv[1])\nsys.exit(7)\n")
    (tmp_path / "links").mkdir()
    (tmp_path / "links" / "yaml").symlink_to(Path(yaml.__file__).parent)

    def ran(script: Path, folder: str, *packages: str, given: str = "") -> subprocess.CompletedProcess[str]:
        paths = {"PATH": str(tmp_path / folder), "PYTHONPATH": os.pathsep.join(str(tmp_path / one) for one in packages)}
        return generate(tmp_path, {"scan": SCAN}, (sys.executable, "-S", script), {**paths, "TABLEGEN": given})

    every = ("links", "modules")
    for done, name in (
        (ran(own, "path", *every, given=f"'{tmp_path}/given/tablegen' sub"), "given runs sub"),
        (ran(own, "path", *every), "installed runs build"),
        (ran(GENERATOR, "path", *every), "found runs build"),
        (ran(GENERATOR, "empty", *every), "module runs build"),
    ):
        assert (done.returncode, done.stdout, done.stderr) == (7, f"{name}\n", ""), name
    done = ran(GENERATOR, "empty", "links")
    assert done.returncode == 2
    assert done.stderr.startswith("error: tablegen is not found: put it on PATH")
    done = ran(GENERATOR, "path", "links", given=str(tmp_path / "absent"))
    assert (done.returncode, done.stderr) == (2, f"error: {tmp_path}/absent does not run: No such file or directory\n")
    done = ran(GENERATOR, "path")
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {sys.executable} has no PyYAML: ")
