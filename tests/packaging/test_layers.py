"""The one direction of imports, and what the independent side may not load."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import tablegen

PACKAGE = Path(tablegen.__file__).parent
# From the lowest to the highest; a module imports from its own layer and from those before it.
LAYERS = (
    "version",
    "base",
    "numerics",
    "waveform",
    "compensation",
    "config",
    "fixedpoint",
    "device",
    "planning",
    "certificate",
    "manifest",
    "emit",
    "library",
    "link",
    "verification",
    "charts",
    "fitting",
    "images",
    "calibration",
    "refinement",
    "virtual",
    "correction",
    "html_report",
    "comparison",
    "api",
    "sweeping",
    "cli",
    "__main__",
)
LEVELS = {name: level for level, names in enumerate(LAYERS) for name in names.split()}


def modules() -> dict[str, Path]:
    """Every module of the package by its name without ``tablegen.``; packages by their folder."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return {name: path for name, path in found.items() if name}


def imported(source: str, known: dict[str, Path]) -> Iterator[tuple[str, bool]]:
    """Modules of the package that a source imports, and whether it does as soon as it is loaded itself."""
    tree = ast.parse(source)
    at_once = {id(node) for node in tree.body}
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name.removeprefix("tablegen.") in known else str(node.module) for name in whole]
        for name in names:
            if name.startswith("tablegen."):
                yield name.removeprefix("tablegen."), id(node) in at_once


def upward(sources: dict[str, str], known: dict[str, Path]) -> list[str]:
    """Imports from a lower layer to a higher one."""
    return [
        f"{name} imports {other}"
        for name, source in sources.items()
        for other, _ in imported(source, known)
        if LEVELS[other.split(".")[0]] > LEVELS[name.split(".")[0]]
    ]


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Names that reach themselves, each with its way back; empty without a circle."""
    found, done = [], set()

    def visit(name: str, way: list[str]) -> None:
        if name in way:
            found.append([*way[way.index(name) :], name])
        elif name not in done:
            for other in sorted(graph.get(name, ())):
                visit(other, [*way, name])
            done.add(name)

    for name in sorted(graph):
        visit(name, [])
    return found


def test_every_package_has_a_layer() -> None:
    assert {name.split(".")[0] for name in modules()} == set(LEVELS)


def test_imports_go_one_way() -> None:
    known = modules()
    assert upward({name: path.read_text("utf-8") for name, path in known.items()}, known) == []


def test_an_import_that_goes_back_is_found() -> None:
    known = modules()
    assert upward({"config.load": "def late():\n    from tablegen.planning import line_plan\n"}, known) == [
        "config.load imports planning.line_plan"
    ]
    assert upward({"device.sequencer": "import tablegen.emit.render"}, known) == [
        "device.sequencer imports emit.render"
    ]


def test_no_modules_import_each_other_in_a_circle() -> None:
    known = modules()
    graph = {name: {other for other, _ in imported(path.read_text("utf-8"), known)} for name, path in known.items()}
    assert circles(graph) == []
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}}) == [["a", "b", "c", "a"]]


# What may name a model's own classes: the models and their fits. Others ask ``Hysteresis`` and ``LineShape``.
OPERATORS_HOMES = ("compensation.", "calibration.operator.")
OPERATOR_MODEL = "compensation.models.operator"
OPERATOR_CLASSES = {"OperatorIdentification", "OperatorModel", "OperatorPiezo"}


def naming_the_operator(sources: dict[str, str], known: dict[str, Path]) -> list[str]:
    """Modules outside of its homes that import the operator's model, or that have the name of one of its classes."""
    outside = {name: source for name, source in sources.items() if not name.startswith(OPERATORS_HOMES)}
    offences = []
    for name, source in outside.items():
        if any(other == OPERATOR_MODEL for other, _ in imported(source, known)):
            offences.append(f"{name} imports {OPERATOR_MODEL}")
        used = {node.id for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Name)}
        offences += [f"{name} names {one}" for one in sorted(OPERATOR_CLASSES & used)]
    return offences


@pytest.mark.common
def test_only_its_homes_name_the_operators_model() -> None:
    known = modules()
    sources = {name: path.read_text("utf-8") for name, path in known.items()}
    assert naming_the_operator(sources, known) == []
    defined = {
        node.name
        for name, source in sources.items()
        if name.startswith("compensation.")
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ClassDef)
    }
    assert defined >= OPERATOR_CLASSES


@pytest.mark.parametrize(
    ("name", "source", "offence"),
    [
        (
            "html_report.usable",
            "def late(shape):\n    from tablegen.compensation.models.operator import MODEL\n",
            f"html_report.usable imports {OPERATOR_MODEL}",
        ),
        (
            "comparison.side",
            "from tablegen.compensation.models import operator",
            f"comparison.side imports {OPERATOR_MODEL}",
        ),
        ("calibration.summary", f"import tablegen.{OPERATOR_MODEL}", f"calibration.summary imports {OPERATOR_MODEL}"),
        ("virtual.own_run", "isinstance(table, OperatorModel)", "virtual.own_run names OperatorModel"),
    ],
)
def test_a_module_elsewhere_that_names_the_operators_model_is_found(name: str, source: str, offence: str) -> None:
    assert naming_the_operator({name: source}, modules()) == [offence]
    assert naming_the_operator({"calibration.operator.advice": source}, modules()) == []


def loaded_by(code: str) -> set[str]:
    """The modules that are loaded once a new interpreter has run this."""
    script = f"import sys\n{code}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


CALCULATION = {"tablegen.compensation", "tablegen.waveform", "tablegen.planning", "jinja2"}


@pytest.mark.common
@pytest.mark.parametrize(
    "module",
    [
        "tablegen.manifest.read",
        "tablegen.device.sequencer",
        "tablegen.device.registers",
        "tablegen.verification.checks.played_checks",
        "tablegen.verification.checks.directory",
        "tablegen.verification.build_report",
        "tablegen.verification.verilog.target",
        "tablegen.verification.c.target",
        "tablegen.link.players",
        "tablegen.link.model_device",
    ],
)
def test_the_independent_side_loads_no_calculation(module: str) -> None:
    """What reads, plays or checks a build shares the integers with what made it, and nothing before them."""
    loaded = loaded_by(f"import {module}")
    assert module in loaded
    assert loaded & CALCULATION == set()


@pytest.mark.common
def test_the_calculation_would_be_seen() -> None:
    assert loaded_by("import tablegen.planning.line_plan") >= CALCULATION - {"jinja2"}
    assert "jinja2" in loaded_by("from tablegen.emit.templates import template_text\ntemplate_text('', {}, str)")


@pytest.mark.parametrize("module", ["tablegen", "tablegen.cli", "tablegen.cli.device.status", "tablegen.link.device"])
def test_what_answers_at_once_loads_no_numpy(module: str) -> None:
    assert "numpy" not in loaded_by(f"import {module}")


SELDOM = {
    "tablegen.certificate.remedies",
    "tablegen.compensation.operator.loop",
    "tablegen.compensation.response_file",
    "tablegen.planning.table_search",
    "tablegen.html_report",
    "tablegen.verification",
    "tablegen.waveform.closed_form",
    "tablegen.waveform.minimum_acceleration",
    "importlib.metadata",
    "numpy.typing",
}


@pytest.mark.common
def test_a_plain_build_loads_nothing_that_few_builds_need() -> None:
    example = PACKAGE.parent / "examples" / "annexin_200nm.toml"
    loaded = loaded_by(f"import tablegen\ntablegen.build({str(example)!r}).files")
    assert "tablegen.emit.formats.verilog" in loaded
    assert loaded & SELDOM == set()
    # Each definition of a dataclass compiles its methods: some 0.4 % of a build, where a struct takes a tenth of that.
    own = [path for name, path in modules().items() if f"tablegen.{name}" in loaded]
    assert len(own) > 100
    assert [path for path in own if "from dataclasses" in path.read_text("utf-8")] == []


def test_a_class_name_stands_for_one_thing() -> None:
    """In the package, and the more so beside each other in one file's imports."""
    homes: dict[str, list[str]] = {}
    for name, path in modules().items():
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(name)
    assert {name: where for name, where in homes.items() if len(where) > 1} == {}
    assert len(homes) > 100
