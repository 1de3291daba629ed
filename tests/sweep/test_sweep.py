"""``tablegen sweep``: what it writes, what it builds again, what it says of failures, and how it ends."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest
from editing import edited, run, write_pair
from libraries import BASE, DAMPED, NAMES, write_library
from limits import PATIENCE_S

import tablegen
from tablegen.cli.shared.progress_bar import Bar


def index_of(out: Path) -> dict[str, list[dict[str, object]]]:
    return json.loads((out / "library.json").read_text("ascii"))


def stamps(out: Path) -> dict[str, tuple[int, int]]:
    """What changes of each file when it is written again, even with the same content."""
    paths = [path for path in out.rglob("*") if path.is_file()]
    return {str(path.relative_to(out)): (path.stat().st_mtime_ns, path.stat().st_ino) for path in paths}


def rewritten(before: dict[str, tuple[int, int]], out: Path) -> set[str]:
    """The folders, or files beside them, that were written, are new or are gone."""
    after = stamps(out)
    changed = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
    return {name.split("/")[0] for name in changed}


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    return write_library(tmp_path)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library that was built once; tests copy it."""
    folder = tmp_path_factory.mktemp("stored")
    assert run("sweep", write_library(folder), "-o", folder / "out", "-j", "1").status == 0
    return folder


@pytest.fixture
def library(stored: Path, tmp_path: Path) -> Path:
    """The folder of a scan file and of its library, ``out``."""
    shutil.copytree(stored, tmp_path / "library")
    return tmp_path / "library"


def sweep(folder: Path, *options: str, scan: str = "scan.toml") -> object:
    done = run("sweep", folder / scan, "-o", folder / "out", "-j", "1", *options)
    return done.status, done.out.replace(str(folder), "."), done.err.replace(str(folder), ".")


def test_each_program_is_what_a_build_of_it_would_be(library: Path, tmp_path: Path) -> None:
    """Byte for byte, with the runtime once for all."""
    text = edited(BASE, 'name = "broad"', "x.size_nm = 400.0", "x.offset_v = 45.0", "timing.line_rate_hz = 625.0")
    path = write_pair(tmp_path, edited(text, "timing.lines = 10"), DAMPED)
    built = tablegen.build(path).files
    out = library / "out"
    found = {path.name: path.read_bytes() for path in (out / "broad").iterdir() if path.name != "program.json"}
    beside = {path.name: path.read_bytes() for path in out.iterdir() if path.name in built}
    assert {**found, **beside} == built
    assert not found.keys() & beside.keys()
    assert {path.name for path in out.iterdir() if path.is_dir()} == set(NAMES)


def test_the_index_has_every_program_and_what_differs(library: Path) -> None:
    index = index_of(library / "out")
    assert [(one["number"], one["name"]) for one in index["programs"]] == list(enumerate(NAMES))
    assert index["programs"][0]["settings"] == {"x.size_nm": 150.0}
    for one in index["programs"]:
        manifest = json.loads((library / "out" / str(one["name"]) / "manifest.json").read_text("ascii"))
        assert (one["hash"], one["line_ticks"]) == (manifest["hash"], manifest["sequence"]["line_ticks"])
        for axis in "xy":
            certificate = manifest["axes"][axis]["certificate"]
            assert one[axis]["max_error_lsb"] == certificate["max_error_lsb"]
    assert index["failed"] == []
    assert index["notes"] == []


def test_a_second_run_writes_nothing(library: Path) -> None:
    before = stamps(library / "out")
    assert sweep(library) == (0, "./out: 3 scans: 3 up to date\n", "")
    assert stamps(library / "out") == before


@pytest.mark.common
@pytest.mark.parametrize("change", ["value", "comment", "scanner", "missing", "edited", "record"])
def test_what_is_missing_or_changed_is_built_and_nothing_else(library: Path, change: str) -> None:
    path, out = library / "scan.toml", library / "out"
    text = path.read_text("utf-8")
    built = {"broad"}
    if change == "value":
        path.write_text(text.replace("size_nm = 400.0", "size_nm = 410.0"), "utf-8")
    elif change == "comment":
        path.write_text("# about this library\n" + text, "utf-8")
        built = set()
    elif change == "scanner":
        scanner = library / "scanner.toml"
        scanner.write_text(scanner.read_text("utf-8").replace('name = "hs-afm"', 'name = "other"'), "utf-8")
        built = set(NAMES)
    elif change == "missing":
        (out / "broad" / "broad_x.mem").unlink()
    elif change == "edited":
        with (out / "broad" / "broad.h").open("a") as file:
            file.write("/* mine */\n")
    else:
        (out / "broad" / "program.json").write_text("{", "ascii")
    before = stamps(out)
    status, said, _ = sweep(library)
    assert status == 0
    assert f"{len(built)} built" in said if built else "built" not in said
    index = {name for name in before if "_library" in name or name == "library.json"}
    assert rewritten(before, out) - index == built
    assert sweep(library)[1] == "./out: 3 scans: 3 up to date\n"


def test_programs_that_are_not_asked_for_go_unless_they_were_edited(library: Path) -> None:
    path, out = library / "scan.toml", library / "out"
    text = path.read_text("utf-8")
    path.write_text(text[: text.index('[[scans]]\nname = "broad"')], "utf-8")
    with (out / "even" / "even.c").open("a") as file:
        file.write("/* mine */\n")
    status, said, err = sweep(library)
    assert (status, said) == (0, "./out: 1 scan: 1 up to date, 1 removed\n")
    assert err == "note: ./out/even: left over from an earlier sweep, and has other files or edited ones; remove it\n"
    assert {path.name for path in out.iterdir() if path.is_dir()} == {"narrow", "even"}
    assert [path.name for path in (out / "even").iterdir()] == ["even.c"]
    assert len(index_of(out)["programs"]) == 1
    assert "EVEN" not in (out / "lines_library.h").read_text("ascii")


@pytest.mark.common
def test_files_in_sub_folders_are_compared_and_go_with_their_program(library: Path) -> None:
    formats, out = ("-f", "c", "-f", "zephyr"), library / "out"
    file = out / "broad" / "zephyr" / "module.yml"
    assert sweep(library, *formats)[0] == 0
    right = file.read_bytes()
    assert sweep(library, *formats, "--check")[0] == 0
    assert run("verify", "--target", "files", out / "broad").status == 0
    file.write_bytes(b"mine")
    assert sweep(library, *formats, "--check")[0] == 1
    assert run("verify", "--target", "files", out / "broad").status == 5
    assert sweep(library, *formats)[0] == 0
    assert file.read_bytes() == right
    (out / "even" / "zephyr" / "mine.c").write_bytes(b"mine")
    text = (library / "scan.toml").read_text("utf-8")
    first = text[: text.index("[[scans]]")]
    (library / "scan.toml").write_text(first + '[[scans]]\nname = "narrow"\nx.size_nm = 150.0\n', "utf-8")
    assert sweep(library, *formats)[0] == 0
    assert not (out / "broad").exists()
    assert [path.relative_to(out).as_posix() for path in (out / "even").rglob("*")] == [
        "even/zephyr",
        "even/zephyr/mine.c",
    ]


@pytest.mark.common
def test_formats_that_go_take_their_index_and_runtime_along(library: Path) -> None:
    assert sweep(library, "-f", "c")[0] == 0
    out = library / "out"
    assert not list(out.rglob("*.v")) + list(out.rglob("*.vh")) + list(out.rglob("*.mem"))
    assert (out / "lines_library.c").exists()
    assert sweep(library, "-f", "csv")[0] == 0
    assert sorted(path.name for path in out.iterdir()) == ["broad", "even", "library.json", "narrow"]


def test_failures_are_listed_once_with_their_reasons_and_the_rest_is_built(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, edited(BASE, "+ [limits]\nmax_error_lsb = 30.0"))
    settings = ("--set", "x.size_nm=150,5000", "--set", "y.size_nm=200,20000", "--set", "timing.lines=12,40")
    done = run("sweep", scan, *settings, "-o", tmp_path / "out", "-j", "1")
    assert done.status == 11
    assert done.out == f"{tmp_path / 'out'}: 8 scans: 2 built, 6 failed\n"
    reasons = [line for line in done.messages if line.startswith("failed: ")]
    assert len(reasons) == 3, "by reason: x, y, and both"
    assert "--set x.size_nm=150,5000: x.size_nm: 5000 nm needs" in done.err
    index = index_of(tmp_path / "out")
    assert len(index["programs"]) == 2
    assert len(index["failed"]) == 6
    assert index["failed"][0]["settings"] == {"x.size_nm": 150, "y.size_nm": 20000, "timing.lines": 12}
    assert "5000 nm needs" in str(index["failed"][-1]["reasons"])
    assert (tmp_path / "out" / "lines_library.c").exists()


@pytest.mark.common
@pytest.mark.parametrize(
    ("settings", "options", "status"),
    [
        ("x.size_nm=5000,6000", (), 2),
        ("limits.max_error_lsb=1e-3,1e-2", (), 3),
        ("x.size_nm=20,30", ("--strict",), 3),
        ("x.size_nm=20,150", ("--strict",), 11),
        ("x.size_nm=20", (), 0),
        ("no.key=1", (), 2),
        ("x.size_nm", (), 2),
        ("x.size_nm=1:2", (), 2),
        ("x.size_nm=150", ("-f", "nothing"), 2),
        ("scanner=none.toml", (), 2),
        ("emit.formats=[nothing]", (), 2),
    ],
)
def test_the_status_tells_how_it_ended(tmp_path: Path, settings: str, options: tuple[str, ...], status: int) -> None:
    done = run(
        "sweep", write_pair(tmp_path, BASE), "--set", settings, *options, "-o", tmp_path / "out", "-j", "1", "-f", "csv"
    )
    assert done.status == status
    assert done.err, "a failure, or the warning of a small scan"


def test_a_directory_that_cannot_be_written(tmp_path: Path) -> None:
    scan = write_library(tmp_path)
    (tmp_path / "out").write_text("a file")
    assert run("sweep", scan, "-o", tmp_path / "out").status == 2
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "broad").write_text("a file")
    done = run("sweep", scan, "-o", tmp_path / "other", "-j", "1", "-f", "csv")
    assert (done.status, len(done.messages)) == (4, 1)
    assert "broad" in done.err


def test_list_says_what_would_be_done_and_writes_nothing(library: Path) -> None:
    before = stamps(library)
    status, said, err = sweep(library, "--set", "x.turn=0.5,7", "--list")
    assert (status, err) == (11, "")
    lines = said.splitlines()
    assert len(lines) == 6
    assert lines[0].split() == ["narrow_turn_0p5", "x.size_nm", "=", "150.0,", "x.turn", "=", "0.5:", "to", "build"]
    assert "wrong: --set x.turn=0.5,7: x.turn: 7" in lines[1]
    assert sweep(library, "--dry-run")[1].count(": up to date") == 3
    assert stamps(library) == before


@pytest.mark.common
def test_check_finds_what_a_sweep_would_write(library: Path) -> None:
    assert sweep(library, "--check") == (0, "./out: 3 scans: 3 up to date\n", "")
    path, out = library / "scan.toml", library / "out"
    path.write_text(path.read_text("utf-8").replace("size_nm = 400.0", "size_nm = 410.0"), "utf-8")
    (out / "lines_library.h").unlink()
    before = stamps(library)
    status, said, err = sweep(library, "--check")
    assert status == 1
    found = {line.removeprefix("./out/").removesuffix(": not up to date") for line in said.splitlines()}
    assert {"broad/manifest.json", "broad/broad.c", "lines_library.h", "library.json"} <= found
    assert not any(name.startswith(("narrow", "even", "dac_")) for name in found)
    assert err == "./out is stale; run the same command without --check\n"
    assert stamps(library) == before


def test_check_of_a_directory_that_is_missing(tmp_path: Path) -> None:
    status, said, err = sweep(write_library(tmp_path).parent, "--check")
    assert (status, err) == (1, "./out is stale; run the same command without --check\n")
    assert "./out/broad/broad_x.mem: not up to date" in said
    assert "./out/lines_library_fourier.mem: not up to date" in said
    assert not (tmp_path / "out").exists()


def rewrite(path: Path, **values: object) -> None:
    """Change values of a JSON file; a dotted key leads into it."""
    record = json.loads(path.read_text("ascii"))
    for key, value in values.items():
        *way, last = key.split("__")
        place = record
        for name in way:
            place = place[name]
        place[last] = value
    path.write_text(json.dumps(record, indent=1) + "\n", "ascii")


def change_word(folder: Path) -> None:
    """Change a word of a table, and make right all that the directory says of it."""
    memory, manifest = folder / f"{folder.name}_x.mem", folder / "manifest.json"
    words = memory.read_text("ascii").splitlines()
    words[5] = f"{int(words[5], 16) ^ 1:0{len(words[5])}x}"
    memory.write_text("\n".join(words) + "\n", "ascii")
    record = json.loads((folder / "program.json").read_text("ascii"))["files"]
    listed = json.loads(manifest.read_text("ascii"))["files"]
    listed[memory.name] = sha256(memory.read_bytes()).hexdigest()
    rewrite(manifest, files=listed)
    for name in (memory.name, manifest.name):
        record[name] = sha256((folder / name).read_bytes()).hexdigest()
    rewrite(folder / "program.json", files=record)


# What somebody has done to a library, and what of it is not up to date.
TAMPERINGS: dict[str, tuple[Callable[[Path], object], str]] = {
    "word": (lambda out: change_word(out / "broad"), "broad/broad_x.mem"),
    "name": (
        lambda out: rewrite(out / "broad" / "program.json", name='broad", 0}}; int evil(void) { return 1; } //'),
        "broad/program.json",
    ),
    "hash": (lambda out: rewrite(out / "broad" / "program.json", hash="0" * 64), "broad/program.json"),
    "axes": (lambda out: rewrite(out / "broad" / "program.json", x__harmonics=3), "broad/program.json"),
    "warnings": (lambda out: rewrite(out / "broad" / "program.json", warnings=["none"]), "broad/program.json"),
    "record": (lambda out: (out / "broad" / "program.json").unlink(), "broad/program.json"),
    "program": (lambda out: shutil.rmtree(out / "broad"), "broad/manifest.json"),
    "index": (lambda out: rewrite(out / "library.json", programs=[]), "library.json"),
    "index in C": (lambda out: (out / "lines_library.c").write_text("int x;\n", "ascii"), "lines_library.c"),
    "memory": (lambda out: (out / "lines_library_tables.mem").write_text("0\n", "ascii"), "lines_library_tables.mem"),
    "runtime": (lambda out: (out / "dac_axis.c").write_text("int x;\n", "ascii"), "dac_axis.c"),
}


@pytest.mark.common
@pytest.mark.parametrize("tampering", TAMPERINGS)
def test_check_believes_nothing_that_the_directory_says_of_itself(library: Path, tampering: str) -> None:
    """And the next sweep puts it right, though the digests of a word's files were made right too."""
    before = {path: path.read_bytes() for path in (library / "out").rglob("*") if path.is_file()}
    change, name = TAMPERINGS[tampering]
    change(library / "out")
    status, said, _ = sweep(library, "--check")
    assert status == 1
    assert f"./out/{name}: not up to date\n" in said
    assert sweep(library)[0] == 0
    assert {path: path.read_bytes() for path in (library / "out").rglob("*") if path.is_file()} == before


@pytest.mark.common
@pytest.mark.parametrize("what", ["broad/dac_axis.c", "lines_library.vh", "dac_evil.c", "copied", "linked", "program"])
def test_what_no_sweep_has_made_is_named_and_stays(library: Path, what: str) -> None:
    """A compiler that is given ``out/*.c out/*/*.c`` takes it in; a folder is a program if it looks like one."""
    out = library / "out"
    if what == "lines_library.vh":  # which an index of C alone has not
        assert sweep(library, "-f", "c")[0] == 0
    options = ("-f", "c") if what == "lines_library.vh" else ()
    if what in ("copied", "linked"):
        shutil.copytree(out / "broad", library / "elsewhere" if what == "linked" else out / what)
    if what == "linked":
        rewrite(library / "elsewhere" / "program.json", name="linked")
        (out / what).symlink_to(library / "elsewhere")
    elif what == "program":
        (out / what).mkdir()
        (out / what / "program.json").write_text('{"name": "../../scan.toml"}', "ascii")
    elif what != "copied":
        (out / what).write_text("int x;\n", "ascii")
    before = {path: path.read_bytes() for path in library.rglob("*") if path.is_file()}
    status, said, err = sweep(library, "--check", *options)
    assert status == 1
    assert f"./out/{what}: not up to date\n" in said
    assert f"note: ./out/{what}: is not of this library; remove it\n" in err
    assert sweep(library, *options)[0] == 0
    assert {path: path.read_bytes() for path in library.rglob("*") if path.is_file()} == before


@pytest.mark.common
def test_a_library_of_somebody_else_is_made_again_and_not_written(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a cache nothing vouches for it; the same is said, and nothing but the index is put down again."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    before = stamps(library / "out")
    assert sweep(library, "--list")[1].count(": to build") == 3
    assert sweep(library) == (0, "./out: 3 scans: 3 up to date\n", "")
    assert {name for name in rewritten(before, library / "out") if "library" not in name} == set()
    assert sweep(library, "--list")[1].count(": up to date") == 3
    before = stamps(library / "out")
    assert sweep(library) == (0, "./out: 3 scans: 3 up to date\n", "")
    assert stamps(library / "out") == before


def test_an_index_of_somebody_else_removes_nothing(tmp_path: Path) -> None:
    out = write_library(tmp_path).parent / "out"
    out.mkdir()
    for name in ("main.c", "my_library.h", "other_library.h"):
        (out / name).write_text("mine\n", "ascii")
    digest = sha256(b"mine\n").hexdigest()
    files = dict.fromkeys(["main.c", "my_library.h", "../scan.toml", ".."], digest)
    (out / "library.json").write_text(json.dumps({"name": "PubSub", "library": "my", "files": files}), "ascii")
    assert sweep(tmp_path, "-f", "csv")[0] == 0
    assert {"main.c", "my_library.h", "other_library.h"} <= {path.name for path in out.iterdir()}


def test_a_program_whose_manifest_is_not_its_own_is_not_removed(library: Path) -> None:
    """Its record lists a file of somebody else, or the manifest was edited."""
    path, out = library / "scan.toml", library / "out"
    text = path.read_text("utf-8")
    path.write_text(text[: text.index('[[scans]]\nname = "broad"')], "utf-8")
    (out / "broad" / "mine.txt").write_text("mine\n", "ascii")
    record = json.loads((out / "broad" / "program.json").read_text("ascii"))["files"]
    rewrite(out / "broad" / "program.json", files=record | {"mine.txt": sha256(b"mine\n").hexdigest()})
    rewrite(out / "even" / "manifest.json", axes__x__output__gain_word=5)
    status, said, err = sweep(library)
    assert (status, said) == (0, "./out: 1 scan: 1 up to date\n")
    assert [path.name for path in (out / "broad").iterdir()] == ["mine.txt"]
    assert (out / "even" / "even.c").exists()
    assert "note: ./out/even: is not of this library; remove it\n" in err


def test_programs_that_one_runtime_cannot_play_have_no_index(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, BASE)
    done = run("sweep", scan, "--set", "x.table.bits=16,18", "-o", tmp_path / "out", "-j", "1")
    assert done.status == 0
    both = "lines_bits_16 and lines_bits_18 differ in"
    assert done.messages == [
        f"note: no index in C: {both} storage of words: (16, 16) and (32, 16); set it in the scan file",
        f"note: no index in Verilog: {both} x.table.bits: 16 and 18; set it in the scan file",
    ]
    assert not list((tmp_path / "out").glob("lines_library*"))
    assert len(index_of(tmp_path / "out")["programs"]) == 2


@pytest.mark.parametrize(
    ("command", "index"),
    [
        (["verify"], False),
        *((command, index) for command in (["upload", "--port", "none"], ["report"]) for index in (True, False)),
    ],
)
def test_a_library_is_not_a_build_and_its_programs_are_named(library: Path, command: list[str], index: bool) -> None:
    """One line, with something to do; also where a sweep was interrupted before its index."""
    out = library / "out"
    if not index:
        (out / "library.json").unlink()
    done = run(*command, out)
    assert (done.status, done.out) == (2, "")
    assert done.err == (
        f"{out}: is a library of `tablegen sweep`, not a build; name one of its programs, for example {out}/broad\n"
    )


@pytest.mark.common
def test_a_program_is_verified_and_read_like_a_build(library: Path) -> None:
    out = library / "out"
    assert run("verify", out / "broad", "--target", "c", "--ticks", "4000").status == 0
    assert tablegen.read_build(out / "broad").program.schedule.lines == 10
    with (out / "dac_axis.c").open("a") as file:
        file.write("/* edited */\n")
    failures = tablegen.verify(out / "broad", "files").failures
    assert "dac_axis.c" in str(failures)


@pytest.mark.common
def test_more_processes_write_the_same(library: Path, tmp_path: Path) -> None:
    done = run("sweep", library / "scan.toml", "-o", tmp_path / "two", "-j", "2")
    assert (done.status, done.out) == (0, f"{tmp_path / 'two'}: 3 scans: 3 built\n")
    one, two = (
        {str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*") if path.is_file()}
        for out in (library / "out", tmp_path / "two")
    )
    assert one == two


@pytest.mark.rest
@pytest.mark.parametrize("jobs", ["1", "2"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_leaves_whole_programs_and_no_index(tmp_path: Path, jobs: str, number: signal.Signals) -> None:
    """And the next run goes on from there; no worker is left behind."""
    scan, out = write_pair(tmp_path, BASE), tmp_path / "out"
    command = [sys.executable, "-m", "tablegen", "sweep", scan, "--set", "x.size_nm=100:480:2", "-o", out, "-j", jobs]
    process = subprocess.Popen([str(word) for word in command], stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + PATIENCE_S
    while len(list(out.glob("*/manifest.json"))) < 3 and time.monotonic() < until:
        time.sleep(0.01)
    process.send_signal(number)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert said.startswith("interrupted after ")
    assert "the same command goes on from there" in said
    folders = [path for path in out.iterdir() if path.is_dir()]
    whole = [path for path in folders if (path / "manifest.json").exists()]
    assert 3 <= len(whole) < 191
    assert not (out / "library.json").exists()
    for path in whole:
        assert not tablegen.verify(path, "files").failures or not (out / "dac_axis.c").exists()
        assert not [name for name in os.listdir(path) if name.startswith(".")]
    done = run("sweep", scan, "--set", "x.size_nm=100:480:2", "-o", out, "--list")
    assert done.out.count(": up to date") == len(whole)


def test_progress_has_a_fraction() -> None:
    times = iter([0.0, 10.0])
    bar = Bar(lambda: next(times), "scans")
    bar._shows = True
    shown: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tablegen.cli.shared.progress_bar.redraw", shown.append)
        bar(0, 40)
        bar(10, 40)
    assert "[......" in shown[0]
    assert "10/40 scans  30 s left" in shown[1]
