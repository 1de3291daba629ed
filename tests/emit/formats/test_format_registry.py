"""The registry: names that there are, names that there are not, and formats of other packages that are broken."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from building import NAME
from editing import SCAN, edited, run, write_pair

from tablegen.base.resources import resource_folder
from tablegen.emit import formats
from tablegen.emit.depfile import deciding_files
from tablegen.emit.format import Format
from tablegen.emit.formats import UnknownFormat, chosen, get, names, own_names

WORKING = """
from tablegen.emit.format import Format

class Words(Format):
    name = "words"
    purpose = "how many words"
    file_names = "NAME.count"

    def files(self, content):
        return {FILE: str(len(content.x.program.words)).encode()}

FORMAT = Words()
"""


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    """What was found is found again, before a test and after it."""
    for each in (formats._others, formats.get):
        each.cache_clear()
    yield
    for each in (formats._others, formats.get):
        each.cache_clear()


def provide(folder: Path, monkeypatch: pytest.MonkeyPatch, package: str, entry: str, source: str = "") -> None:
    """An installed distribution with one module of the same name and one entry point."""
    place = folder / package
    info = place / f"{package}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n", "utf-8")
    (info / "entry_points.txt").write_text(f"[tablegen.formats]\n{entry}\n", "utf-8")
    (place / f"{package}.py").write_text(source, "utf-8")
    monkeypatch.syspath_prepend(str(place))
    for each in (formats._others, formats.get):
        each.cache_clear()


# Names


def test_an_unknown_name_is_told_with_those_that_there_are() -> None:
    with pytest.raises(UnknownFormat) as caught:
        get("verilgo")
    assert str(caught.value) == f"'verilgo' is not a format; formats are {', '.join(names())}"


@pytest.mark.parametrize("name", ["", ".", "..", "../c", "__init__", "c.py", "C", "intel_hex"])
def test_a_name_is_no_path_and_no_module(name: str) -> None:
    with pytest.raises(UnknownFormat, match="is not a format"):
        get(name)


def test_a_name_given_twice_is_one_format() -> None:
    assert [each.name for each in chosen(["csv", "c", "csv"])] == ["csv", "c"]


def test_an_unknown_name_in_a_scan_file_has_its_line(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, edited(SCAN, '+ [emit]\nformats = ["c", "rust"]'))
    outcome = run("build", scan, "-o", tmp_path / "out")
    line = len(scan.read_text("utf-8").splitlines())
    assert outcome.status == 2
    assert outcome.messages == [
        f"{scan}:{line}: emit.formats: 'rust' is not a format; formats are {', '.join(names())}",
    ]
    assert not (tmp_path / "out").exists()


def test_an_unknown_name_on_the_command_line_has_none(tmp_path: Path) -> None:
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "rust")
    assert outcome.status == 2
    (told,) = outcome.messages
    assert told.startswith("formats: 'rust' is not a format; formats are ")
    assert not (tmp_path / "out").exists()


def test_the_command_line_lists_every_format() -> None:
    outcome = run("formats")
    assert (outcome.status, outcome.err) == (0, "")
    for name in own_names():
        found = get(name)
        assert f"{name:<16}{found.purpose}\n{'':16}{found.file_names}\n" in outcome.out


# Choices


@pytest.mark.common
def test_the_manifest_names_formats_that_are_not_the_default(tmp_path: Path) -> None:
    scan = write_pair(tmp_path)
    found = {}
    for chosen_ in ((), ("verilog", "c"), ("c",), ("csv", "verilog")):
        folder = tmp_path / "-".join(("out", *chosen_))
        assert run("build", scan, "-o", folder, *(f"--format={name}" for name in chosen_)).status == 0
        found[chosen_] = json.loads((folder / "manifest.json").read_bytes()).get("formats")
    assert found == {(): None, ("verilog", "c"): None, ("c",): ["c"], ("csv", "verilog"): ["csv", "verilog"]}
    assert (tmp_path / "out" / "manifest.json").read_bytes() == (
        tmp_path / "out-verilog-c" / "manifest.json"
    ).read_bytes()


def test_the_command_line_goes_before_the_scan_file(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, edited(SCAN, '+ [emit]\nformats = ["bin"]'))
    assert run("build", scan, "-o", tmp_path / "a").status == 0
    assert run("build", scan, "-o", tmp_path / "b", "-f", "mif").status == 0
    assert {path.suffix for path in (tmp_path / "a").iterdir()} == {".bin", ".json"}
    assert {path.suffix for path in (tmp_path / "b").iterdir()} == {".mif", ".json"}


def test_the_plan_is_the_same_in_every_format(tmp_path: Path) -> None:
    """So that a device tells by the hash which scan it plays, whatever it was written as."""
    scan = write_pair(tmp_path)
    digests = set()
    for name in ("c", "verilog", "vhdl", "npz"):
        assert run("build", scan, "-o", tmp_path / name, "-f", name).status == 0
        digests.add(json.loads((tmp_path / name / "manifest.json").read_bytes())["hash"])
    assert len(digests) == 1


@pytest.mark.common
@pytest.mark.parametrize("header_only", [False, True])
def test_c_alone_is_verified_as_c(tmp_path: Path, header_only: bool) -> None:
    scan = write_pair(tmp_path, edited(SCAN, f"+ [emit]\nheader_only = {str(header_only).lower()}"))
    out = tmp_path / "out"
    assert run("build", scan, "-o", out, "-f", "c").status == 0
    assert {path.suffix for path in out.iterdir()} == {".c", ".h", ".json"}
    assert (out / f"{NAME}.c").exists() != header_only
    outcome = run("verify", "--ticks", "3000", out)
    assert outcome.status == 0, outcome.err
    assert "c header" in outcome.out
    refused = run("verify", "--target", "verilog", out)
    assert refused.status == 2
    assert refused.messages == [
        f"{out}: this build has the formats c, and no verilog; verify it with another --target, or build it with "
        "--format verilog"
    ]


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_verilog_alone_is_verified_as_verilog(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("build", write_pair(tmp_path), "-o", out, "-f", "verilog").status == 0
    assert {path.suffix for path in out.iterdir()} == {".v", ".vh", ".mem", ".json"}
    outcome = run("verify", "--ticks", "2000", "--axis", "blocks", out)
    assert outcome.status == 0, outcome.err
    assert "verilog header" in outcome.out
    refused = run("verify", "--target", "c", out)
    assert refused.status == 2
    assert "this build has the formats verilog, and no c;" in refused.err


def test_tables_alone_are_verified_as_files(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("build", write_pair(tmp_path), "-o", out, "-f", "bin", "-f", "mif").status == 0
    outcome = run("verify", "--target", "files", out)
    assert outcome.status == 0, outcome.err


@pytest.mark.parametrize("name", own_names())
def test_a_dependency_file_names_what_the_chosen_format_is_made_of(name: str) -> None:
    templates = resource_folder("firmware_templates")
    found = deciding_files([name])
    modules = {
        path.stem.replace("_", "-") for path in found if path.parent.name == "formats" and path.stem != "__init__"
    }
    assert modules == {name, *get(name).needs}
    sources = [path for each in (name, *get(name).needs) for path in get(each).sources()]
    assert {path for path in found if path.is_relative_to(templates)} == set(sources)


# Other packages


def test_a_format_of_another_package_is_built_and_verified(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    provide(tmp_path, monkeypatch, "words_a", "words = words_a:FORMAT", WORKING.replace("FILE", "'scan.count'"))
    out = tmp_path / "out"
    assert "words" in names()
    assert "words" not in own_names()
    assert "words           how many words\n" in run("formats").out
    assert run("build", write_pair(tmp_path), "-o", out, "-f", "words").status == 0
    assert (out / "scan.count").read_bytes() == b"2048"
    assert run("verify", "--target", "files", out).status == 0
    assert tmp_path / "words_a" / "words_a.py" in deciding_files(["words"])


def test_one_that_is_gone_is_verified_by_its_hashes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as installed:
        provide(tmp_path, installed, "words_b", "words = words_b:FORMAT", WORKING.replace("FILE", "'scan.count'"))
        assert run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "words").status == 0
    formats._others.cache_clear()
    formats.get.cache_clear()
    outcome = run("verify", "--target", "files", tmp_path / "out")
    assert outcome.status == 0
    assert "'words' is not a format" in outcome.out
    assert "only the SHA-256 of its files was checked" in outcome.out


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("import no_such_module_of_anybody", "ModuleNotFoundError: No module named 'no_such_module_of_anybody'"),
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("", "AttributeError"),
    ],
)
def test_one_that_cannot_be_loaded_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str, why: str
) -> None:
    package = f"broken_{abs(hash(why))}"
    provide(tmp_path, monkeypatch, package, f"broken = {package}:FORMAT", source)
    with pytest.raises(UnknownFormat, match=f"'broken' of {package} cannot be loaded: {why}"):
        get("broken")
    listed = run("formats")
    assert listed.status == 0
    assert f"cannot be used: 'broken' of {package} cannot be loaded" in listed.err
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "broken")
    assert outcome.status == 2
    assert why in outcome.err
    assert run("build", tmp_path / "scan.toml", "-o", tmp_path / "out", "-f", "bin").status == 0  # others go on


def test_one_that_is_no_format_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    provide(tmp_path, monkeypatch, "thing", "thing = thing:FORMAT", "FORMAT = 3")
    with pytest.raises(UnknownFormat, match=r"'thing' of thing is no tablegen\.emit\.format\.Format of that name"):
        get("thing")


def test_two_of_a_name_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("words_c", "words_d"):
        provide(tmp_path, monkeypatch, package, f"words = {package}:FORMAT", WORKING.replace("FILE", "'scan.count'"))
    with pytest.raises(
        UnknownFormat, match="'words' is a format of words_c and words_d; uninstall all of them but one"
    ):
        get("words")


def test_nobody_replaces_a_format_of_tablegen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    provide(tmp_path, monkeypatch, "hostile", "c = hostile:FORMAT", "1 / 0")
    assert type(get("c")).__module__ == "tablegen.emit.formats.c"


@pytest.mark.parametrize(
    "file",
    [
        "../scan.count",
        "/tmp/count",
        "a/../../b.c",
        "a/./b.c",
        "a//b.c",
        "a/",
        ".a/b.c",
        "a\\b.c",
        "manifest.json",
        ".hidden.h",
        "",
        "no_suffix",
    ],
)
def test_one_that_writes_elsewhere_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str) -> None:
    package = "elsewhere_" + "".join(c if c.isalnum() else "_" for c in file)
    provide(tmp_path, monkeypatch, package, f"words = {package}:FORMAT", WORKING.replace("FILE", repr(file)))
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "words")
    assert outcome.status == 2
    assert outcome.messages == [f"formats: 'words' writes {file!r}, which cannot be the name of one of its files"]
    assert not (tmp_path / "out").exists()


def test_two_that_write_the_same_file_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    provide(tmp_path, monkeypatch, "words_e", "words = words_e:FORMAT", WORKING.replace("FILE", f"'{NAME}.h'"))
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "c", "-f", "words")
    assert outcome.status == 2
    assert outcome.messages == [f"formats: 'words' writes {NAME}.h, and so does another format, with other content"]


@pytest.mark.parametrize("file", ["dac_link.h", "DAC_LINK.H", "dac_mine.rs", "Program_Loader.v"])
def test_one_that_writes_a_file_of_the_sequencer_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str
) -> None:
    """Though no other format of the build has one of this name."""
    package = "taking_" + file.replace(".", "_")
    provide(tmp_path, monkeypatch, package, f"words = {package}:FORMAT", WORKING.replace("FILE", repr(file)))
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "words")
    assert outcome.status == 2
    why = f"formats: 'words' writes {file!r}, a name of the sequencer's files: dac_*, program_loader*"
    assert outcome.messages == [why]


def test_names_that_differ_in_case_alone_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    provide(
        tmp_path, monkeypatch, "shouting", "words = shouting:FORMAT", WORKING.replace("FILE", f"'{NAME.upper()}.H'")
    )
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "c", "-f", "words")
    assert outcome.status == 2
    assert outcome.messages == [
        f"formats: 'words' writes '{NAME.upper()}.H' beside '{NAME}.h', which some disks take for one"
    ]


def test_a_format_of_others_may_bring_the_sequencer_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bringing = (
        WORKING.replace("FILE", "'scan.count'")
        + """
from tablegen.base.resources import c_runtime
type(FORMAT).runtime = lambda self: c_runtime()
"""
    )
    provide(tmp_path, monkeypatch, "bringing", "words = bringing:FORMAT", bringing)
    assert run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "words").status == 0
    assert (tmp_path / "out" / "dac_sequencer.h").exists()


def test_a_format_needs_no_more_than_three_words_and_files() -> None:
    """What a subclass has to have is what docs/formats.md says."""
    assert Format.__abstractmethods__ == {"files"}


# What fails in another package

FAILING = """
from tablegen.emit.format import Format

class Words(Format):
    name = "words"
    purpose = "how many words"
    file_names = "NAME.count"

    def files(self, content):
        BODY

FORMAT = Words()
"""


@pytest.mark.common
@pytest.mark.parametrize(
    ("body", "why"),
    [
        ("return {'scan.count': '2048'}", "files() returned an object of type str for 'scan.count'; names are text"),
        ("return {'scan.count': bytearray(3)}", "files() returned an object of type bytearray for 'scan.count'"),
        ("return {3: b''}", "files() returned the name 3; names are text, and contents bytes"),
        ("return [('scan.count', b'')]", "files() returned an object of type list; a dict of names and bytes"),
        ("return None", "files() returned an object of type NoneType"),
        ("return 1 / 0", " failed: ZeroDivisionError: division by zero"),
        ("raise SystemExit", " failed: SystemExit"),
        ("raise SystemExit(0)", " failed: SystemExit: 0"),
        ("raise SystemExit('so long')", " failed: SystemExit: so long"),
        ("raise MemoryError", " failed: MemoryError"),
        ("raise OSError(28, 'No space left on device', '/tmp/x')", " failed: OSError: "),
        ("raise GeneratorExit", " failed: GeneratorExit"),
        ("return self.files(content)", " failed: RecursionError: maximum recursion depth exceeded"),
        ("raise UnicodeDecodeError('ascii', b'\\xff', 0, 1, 'ordinal')", " failed: UnicodeDecodeError: "),
        ("raise ValueError('a\\x1b[2Jb')", " failed: ValueError: a\\x1b[2Jb"),
    ],
)
def test_one_that_fails_is_told_with_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, why: str
) -> None:
    package = f"failing_{abs(hash(body))}"
    provide(tmp_path, monkeypatch, package, f"words = {package}:FORMAT", FAILING.replace("BODY", body))
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "words")
    assert outcome.status == 2
    (told,) = outcome.messages
    assert told.startswith(f"formats: 'words' of {package}")
    assert why in told
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "source", ["raise SystemExit", "raise SystemExit(0)", "import sys; sys.exit('so long')", "raise GeneratorExit"]
)
def test_one_that_exits_as_it_is_loaded_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str) -> None:
    """It would end the build with its own status, 0 for one, and nothing would be written."""
    package = f"leaving_{abs(hash(source))}"
    provide(tmp_path, monkeypatch, package, f"broken = {package}:FORMAT", source)
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "broken")
    assert outcome.status == 2
    assert f"'broken' of {package} cannot be loaded: " in outcome.err
    listed = run("formats")
    assert (listed.status, f"cannot be used: 'broken' of {package} cannot be loaded" in listed.err) == (0, True)


def test_an_interruption_stays_one_and_says_where(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = FAILING.replace("BODY", "raise KeyboardInterrupt")
    provide(tmp_path, monkeypatch, "interrupted_1", "words = interrupted_1:FORMAT", source)
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "words")
    kept = f"{tmp_path / 'out'} was left as it was\n"
    assert (outcome.status, outcome.err) == (130, f"interrupted in 'words' of interrupted_1; {kept}")
    provide(tmp_path, monkeypatch, "interrupted_2", "other = interrupted_2:FORMAT", "raise KeyboardInterrupt")
    outcome = run("build", tmp_path / "scan.toml", "-o", tmp_path / "out", "-f", "other")
    assert (outcome.status, outcome.err) == (130, f"interrupted in 'other' of interrupted_2; {kept}")
    assert run("formats").err.lstrip() == "interrupted in 'other' of interrupted_2\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ("type(FORMAT).runtime = lambda self: ['dac.h']", " failed: AttributeError: 'str' object has no attribute"),
        ("type(FORMAT).runtime = lambda self: 1 / 0", " failed: ZeroDivisionError"),
        ("type(FORMAT).purpose = 3", ": its purpose is not a text"),
        ("del type(FORMAT).file_names", ": its file_names is not a text"),
    ],
)
def test_one_whose_other_parts_fail_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: str, why: str
) -> None:
    package = f"partly_{abs(hash(more))}"
    source = WORKING.replace("FILE", "'scan.count'") + "\n" + more
    provide(tmp_path, monkeypatch, package, f"words = {package}:FORMAT", source)
    outcome = run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "words", explains=True)
    assert outcome.status == 2
    assert f"'words' of {package}{why}" in outcome.err


def test_a_check_that_fails_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TABLEGEN_TRACEBACK")
    source = WORKING.replace("FILE", "'scan.count'") + "\ntype(FORMAT).check = lambda self, folder, content: 1 / 0"
    provide(tmp_path, monkeypatch, "unchecked", "words = unchecked:FORMAT", source)
    assert run("build", write_pair(tmp_path), "-o", tmp_path / "out", "-f", "words").status == 0
    outcome = run("verify", "--target", "files", tmp_path / "out", explains=True)
    assert outcome.status == 2
    assert "a plug-in of unchecked failed: ZeroDivisionError: division by zero\n" in outcome.err
    assert "report it to the authors of unchecked" in outcome.err
