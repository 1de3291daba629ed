"""Producer and consumer on two threads: no line of two programs, no access that no fence orders."""

from pathlib import Path

import pytest
from c_threads import compile_threads, play
from sets import by_tool

from tablegen.base.resources import c_runtime

PROGRAMS = 8_000


@pytest.mark.common
@pytest.mark.parametrize("sanitized", [False, pytest.param(True, marks=pytest.mark.rest)], ids=["plain", "tsan"])
@pytest.mark.parametrize("compiler", by_tool(["gcc", "clang"]))
def test_every_line_is_of_one_program(compiler: str, sanitized: bool, tmp_path: Path) -> None:
    program = compile_threads(tmp_path, compiler, sanitized, options=() if sanitized else ("-O2",))
    done = play(program, PROGRAMS, 1)
    assert done.returncode == 0, done.stdout + done.stderr[:4000]
    swaps, lines, *_ = map(int, done.stdout.split())
    assert swaps > PROGRAMS // 2  # two thirds of them are not withdrawn
    assert lines > 0


@pytest.mark.rest
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("return s->playing == 0 ? 1 : 0;", "return s->playing == 0 ? 0 : 1;"),
        ("if (s->commits_answered != s->commits)", "if (false)"),
    ],
    ids=["the tables that play are written", "a commit in the queue is not waited for"],
)
def test_a_broken_protocol_is_found(old: str, new: str, tmp_path: Path) -> None:
    """By the lines themselves or by the sanitizer."""
    runtime = []
    for path in c_runtime():
        text = path.read_text("utf-8")
        if path.name == "dac_sequencer.c":
            assert text.count(old) == 1
            text = text.replace(old, new)
        runtime.append(tmp_path / path.name)
        runtime[-1].write_text(text)
    done = play(compile_threads(tmp_path / "program", "gcc", True, runtime), PROGRAMS, 1)
    assert done.returncode in (1, 66), done.stdout
