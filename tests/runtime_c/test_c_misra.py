"""The list of deviations from MISRA C:2012 in the documentation: what cppcheck's addon reports, no more and no less."""

import re
from pathlib import Path

import pytest
from building import REPOSITORY, run, tool
from sets import long

from tablegen.base.resources import c_link, c_runtime, c_store

pytestmark = pytest.mark.rest

OPTIONS = (
    (),
    ("-DDAC_TABLE_STORAGE_BITS=32",),
    ("-DDAC_SPLINE=1", "-DDAC_STORE=1", "-DDAC_LIBRARY=2"),
    ("-DDAC_COMMIT_MODES=1", "-DDAC_LIBRARY=1"),
    ("-DDAC_MOVE=1",),
    ("-DDAC_LINK_Z=1", "-DDAC_COMMIT_MODES=1"),
    ("-DDAC_SLOW_PART=1", "-DDAC_SPLINE=1"),
    ("-DDAC_SLOW_PART=1", "-DDAC_LONG_MULTIPLY=0"),
    ("-DDAC_LONG_MULTIPLY=0", "-DDAC_SMALL=1", "-DDAC_TABLE_STORAGE_BITS=32"),
)
# All macros in four runs, which report every rule; each run takes ten seconds.
FEW = (
    (),
    (
        "-DDAC_LONG_MULTIPLY=0", "-DDAC_SLOW_PART=1", "-DDAC_SPLINE=1", "-DDAC_STORE=1", "-DDAC_LIBRARY=2",
        "-DDAC_MOVE=1",
    ),
    (
        "-DDAC_LONG_MULTIPLY=0", "-DDAC_SMALL=1", "-DDAC_TABLE_STORAGE_BITS=32", "-DDAC_COMMIT_MODES=1",
        "-DDAC_LIBRARY=1",
    ),
    ("-DDAC_LINK_Z=1", "-DDAC_COMMIT_MODES=1", "-DDAC_SLOW_PART=1", "-DDAC_PIXEL_TABLE=1"),
)  # fmt: skip


def reported(sources: list[Path], *options: str) -> set[str]:
    """Rules that the addon finds broken; it fails where it reports anything else."""
    folders = sorted({str(path.parent) for path in sources})
    done = run(
        [tool("cppcheck"), "--addon=misra", "--std=c99", "-q", "-D__GNUC__=12", *options,
         *(f"-I{folder}" for folder in folders), *(path for path in sources if path.suffix == ".c")]
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    others = [line for line in done.stderr.splitlines() if re.search(r": (error|warning|portability)", line)]
    assert not others, others
    return set(re.findall(r"\[misra-c2012-([\d.]+)\]", done.stderr))


def documented() -> set[str]:
    text = (REPOSITORY / "docs" / "misra.md").read_text("utf-8")
    return set(re.findall(r"^\| (\d+\.\d+) \| (?:advisory|required) \| ", text, re.MULTILINE))


@pytest.mark.parametrize("choices", long([FEW], [FEW, OPTIONS]), ids=["few", "all"])
def test_the_deviations_are_those_of_the_documentation(choices: tuple[tuple[str, ...], ...]) -> None:
    found = set().union(*(reported([*c_runtime(), *c_link(), *c_store()], *options) for options in choices))
    assert found == documented()


def test_another_deviation_is_seen(tmp_path: Path) -> None:
    """The control: a function with a goto, which the runtime has not."""
    path = tmp_path / "faulty.c"
    path.write_text("int f(int n);\nint f(int n)\n{\nagain:\n    if (n-- > 0)\n        goto again;\n    return n;\n}\n")
    assert {"15.1", "15.2"} & (reported([path]) - documented())
