"""The command line as its users meet it: statuses, streams, files, interruptions, full disks and closed pipes."""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from building import REPOSITORY
from editing import SCAN, SCANNER, edited, run, write_pair
from jsonschema import Draft202012Validator
from limits import PATIENCE_S
from pseudo_terminal import on_pseudo_terminal
from sets import LONG_TEST

from tablegen import __version__

COMMANDS = ("build", "sweep", "check", "show", "report", "compare", "verify", "init", "paths", "schema")
COMMANDS += ("upload", "live", "status", "readback", "park", "trigger", "clear", "ports")
COMMANDS += ("save", "slots", "select", "confirm", "delete", "play")
OWN_FILES = [
    "annexin_200nm.c",
    "annexin_200nm.h",
    "annexin_200nm.vh",
    "annexin_200nm_program.c",
    "annexin_200nm_program.h",
    "annexin_200nm_program.mem",
    "annexin_200nm_sine.mem",
    "annexin_200nm_top.v",
    "annexin_200nm_x.mem",
    "annexin_200nm_x_fourier.mem",
    "annexin_200nm_y.mem",
    "annexin_200nm_y_fourier.mem",
    "manifest.json",
]
_TEMPLATES = REPOSITORY / "firmware_templates"
RUNTIME = [path.name for path in (*_TEMPLATES.glob("*/*.[chv]"), *_TEMPLATES.glob("verilog/pair/*.v"))]
FILES = sorted(OWN_FILES + RUNTIME)


def tablegen(
    *arguments: str | Path,
    cwd: Path | None = None,
    before: Callable[[], None] | None = None,
    stdout: int | Any = subprocess.PIPE,
    **environment: str,
) -> subprocess.CompletedProcess[bytes]:
    """The command line as a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "tablegen", *map(str, arguments)],
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=subprocess.PIPE,
        cwd=cwd,
        env={**os.environ, **environment},
        preexec_fn=before,
        check=False,
        timeout=PATIENCE_S,
    )


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, hidden ones too."""
    return {path.name: path.read_bytes() for path in folder.iterdir()} if folder.exists() else {}


def stamps(folder: Path) -> dict[str, tuple[int, int]]:
    """What changes of each file when it is written again, even with the same content."""
    return {path.name: (path.stat().st_mtime_ns, path.stat().st_ino) for path in folder.iterdir()}


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """The shipped pair, in a folder of its own."""
    return write_pair(tmp_path)


# Help, version, usage


def test_help_names_every_command_and_every_exit_status() -> None:
    shown = run("--help").out
    for command in COMMANDS:
        assert re.search(rf"^  {command} +\S.*\.$", shown, re.MULTILINE), command
    statuses = "0 done|1 output is stale|2 wrong input|3 a limit|4 cannot write|5 a build|6 a simulator|130 interrupted"
    statuses += "|7 no port|8 no answer|9 refused|10 link lost|11 some scans"
    for status in statuses.split("|"):
        assert status in shown
    assert run("-h").out == shown


@pytest.mark.parametrize(
    ("command", "taught"),
    [
        ("build", ("SCAN.TOML", "--output DIR", "--check", "--quiet", "[default: build]", "tablegen build annexin")),
        ("build", ("--depfile FILE", "--depfile-target NAME", "gcc -MD -MP", "[default: DIR/manifest.json]")),
        ("check", ("SCAN.TOML", "file:line: key: why")),
        ("show", ("SCAN.TOML", "--json", "--plot [FILE]", "--no-plot", "> is forward and < is backward")),
        ("report", ("SCAN.TOML|DIR", "--output FILE", "[default: report.html]", "--verified FILE", "--svg DIR")),
        ("compare", ("A B", "--all", "--output FILE", "--json", "Exit status: 0 the same, 1 different, 2 wrong input")),
        (
            "verify",
            (
                "DIR",
                "--target [verilog|c|cortex-m|files]",
                "--sim [icarus|verilator]",
                "--ticks N",
                "--junit FILE",
                "--keep DIR",
                "tablegen verify build",
            ),
        ),
        (
            "init",
            (
                "[DIR]",
                "--force",
                "--bits N",
                "--clock HZ",
                "--tick TIME",
                "--pixels N",
                "--lines N",
                "--image-um UM",
                "--image-nm NM",
                "--line-rate HZ",
                "--frame-rate HZ",
                "--frame [flyback|up-down]",
                "--name NAME",
                "scanner.toml and annexin_200nm.toml",
                "--image-um 2 --pixels 512 --line-rate 1",
            ),
        ),
        ("schema", ("scan|scanner", "#:schema")),
    ],
)
def test_help_of_each_command_teaches_it(command: str, taught: tuple[str, ...]) -> None:
    outcome = run(command, "--help")
    for text in taught:
        assert text in " ".join(outcome.out.split())
    assert (outcome.status, outcome.err) == (0, "")
    assert max(map(len, outcome.out.splitlines())) <= 100


def test_the_version_is_printed_without_numpy() -> None:
    code = "import sys; sys.argv = ['tablegen', '--version']; from tablegen.cli import _run; s = _run()"
    modules = "'numpy jinja2 msgspec tomllib decimal cocotb cocotb_tools serial tablegen.link'.split()"
    heavy = f"sorted(set({modules}) & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", f"{code}; print(s, {heavy})"], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"tablegen {__version__}\n0 []\n"


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("build",), "Missing argument 'SCAN.TOML'"),
        (("build", "a.toml", "--colour"), "No such option"),
        (("bild", "a.toml"), "No such command"),
        (("schema", "frame"), "'frame' is not one of"),
    ],
)
def test_wrong_usage_is_status_2_with_a_usage_line(arguments: tuple[str, ...], why: str) -> None:
    outcome = run(*arguments)
    assert outcome.status == 2
    assert outcome.err.startswith("Usage: ")
    assert why in outcome.err
    assert outcome.out == ""


def test_a_missing_scan_is_named(tmp_path: Path) -> None:
    done = tablegen("check", "absent.toml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert done.stderr == b"absent.toml: cannot be read: No such file or directory\n"


# build


@pytest.mark.common
def test_a_build_writes_its_files_and_says_what_they_promise(scan: Path) -> None:
    done = tablegen("build", "scan.toml", "-o", "some/where", cwd=scan.parent)
    assert (done.returncode, done.stderr) == (0, b"")
    lines = done.stdout.decode("ascii").splitlines()
    assert [line.split(":")[0] for line in lines[:2]] == ["x", "y"]
    assert lines[4].startswith("annexin_200nm on 'hs-afm': 400 Hz lines of 1250 ticks")
    assert [line[0] for line in lines if re.match("[xy] ", line)] == ["x", "y"]
    assert lines[-1] == f"some/where: {len(OWN_FILES)} of {len(OWN_FILES)} files and the runtime dac_* written"
    out = scan.parent / "some" / "where"
    assert sorted(contents(out)) == FILES
    assert {path.stat().st_mode & 0o777 for path in out.iterdir()} == {0o666 & ~_umask()}
    manifest = json.loads((out / "manifest.json").read_bytes())
    assert sorted([*manifest["files"], "manifest.json"]) == FILES


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def test_a_second_build_touches_nothing(scan: Path) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    before = stamps(out)
    outcome = run("build", scan, "-o", out)
    assert outcome.out.splitlines()[-1] == f"{out}: {len(OWN_FILES)} files and the runtime dac_* up to date"
    assert stamps(out) == before


def test_a_build_rewrites_only_what_changed_and_keeps_what_is_not_its_own(scan: Path) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    fresh = contents(out)
    before = stamps(out)
    (out / "annexin_200nm.h").write_text("edited by hand\n", encoding="ascii")
    (out / "annexin_200nm_y.mem").unlink()
    (out / "notes.txt").write_text("mine\n", encoding="ascii")
    outcome = run("build", scan, "-o", out)
    assert outcome.out.splitlines()[-1] == f"{out}: 2 of {len(OWN_FILES)} files written"
    assert contents(out) == {**fresh, "notes.txt": b"mine\n"}
    after = stamps(out)
    assert {name for name in before if after[name] != before[name]} == {"annexin_200nm.h", "annexin_200nm_y.mem"}


def test_a_build_with_another_runtime_rewrites_the_runtime(scan: Path) -> None:
    """As after an update of tablegen; an old one is stale like any other file."""
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    fresh = contents(out)
    (out / "dac_slew.v").write_text("// older\n", encoding="ascii")
    assert run("build", scan, "-o", out, "--check").status == 1
    outcome = run("build", scan, "-o", out)
    assert outcome.out.splitlines()[-1] == f"{out}: the runtime dac_* written"
    assert contents(out) == fresh


def test_the_runtime_is_copied_byte_for_byte(scan: Path) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    assert len(RUNTIME) > 20
    modules = [name for name in OWN_FILES if name.endswith(".v")]
    assert all(name.endswith("_top.v") for name in modules)
    assert not any(name.endswith("_top.v") for name in RUNTIME)
    for name in RUNTIME:
        (source,) = (path for path in _TEMPLATES.glob(f"**/{name}") if path.parent.name != "ecp5")  # cells of a part
        assert (out / name).read_bytes() == source.read_bytes()


def test_a_quiet_build_prints_nothing(scan: Path) -> None:
    outcome = run("build", scan, "-o", scan.parent / "out", "--quiet")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")
    assert sorted(contents(scan.parent / "out")) == FILES


@pytest.mark.common
def test_the_default_directory_is_build(scan: Path) -> None:
    assert tablegen("build", "scan.toml", "-q", cwd=scan.parent).returncode == 0
    assert sorted(contents(scan.parent / "build")) == FILES


# build --check


def test_checking_a_fresh_build_is_silent(scan: Path) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    before = stamps(out)
    outcome = run("build", scan, "-o", out, "--check")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")
    assert stamps(out) == before


def test_checking_a_stale_build_shows_how_and_writes_nothing(scan: Path) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    header = out / "annexin_200nm.h"
    header.write_text(header.read_text(encoding="ascii").replace("1250", "1251"), encoding="ascii")
    (out / "annexin_200nm_x.mem").unlink()
    (out / "annexin_200nm.vh").write_bytes((out / "annexin_200nm.vh").read_bytes().replace(b"\n", b"\r\n"))
    before = contents(out)
    outcome = run("build", scan, "-o", out, "--check")
    assert outcome.status == 1
    assert outcome.messages == [f"{out} is stale; run: tablegen build {scan} -o {out}"]
    lines = outcome.out.splitlines()
    assert f"{out / 'annexin_200nm_x.mem'}: missing" in lines
    assert f"{out / 'annexin_200nm.vh'}: differs in line ends only" in lines
    assert f"--- {header}" in lines
    assert any(line.startswith("-") and "1251" in line for line in lines)
    assert any(line.startswith("+") and "1250" in line for line in lines)
    assert not any("manifest" in line for line in lines)
    assert contents(out) == before


def test_checking_a_directory_that_is_not_there_does_not_make_it(scan: Path) -> None:
    outcome = run("build", scan, "-o", scan.parent / "out", "--check")
    assert outcome.status == 1
    assert len(outcome.out.splitlines()) == len(FILES)
    assert not (scan.parent / "out").exists()


def test_a_changed_scan_makes_its_build_stale(scan: Path) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    scan.write_text(edited(SCAN, "x.size_nm = 201.0"), encoding="utf-8")
    assert run("build", scan, "-o", out, "--check").status == 1
    scan.write_text(SCAN + "\n# a comment\n", encoding="utf-8")
    assert run("build", scan, "-o", out, "--check").status == 0


# check and show


def test_check_says_that_all_is_well(scan: Path) -> None:
    before = contents(scan.parent)
    outcome = run("check", scan)
    assert (outcome.status, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[2:] == ["0.5 s an image", f"{scan}: correct"]
    assert [line[:2] for line in lines[:2]] == ["x:", "y:"]
    assert contents(scan.parent) == before


def test_a_broken_limit_is_status_3_and_nothing_is_written(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, edited(SCAN, "limits.max_error_lsb = 0.6"))
    for command in (("check", scan), ("show", scan), ("build", scan, "-o", tmp_path / "out")):
        outcome = run(*command)
        assert outcome.status == 3
        assert outcome.out == ""
        assert re.fullmatch(rf"{scan}:55: limits.max_error_lsb: .*, above 0.6; .*\n", outcome.err)
    assert not (tmp_path / "out").exists()


@pytest.mark.common
def test_show_draws_in_braille_where_it_can_and_in_marks_elsewhere(scan: Path) -> None:
    braille = re.compile("[\u2801-\u28ff]")
    rich = tablegen("show", scan, PYTHONIOENCODING="utf-8")
    plain = tablegen("show", scan, PYTHONIOENCODING="ascii")
    assert (rich.returncode, plain.returncode, rich.stderr, plain.stderr) == (0, 0, b"", b"")
    rich_text, plain_text = rich.stdout.decode("utf-8"), plain.stdout.decode("ascii")
    assert braille.search(rich_text)
    assert not braille.search(plain_text)
    assert ">>>>" in plain_text
    assert "<<<<" in plain_text
    for text in (rich_text, plain_text):
        assert "\x1b" not in text, "no colours in a pipe"
        assert text.count("drive at the piezo [V]") == 2
        assert text.count("> forward   < backward") == 4
        assert text.splitlines()[-1].startswith("note: ")
    no_plot = tablegen("show", scan, "--no-plot").stdout.decode()
    assert "drive at the piezo [V]" not in no_plot
    assert no_plot.splitlines()[:12] == rich_text.splitlines()[:12]


@pytest.mark.common
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_a_name_that_the_terminal_cannot_show_is_no_failure(tmp_path: Path, encoding: str) -> None:
    scan = write_pair(tmp_path, SCAN, edited(SCANNER, "name = '\u03b2-scanner \U0001f52c'"))
    for command in (("show", scan), ("build", scan, "-o", tmp_path / os.fsdecode(b"out\xff"))):
        done = tablegen(*command, PYTHONIOENCODING=encoding)
        assert (done.returncode, done.stderr) == (0, b"")
        assert b"annexin_200nm on '" in done.stdout


@pytest.mark.common
def test_show_json_is_the_manifest_that_a_build_writes(scan: Path) -> None:
    shown = tablegen("show", scan, "--json")
    assert (shown.returncode, shown.stderr) == (0, b"")
    run("build", scan, "-o", scan.parent / "out")
    assert shown.stdout == (scan.parent / "out" / "manifest.json").read_bytes()


def on_a_terminal(*arguments: str | Path) -> str:
    """What a command prints on a pseudo-terminal."""
    status, shown = on_pseudo_terminal(arguments, {**os.environ, "TERM": "xterm", "PYTHONIOENCODING": "utf-8"})
    assert status == 0
    return shown


@pytest.mark.common
@pytest.mark.parametrize("command", ["show", "build", "check"])
def test_a_terminal_gets_what_a_pipe_gets_apart_from_colour(scan: Path, command: str) -> None:
    extra = ("-o", scan.parent / "out") if command == "build" else ()
    run(command, scan, *extra)  # so that both builds below find everything up to date
    piped = tablegen(command, scan, *extra, PYTHONIOENCODING="utf-8").stdout.decode("utf-8")
    shown = on_a_terminal(command, scan, *extra)
    shown = re.sub(r"\r[^\n]*\r", "", shown)  # what says on a busy machine that it takes its time
    assert re.sub(r"\x1b\[[0-9;]*m", "", shown) == piped
    assert ("\x1b[1m" in shown) == (command == "show")


# init and schema


def test_init_writes_the_pair_and_it_builds(tmp_path: Path) -> None:
    done = tablegen("init", "demo", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout == b"demo/scanner.toml\ndemo/annexin_200nm.toml\n"
    built = run("build", tmp_path / "demo" / "annexin_200nm.toml", "-o", tmp_path / "out", "--strict")
    assert (built.status, built.err) == (0, "")
    assert "200 image lines take 234 line periods a frame" in built.out


def test_init_does_not_overwrite_unless_it_is_told_to(tmp_path: Path) -> None:
    mine = tmp_path / "scanner.toml"
    mine.write_text("mine\n", encoding="ascii")
    outcome = run("init", tmp_path)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.messages == [f"{mine} exists; --force overwrites it"]
    assert contents(tmp_path) == {"scanner.toml": b"mine\n"}
    assert run("init", tmp_path, "--force").status == 0
    assert tomllib.loads(mine.read_text(encoding="utf-8"))["y"]["like"] == "x"


@pytest.mark.parametrize("kind", ["scan", "scanner"])
def test_the_schema_is_one_and_accepts_the_example(kind: str) -> None:
    schema = json.loads(run("schema", kind).out)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    Draft202012Validator.check_schema(schema)
    Draft202012Validator(schema).validate(tomllib.loads(SCAN if kind == "scan" else SCANNER))


@pytest.mark.parametrize(
    ("kind", "edit"),
    [
        ("scan", "dac.bits = 30"),
        ("scan", "dac.bits = 16.5"),
        ("scan", "dac.coding = 'gray'"),
        ("scan", "x.turn = 1.0"),
        ("scan", "x.size = 200.0"),
        ("scan", "x.band_limit.window = [0.1]"),
        ("scan", "name = '1st'"),
        ("scan", "- timing.lines"),
        ("scan", "- [y.table]\x00y.table = 3"),
        ("scanner", "x.size.beta = -0.5"),
        ("scanner", "x.hysteresis.branches.forward = { beta_max = 0.6 }"),
        ("scanner", "x.hysteresis.model = 'preisach'"),
        ("scanner", "- [y.size]"),
    ],
)
def test_the_schema_rejects_what_a_build_rejects(tmp_path: Path, kind: str, edit: str) -> None:
    edits = edit.split("\x00")
    text = edited(SCAN if kind == "scan" else SCANNER, *edits)
    schema = json.loads(run("schema", kind).out)
    assert list(Draft202012Validator(schema).iter_errors(tomllib.loads(text)))
    assert run("check", write_pair(tmp_path, **{kind: text})).status == 2


# What cannot be written


def test_an_output_that_is_a_file_is_wrong_usage(scan: Path) -> None:
    out = scan.parent / "out"
    out.write_text("mine\n", encoding="ascii")
    outcome = run("build", scan, "-o", out)
    assert outcome.status == 2
    assert "is a file" in outcome.err
    assert out.read_text(encoding="ascii") == "mine\n"


@pytest.mark.parametrize("command", ["build", "init"])
def test_an_output_below_a_file_cannot_be_written(scan: Path, command: str) -> None:
    out = scan / "out"
    outcome = run("build", scan, "-o", out) if command == "build" else run("init", out)
    assert (outcome.status, outcome.out) == (4, "")
    assert outcome.messages == [f"{out}: {scan} is no directory"]
    assert scan.read_text(encoding="utf-8") == SCAN


@pytest.mark.parametrize("command", ["build", "init"])
def test_a_name_too_long_for_the_disk_cannot_be_written(scan: Path, command: str) -> None:
    out = scan.parent / ("o" * 300)
    outcome = run("build", scan, "-o", out) if command == "build" else run("init", out)
    assert (outcome.status, outcome.messages) == (4, [f"{out}: File name too long"])


def full_disk() -> None:
    """Files of this process end at 4000 bytes, as if the disk were full."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))


@pytest.mark.common
def test_a_full_disk_leaves_nothing_where_nothing_was(scan: Path) -> None:
    out = scan.parent / "out"
    done = tablegen("build", scan, "-o", out, before=full_disk)
    assert (done.returncode, done.stdout) == (4, b"")
    assert done.stderr.decode() == f"{out}: File too large\n"
    assert not out.exists()


@pytest.mark.common
def test_a_full_disk_leaves_the_build_that_was_there(scan: Path) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    before, when = contents(out), stamps(out)
    scan.write_text(edited(SCAN, "x.size_nm = 201.0"), encoding="utf-8")
    done = tablegen("build", scan, "-o", out, before=full_disk)
    assert done.returncode == 4
    assert contents(out) == before
    assert stamps(out) == when


@pytest.mark.common
@pytest.mark.parametrize("command", ["show", "build", "schema"])
def test_a_full_disk_behind_stdout_is_told(scan: Path, command: str) -> None:
    arguments = {"show": ("show", scan), "build": ("build", scan, "-o", scan.parent / "out"), "schema": ("schema",)}
    with open("/dev/full", "wb") as full:
        done = tablegen(*arguments[command], stdout=full)
    assert done.returncode == 4
    assert done.stderr == b"cannot write to stdout: No space left on device\n"


@pytest.mark.common
@pytest.mark.parametrize("command", ["show", "check"])
def test_a_closed_stdout_is_no_failure(scan: Path, command: str) -> None:
    done = tablegen(command, scan, before=lambda: os.close(1), stdout=None)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.common
@pytest.mark.parametrize("wanted", [0, 1, 20])
def test_a_reader_that_leaves_is_no_failure(scan: Path, wanted: int) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "tablegen", "show", scan], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        for _ in range(wanted):
            assert process.stdout.readline()
        process.stdout.close()
        errors = process.stderr.read()
    assert (process.returncode, errors) == (0, b"")


# Ctrl-C. Hooks in the process press it at a moment that the test names, so that nothing here depends on time.

INTERRUPTED = """
import os, signal, sys
wanted, count = sys.argv[1], int(sys.argv[2])
def happened(what):
    global count
    if what.startswith(wanted):
        count -= 1
        if count == 0:
            os.kill(os.getpid(), signal.SIGINT)  # or another one
sys.argv = ["tablegen", *sys.argv[3:]]
from tablegen.cli import main
sys.addaudithook(lambda event, arguments: happened(f"{event} {arguments}"))
sys.setprofile(lambda frame, event, _: happened(f"{event} {frame.f_code.co_name}"))
main()
"""


def interrupted(
    event: str, count: int, *arguments: str | Path, number: str = "SIGINT"
) -> subprocess.CompletedProcess[str]:
    """The command line, interrupted as an audit event or a call happens for the so-manieth time."""
    command = [sys.executable, "-c", INTERRUPTED.replace("SIGINT", number), event, str(count), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)


LONG = edited(SCAN, "timing.lines = 20000", "x.size_nm = 201.0", "- [limits]")


@pytest.mark.common
@pytest.mark.parametrize(
    ("event", "count"),
    [
        ("import ('numpy'", 1),
        ("open ('{scan}'", 1),
        ("call manifest_file", 1),
        *(
            pytest.param(*moment, marks=pytest.mark.rest)
            for moment in (
                ("import ('tablegen.planning.line_plan'", 1),
                ("import ('jinja2'", 1),
                ("import ('tablegen.emit", 1),
                ("open ('{scanner}'", 1),
                ("call locate", 2),
                ("call fit_window", 1),
                ("call fit_window", 2),
                ("call synthesize", 2),
                ("call certify", 1),
                ("call render", 1),
            )
        ),
    ],
)
def test_an_interruption_before_writing_leaves_the_build_that_was_there(scan: Path, event: str, count: int) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    before, when = contents(out), stamps(out)
    scan.write_text(LONG, encoding="utf-8")
    moment = event.format(scan=scan, scanner=scan.parent / "scanner.toml")
    done = interrupted(moment, count, "build", scan, "-o", out)
    assert done.returncode == 130
    assert done.stderr.strip() == f"interrupted; {out} was left as it was"
    assert done.stdout == ""
    assert contents(out) == before
    assert stamps(out) == when


@pytest.mark.common
@pytest.mark.parametrize(
    ("event", "count", "number"),
    [
        ("tempfile.mkstemp", 5, "SIGTERM"),
        ("os.rename", 1, "SIGINT"),
        pytest.param("os.rename", 4, "SIGTERM", marks=LONG_TEST),
        *(
            pytest.param(*moment, marks=pytest.mark.rest)
            for moment in (("tempfile.mkstemp", 1, "SIGINT"), ("os.rename", 3, "SIGHUP"))
        ),
    ],
)
def test_an_interruption_while_writing_waits_for_the_last_file(scan: Path, event: str, count: int, number: str) -> None:
    out = scan.parent / "out"
    run("build", scan, "-o", out)
    scan.write_text(LONG, encoding="utf-8")
    run("build", scan, "-o", scan.parent / "wanted")
    done = interrupted(event, count, "build", scan, "-o", out, number=number)
    assert done.returncode == 130
    assert done.stderr.strip() == f"interrupted, after the files of {out} had been written"
    assert contents(out) == contents(scan.parent / "wanted")
    assert run("build", scan, "-o", out, "--check").status == 0


WAITING = """
import signal, sys
import tablegen.certificate.certified_scan
def wait(*_, **_options):
    print("planning", flush=True)
    while True:
        signal.pause()
tablegen.certificate.certified_scan.make_plan = wait
from tablegen.cli import main
main()
"""


@pytest.mark.common
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_from_outside_interrupts_a_build(scan: Path, number: signal.Signals) -> None:
    out = scan.parent / "out"
    command = [sys.executable, "-c", WAITING, "build", scan, "-o", out]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "planning\n"
        process.send_signal(number)
        printed, told = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert (printed, told.strip()) == ("", f"interrupted; {out} was left as it was")
    assert not out.exists()


@pytest.mark.common
def test_what_is_ignored_stays_ignored(scan: Path) -> None:
    """As ``nohup`` wants it: the signal comes first, and the build is there all the same."""
    shell = 'trap "" HUP; exec "$@"'
    hooked = INTERRUPTED.replace("SIGINT", "SIGHUP")
    command = ["/bin/sh", "-c", shell, "sh", sys.executable, "-c", hooked, "call certify", "1", "build", scan, "-q"]
    done = subprocess.run(command, cwd=scan.parent, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert (done.returncode, done.stderr) == (0, "")
    assert (scan.parent / "build" / "manifest.json").exists()


def test_a_scanner_that_is_a_pipe_is_refused_and_not_waited_for(scan: Path) -> None:
    os.mkfifo(scan.parent / "pipe.toml")
    scan.write_text(edited(SCAN, "scanner = 'pipe.toml'"), encoding="utf-8")
    outcome = run("check", scan)
    assert outcome.status == 2
    assert outcome.messages == [
        f"{scan}:3: scanner: {scan.parent / 'pipe.toml'} is not a file; the path is relative to this file"
    ]
