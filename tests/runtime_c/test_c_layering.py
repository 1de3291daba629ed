"""No circles in the C runtime: neither do files call each other in a circle, nor do they include each other in one."""

import re
from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from building import run_clean
from sets import long

from tablegen.base.resources import c_link, c_runtime, c_store

EVERYTHING = [*c_runtime(), *c_link(), *c_store()]
# Their types stand below everything, the functions that they declare above.
WRITTEN = {"tablegen_options.h"}  # by a build in the formats of some packages
PUBLIC = {"dac_sequencer.h", "dac_link.h", "dac_store.h"}
Graph = Mapping[str, set[str]]
# What these compile makes other calls.
CHOICES = {
    "default": [],
    "small": ["-DDAC_SMALL=1"],
    "no_long_multiplication": ["-DDAC_LONG_MULTIPLY=0"],
    "spline": ["-DDAC_SPLINE=1"],
    "shaped": ["-DDAC_SHAPING=3"],
    "commit_modes": ["-DDAC_COMMIT_MODES=1"],
    "slow_part": ["-DDAC_SLOW_PART=1"],
    "store": ["-DDAC_STORE=1", "-DDAC_LIBRARY=2"],
    "moves": ["-DDAC_MOVE=1"],
}


def circle(graph: Graph) -> list[str]:
    """One of a graph, its first name once more at its end; empty if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def calls(paths: Iterable[Path], folder: Path, *options: str) -> Graph:
    """Of each .c the others that define what it asks for, as the compiler has them: what nobody defines is left out."""
    sources = [path for path in paths if path.suffix == ".c"]
    run_clean(["cc", "-std=c99", "-O0", *options, "-c", *sources], folder)
    defined, wanted = {}, {}
    for source in sources:
        symbols = [line.split()[-2:] for line in run_clean(["nm", folder / f"{source.stem}.o"]).splitlines()]
        defined.update({name: source.name for kind, name in symbols if kind.isupper() and kind != "U"})
        wanted[source.name] = [name for kind, name in symbols if kind == "U"]
    return {file: {defined[name] for name in names if name in defined} for file, names in wanted.items()}


def includes(paths: Iterable[Path]) -> Graph:
    """Of each file what it includes by a name in quotation marks; what a build writes includes nothing."""
    pattern = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)"', re.MULTILINE)
    return {path.name: set(pattern.findall(path.read_text("utf-8"))) - WRITTEN for path in paths}


def modules(graph: Graph, public: Iterable[str] = PUBLIC) -> Graph:
    """Join each private header with the source of its name, in a graph of what files include."""
    of_file = {name: name if name in public else name.rpartition(".")[0] for name in graph}
    joined: dict[str, set[str]] = {module: set() for module in of_file.values()}
    for name, included in graph.items():
        joined[of_file[name]] |= {of_file[other] for other in included} - {of_file[name]}
    return joined


@pytest.mark.common
@pytest.mark.parametrize("choice", long(["default", "shaped", "slow_part", "store"], CHOICES))
def test_files_do_not_call_each_other_in_a_circle(choice: str, tmp_path: Path) -> None:
    found = calls(EVERYTHING, tmp_path, *CHOICES[choice])
    assert circle(found) == []
    assert found["dac_link.c"] >= {"dac_link_upload.c", "dac_link_answer.c", "dac_sequencer.c"}
    assert found["dac_link_upload.c"] >= {"dac_link_check.c", "dac_link_answer.c"}
    assert found["dac_link_frame.c"] == set()


def test_files_do_not_include_each_other_in_a_circle() -> None:
    found = includes(EVERYTHING)
    assert circle(found) == []
    assert found["dac_link_parts.h"] == {"dac_link.h"}
    assert set().union(*found.values()) == {path.name for path in EVERYTHING if path.suffix == ".h"}


def test_modules_do_not_include_each_other_in_a_circle() -> None:
    """What a source includes does not include its header: inline arithmetic stands below the functions of an axis."""
    graph = modules(includes(EVERYTHING))
    assert circle(graph) == []
    assert graph["dac_axis"] >= {"dac_run", "dac_short", "dac_shaping", "dac_slow"}
    assert graph["dac_arithmetic"] == {"dac_sequencer.h"}


@pytest.mark.common
def test_a_circle_of_calls_is_found(tmp_path: Path) -> None:
    """The control: three files, of which the last calls the first; then without that call."""
    paths = [tmp_path / name for name in ("top.c", "middle.c", "bottom.c")]
    paths[0].write_text("int middle(void);\nint top(void);\nint top(void)\n{\n    return middle();\n}\n")
    paths[1].write_text("int bottom(void);\nint middle(void);\nint middle(void)\n{\n    return bottom();\n}\n")
    paths[2].write_text("int top(void);\nint bottom(void);\nint bottom(void)\n{\n    return top();\n}\n")
    assert set(circle(calls(paths, tmp_path))) == {"top.c", "middle.c", "bottom.c"}
    paths[2].write_text("int bottom(void);\nint bottom(void)\n{\n    return 0;\n}\n")
    found = calls(paths, tmp_path)
    assert found == {"top.c": {"middle.c"}, "middle.c": {"bottom.c"}, "bottom.c": set()}
    assert circle(found) == []


def test_a_circle_of_includes_is_found(tmp_path: Path) -> None:
    """The control; a header that includes itself is one as well."""
    one, other = tmp_path / "one.h", tmp_path / "other.h"
    one.write_text('#include <stdint.h>\n#include "other.h"\n')
    other.write_text('  # include "one.h"\n')
    assert set(circle(includes([one, other]))) == {"one.h", "other.h"}
    other.write_text('#include "other.h"\n')
    assert set(circle(includes([one, other]))) == {"other.h"}
    other.write_text("#include <one.h>\n")
    assert circle(includes([one, other])) == []


def test_a_circle_of_modules_is_found(tmp_path: Path) -> None:
    """The control: a header without a circle of its own, included by what the source of its name includes."""
    source, header, loops = tmp_path / "axis.c", tmp_path / "axis.h", tmp_path / "run.h"
    source.write_text('#include "axis.h"\n#include "run.h"\n')
    header.write_text("")
    loops.write_text('#include "axis.h"\n')
    graph = includes([source, header, loops])
    assert circle(graph) == []
    assert set(circle(modules(graph))) == {"axis", "run"}
    assert circle(modules(graph, public=["axis.h"])) == []
    loops.write_text("")
    assert circle(modules(includes([source, header, loops]))) == []
