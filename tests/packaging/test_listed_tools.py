"""The Makefile's lists of tools against what tests call, and the scripts that install and hide tools."""

import ast
import os
import re
import shutil
import sys
from pathlib import Path

import pytest
from building import REPOSITORY, run, run_clean, tool
from listed_tools import BASE, LIBRARIES, PROGRAMS, allowed_programs, makefile_lists, programs_of
from tool_paths import Paths

CI = REPOSITORY / ".ci"
# Folders whose tests a list is for, and what they call on the way.
CALLERS = {
    "CHECK_TOOLS": ("tests", "hdl_tests", "tablegen/verification"),
    "COMMON_TOOLS": ("tests", "hdl_tests", "tablegen/verification"),
    "HDL_TOOLS": ("hdl_tests", "tablegen/verification"),
    "FIRMWARE_TOOLS": ("tests", "tablegen/verification"),
    "TOOLS": ("tests", "hdl_tests", "tablegen/verification"),
}


def names_in(folder: str, *, rest: bool) -> set[str]:
    """Strings in the Python of a folder, and their words; without files all of whose tests are of the ``rest``."""
    names: set[str] = set()
    for path in (REPOSITORY / folder).rglob("*.py"):
        text = path.read_text("utf-8")
        if path.name in ("listed_tools.py", Path(__file__).name):
            continue
        if not rest and re.search(r"^pytestmark = pytest\.mark\.rest$", text, re.MULTILINE):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" not in node.value:
                names |= {node.value, *node.value.split()}
            elif isinstance(node, ast.Import | ast.ImportFrom):
                names.add("cocotb" if "cocotb" in ast.unparse(node) else "")
    return names


def unused(packages: frozenset[str], names: set[str]) -> set[str]:
    """Packages of which no program, and nothing of a library, is among names."""
    return {one for one in packages if not names & {*PROGRAMS.get(one, ()), LIBRARIES.get(one, one)}}


def test_the_table_has_the_packages_of_the_lists() -> None:
    lists = makefile_lists()
    assert set(CALLERS) == set(lists)
    assert frozenset().union(*lists.values()) == PROGRAMS.keys() | LIBRARIES.keys()
    assert lists["CHECK_TOOLS"] < lists["COMMON_TOOLS"] < lists["TOOLS"]


@pytest.mark.rest
@pytest.mark.parametrize("name", CALLERS)
def test_a_listed_package_is_called_by_the_tests_of_its_set(name: str) -> None:
    rest = name not in ("CHECK_TOOLS", "COMMON_TOOLS")
    names = set().union(*(names_in(folder, rest=rest) for folder in CALLERS[name]))
    text = (REPOSITORY / "Makefile").read_text("utf-8")
    names |= set(re.findall(r" OBJCACHE=(\w+) ", text))  # which compiles for Verilator
    assert unused(makefile_lists()[name], names) == set()
    assert unused(frozenset({"gfortran", *makefile_lists()[name]}), names) == {"gfortran"}


def test_a_test_finds_the_tools_of_its_set_alone() -> None:
    """This one is quick."""
    assert "gcc" in allowed_programs([], hdl=False)
    tool("gcc")
    hidden = programs_of(PROGRAMS) - allowed_programs([], hdl=False) - BASE
    assert {"ghdl", "g++", "arm-none-eabi-gcc", "yosys"} <= hidden
    assert [name for name in sorted(hidden) if shutil.which(name)] == []
    with pytest.raises(AssertionError, match=r"by the Makefile's list of this test's set: `.ci/system-packages g\+\+`"):
        tool("g++")


@pytest.mark.common
def test_a_common_test_finds_more() -> None:
    tool("g++")
    with pytest.raises(AssertionError, match="gcc-arm-none-eabi"):
        tool("arm-none-eabi-gcc")


def test_a_tool_of_no_package_is_refused() -> None:
    with pytest.raises(AssertionError, match="chmod is of no package"):
        tool("chmod")


@pytest.mark.parametrize(
    ("marks", "hdl", "present", "absent"),
    [
        ((), True, "iverilog", "g++"),
        (("common",), True, "g++", "clang"),
        (("common",), False, "clang", "yosys"),
        (("common", "rest"), False, "arm-none-eabi-gcc", None),
        (("rest",), True, "yosys", "cppcheck"),
        (("long", "common"), False, "yosys", None),
    ],
)
def test_marks_choose_the_tools(
    marks: tuple[str, ...], hdl: bool, present: str, absent: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in filter(None, (present, absent)):
        executable(tmp_path / name, "")
    monkeypatch.setenv("PATH", str(tmp_path))
    paths = Paths()
    path = paths.path(allowed_programs(marks, hdl=hdl))
    assert shutil.which(present, path=path)
    assert absent is None or shutil.which(absent, path=path) is None
    paths.remove()
    assert not [entry for entry in path.split(os.pathsep) if entry != str(tmp_path) and os.path.exists(entry)]


# The scripts of .ci, with stand-ins for what would change the machine


def executable(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n", "utf-8")
    path.chmod(0o755)
    return path


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A folder of programs that say they are root's, and note how apt-get is called."""
    executable(tmp_path / "bin" / "id", "echo 0")
    executable(tmp_path / "bin" / "apt-get", f'echo "$@" >>{tmp_path}/apt.log')
    return tmp_path


def environment(machine: Path, **settings: str) -> dict[str, str]:
    return {**os.environ, "PATH": f"{machine / 'bin'}{os.pathsep}{os.environ['PATH']}", **settings}


@pytest.mark.parametrize("shared", [False, True])
def test_libpython_is_installed_where_the_environment_has_none(machine: Path, shared: bool) -> None:
    """By the version of its Python."""
    asked = f'case "$2" in *find_libpython*) exit {int(not shared)} ;; *) echo libpython3.99 ;; esac'
    python = executable(machine / "python", asked)
    settings = environment(machine, ENVIRONMENT_PYTHON=str(python))
    done = run([CI / "system-packages", "sh", "libpython"], environment=settings)
    log = machine / "apt.log"
    assert done.returncode == 0
    installed = [] if shared else ["-qq update", "-qq install --no-install-recommends -y libpython3.99"]
    assert (log.read_text("utf-8").splitlines() if log.exists() else []) == installed


def test_this_environment_has_its_libpython(machine: Path) -> None:
    done = run(
        [CI / "system-packages", "libpython"], environment=environment(machine, ENVIRONMENT_PYTHON=sys.executable)
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert not (machine / "apt.log").exists()


@pytest.mark.common
def test_links_lead_to_the_listed_programs_alone(tmp_path: Path) -> None:
    folder = tmp_path / "links"
    assert run_clean([sys.executable, CI / "listed-tools", folder, "gcc", "no-such-package"]).strip() == str(folder)
    names = set(os.listdir(folder))
    assert {"gcc", "cc", "as", "ld", "sh", "sed", "tar", "dpkg", "apt-get"} <= names
    assert names & {"iverilog", "g++", "clang", "cmake", "node", "python"} == set()
    assert run([folder / "cc", "--version"], environment={"PATH": str(folder)}).returncode == 0


@pytest.mark.common
def test_ci_runs_both_sets_with_the_listed_programs_alone(machine: Path) -> None:
    shutil.copytree(CI, machine / ".ci")
    executable(machine / ".ci" / "system-packages", "")
    log = machine / "make.log"
    executable(
        machine / "bin" / "make", f'[ "$1" != --silent ] && echo "$1 $PYTHON $PATH" >>{log} || echo git gcc python3'
    )
    made = machine / "build" / "tools"
    executable(machine / "bin" / "gcc", "")  # what a machine has by hand is linked by its listed name
    # the stand-in for make is no program of a package: it stands in the folders of links by hand
    executable(machine / ".ci" / "listed-tools", "")
    (machine / ".ci" / "listed-tools").write_text(
        (CI / "listed-tools")
        .read_text("utf-8")
        .replace("    for name in listed:", '    for name in (*listed, "make"):')
    )
    done = run(["bash", machine / ".ci" / "run"], environment=environment(machine))
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"CI took 0 min \d\d s: \d\d min \d\d s below 40 minutes", done.stdout.splitlines()[-1])
    python = "/usr/bin/python3" if os.path.exists("/usr/bin/python3") else ""
    assert log.read_text("utf-8").splitlines() == [f"{name} {python} {made / name}" for name in ("test", "test-rest")]


@pytest.mark.parametrize(
    ("user", "programs", "reason"),
    [
        ("1000", (), "debootstrap and chroot need root"),
        ("0", ("unshare",), "debootstrap is not installed: apt-get install debootstrap"),
        ("0", ("unshare", "debootstrap"), "is there already, and was not made by this program"),
    ],
)
def test_where_there_can_be_no_bare_debian_the_reason_is_said(
    tmp_path: Path, user: str, programs: tuple[str, ...], reason: str
) -> None:
    """A folder of the user's is not removed."""
    (tmp_path / "root").mkdir()
    (tmp_path / "root" / "precious").touch()
    for name in ("sh", "git", "dirname", "env", "awk", "sed", "sort", "make", "tr"):
        path = shutil.which(name)
        assert path is not None
        executable(tmp_path / "bin" / name, f'exec {path} "$@"')
    executable(tmp_path / "bin" / "id", f"echo {user}")
    codename = '. /etc/os-release; echo "$ID|http://a.mirror/ $VERSION_CODENAME main"'
    executable(tmp_path / "bin" / "apt-get", codename)
    for name in programs:
        executable(tmp_path / "bin" / name, "")
    done = run([CI / "bare-debian", tmp_path / "root"], environment={"PATH": str(tmp_path / "bin")})
    assert done.returncode == 1
    assert done.stderr.startswith("no bare Debian: ")
    assert reason in done.stderr
    assert (tmp_path / "root" / "precious").exists()
