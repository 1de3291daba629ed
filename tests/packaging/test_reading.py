"""Files of users are read in one place, and one place writes to the terminal: what would go round them is named."""

import ast
from pathlib import Path

import pytest

import tablegen
from tablegen.base.reading import KINDS, size_shown

PACKAGE = Path(tablegen.__file__).parent
METHODS = {"open", "read_text", "read_bytes"}  # of paths
FUNCTIONS = {
    *("os.open", "os.fdopen", "io.open", "shutil.copyfile", "shutil.copy", "json.load", "tomllib.load", "Pillow.open"),
    *("np.load", "np.loadtxt", "np.genfromtxt", "np.fromfile", "np.memmap"),
}
MODULES = {name.split(".")[0] for name in FUNCTIONS}
# What reads files, and why it may: by file and by what is called.
ALLOWED = {
    ("__init__.py", "read_text"): "its own stub, which ships with the package",
    ("base/reading.py", "os.open"): "the one reader",
    ("base/workers.py", "os.fdopen"): "its own stdout, for results",
    ("emit/write.py", "os.open"): "a directory, to bring it to the disk",
    ("emit/write.py", "os.fdopen"): "what it has just made, to write it",
    ("base/directory_lock.py", "os.open"): "a directory, to lock it",
    ("emit/render.py", "read_bytes"): "the runtime, which ships with the package",
    ("verification/process_group.py", "open"): "its own log",
    ("verification/process_group.py", "read_text"): "its own log and outcome",
    ("verification/verilog/sequencer_bench.py", "read_text"): "its own record",
    ("verification/play/stream.py", "read_text"): "its own record",
    ("verification/verilog/simulate.py", "read_text"): "the log of a simulator",
    ("base/user_cache.py", "shutil.copy"): "what was compiled; a copy is held against its name",
    ("verification/c/elf.py", "open"): "what it has compiled",
    ("verification/c/play.py", "open"): "its own record, to write it",
    ("verification/c/play.py", "read_bytes"): "its own script",
    ("verification/c/emulated.py", "read_text"): "its own script",
    ("verification/verilog/bench.py", "read_text"): "its own record",
    ("verification/checks/listing.py", "read_bytes"): "the runtime, which ships with the package",
    ("verification/checks/directory.py", "shutil.copyfile"): "files of a build, which read_build has found to be files",
    ("verification/verilog/target.py", "shutil.copyfile"): "as in directory.py",
    ("link/transport.py", "open"): "a serial port",
    ("planning/frame_costs.py", "read_text"): "its own counts, which ship with the package",
    ("planning/table_costs.py", "read_text"): "its own counts, which ship with the package",
    ("html_report/document.py", "read_text"): "its template, style and script, which ship with the package",
    ("calibration/tables/csv_blocks.py", "np.loadtxt"): "bytes that were read already",
    ("images/formats/picture.py", "Pillow.open"): "bytes that were read already",
}
PARSERS = {"json.loads", "tomllib.loads", "tomlkit.parse", "msgspec.json.decode"}
PARSED = {
    ("planning/frame_costs.py", "json.loads"): "its own counts, which ship with the package",
    ("planning/table_costs.py", "json.loads"): "its own counts, which ship with the package",
    ("manifest/format.py", "json.loads"): "the one reader of manifests",
    ("cli/device/live.py", "json.loads"): "a request, a line of bounded length",
    ("base/toml.py", "tomllib.loads"): "the one reader of TOML, which has bounded the keys",
    ("calibration/scanner_file.py", "tomllib.loads"): "text that parse_toml has read",
    ("calibration/scanner_file.py", "tomlkit.parse"): "text that parse_toml has read",
    ("refinement/scan_file.py", "tomllib.loads"): "text that parse_toml has read",
    ("refinement/scan_file.py", "tomlkit.parse"): "text that parse_toml has read",
    ("api/refine.py", "msgspec.json.decode"): "what was encoded just before",
    ("verification/process_group.py", "json.loads"): "its own job and outcome",
    ("verification/verilog/sequencer_bench.py", "json.loads"): "its own record",
}


def called(tree: ast.AST) -> set[str]:
    """What a module calls: functions by their whole name, methods by theirs after a dot."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            text = ast.unparse(node.func)
            before, _, last = text.rpartition(".")
            found.add(text if not before or before.replace(".", "").isidentifier() else f".{last}")
    return found


def of_the_package() -> dict[str, ast.AST]:
    paths = (path for path in PACKAGE.rglob("*.py") if not {"firmware_templates", "examples"} & {*path.parts})
    return {path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text("utf-8")) for path in paths}


@pytest.fixture(scope="module")
def modules() -> dict[str, ast.AST]:
    return of_the_package()


def around_the_reader(modules: dict[str, ast.AST]) -> set[tuple[str, str]]:
    """Calls that read files by other ways than the one reader, whose functions have no dot before them."""
    found = set()
    for module, tree in modules.items():
        for name in called(tree):
            before, _, last = name.rpartition(".")
            if name == "open" or name in FUNCTIONS:
                found.add((module, name))
            elif "." in name and last in METHODS and before not in MODULES:
                found.add((module, last))
    return found


@pytest.mark.common
def test_every_file_of_a_user_goes_through_the_one_reader(modules: dict[str, ast.AST]) -> None:
    assert sorted(around_the_reader(modules) - ALLOWED.keys()) == []


@pytest.mark.common
def test_no_exception_is_out_of_date(modules: dict[str, ast.AST]) -> None:
    assert sorted(ALLOWED.keys() - around_the_reader(modules)) == []


@pytest.mark.common
def test_texts_are_parsed_where_they_are_bounded(modules: dict[str, ast.AST]) -> None:
    found = {(name, call) for name, tree in modules.items() for call in called(tree) & PARSERS}
    assert found == PARSED.keys()


@pytest.mark.parametrize(
    "text",
    [
        *("open(path)", "path.open('rb')", "path.read_bytes()", "(folder / name).read_text('utf-8')", "np.load(path)"),
        *("np.fromfile(path)", "io.open(path)", "os.open(path, 0)"),
        "from tablegen.base.reading import read_text\nread_text(a, B)\npath.read_text()",
        "files[0].open()",
    ],
)
def test_another_way_is_found(text: str) -> None:
    """Negative control."""
    assert around_the_reader({"cli/new.py": ast.parse(text)})


@pytest.mark.common
def test_only_one_module_writes_controls(modules: dict[str, ast.AST]) -> None:
    """No style, no print, no escape but in ``cli/shared/terminal.py``; what click prints goes through its guard."""
    steering = {"click.style", "click.secho", "click.clear", "print", "sys.stdout.write", "sys.stderr.write"}
    found = {(name, call) for name, tree in modules.items() for call in called(tree) & steering}
    assert found == set()
    escapes = {
        name
        for name, tree in modules.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and {"\x1b", "\r"} & {*node.value}
        if name.startswith("cli/") and node.value != "\r\n"
    }
    assert escapes == {"cli/shared/terminal.py"}


def test_the_page_of_inputs_has_every_limit() -> None:
    page = (Path(__file__).parents[2] / "docs" / "inputs.md").read_text("utf-8")
    table = [line.strip("| ").split(" | ") for line in page.splitlines() if line.endswith(("iB |", "KiB |"))]
    assert [tuple(row) for row in table] == [(kind.what, size_shown(kind.most_bytes)) for kind in KINDS]
