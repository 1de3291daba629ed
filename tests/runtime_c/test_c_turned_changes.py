"""A scan at an angle that is moved, zoomed and turned at random while the C runtime plays it, here and in QEMU."""

from collections.abc import Callable
from pathlib import Path

import pytest
from sets import LONG_TEST
from test_c_slow_part import runtime_with
from turned_changes import Seen
from turned_sessions import CHUNK, Session, compile_bench, differs

MIPS = ("mips-linux-gnu-gcc",)
MUTANTS = {
    "a kept frame begins again": (
        "    const bool keeps = keeps_frame(s);",
        "    const bool keeps = keeps_frame(s) && s->line != 3;",
    ),
    "a program is taken in a line": (
        "    if (!s->waiting || (s->running && s->tick != 0))",
        "    if (!s->waiting || (s->running && s->tick == 7))",
    ),
    "a line keeps the words of the one before": ("    s->line_due = false;\n    dac_slow", "    return;\n    dac_slow"),
    "a guard is one code wider": ("most = bank->max_step;", "most = bank->max_step + 1;"),
    "a limit is one code wider": ("    b->code_max = p->code_max;", "    b->code_max = p->code_max + 1;"),
    "a ramp goes on in the next line": ("    axis->rise = 0;\n", "    axis->rise -= axis->rise / 8;\n"),
}


@pytest.mark.parametrize(
    ("changes", "in_qemu"),
    [
        pytest.param(300, False, marks=pytest.mark.common),
        pytest.param(300, True, marks=pytest.mark.rest),
        pytest.param(100_000, True, marks=LONG_TEST),
    ],
)
def test_every_tick_of_random_changes_is_that_of_the_model(
    changes: int, in_qemu: bool, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """By steps and by fills of this machine, and in QEMU of a big-endian one of 32 bits."""
    devices = [(compile_bench(tmp_path / "host"), None)]
    if in_qemu:
        devices.append((compile_bench(tmp_path / "mips", MIPS, ("-static",)), "qemu-mips"))
    seen = Seen()
    for chunk, left in enumerate(range(changes, 0, -CHUNK)):
        session = Session([changes, chunk, 1], min(left, CHUNK))
        for program, emulator in devices:
            assert differs(program, session, emulator) is None
        seen.counts += session.follow().counts
    record_property("seen", str(seen))
    assert seen.counts["goes on"] > 0.8 * changes


@pytest.fixture(scope="module")
def session() -> Session:
    return Session(3, 150)


@pytest.mark.rest
@pytest.mark.parametrize("name", MUTANTS)
def test_a_fault_is_found(name: str, session: Session, tmp_path: Path) -> None:
    """The control: of a runtime with it some tick is another."""
    runtime = runtime_with(dict([MUTANTS[name]]), tmp_path / "runtime")
    difference = differs(compile_bench(tmp_path / "bench", runtime=runtime), session)
    assert difference is not None
    assert difference.startswith("tick ")


@pytest.mark.rest
def test_a_line_of_two_programs_is_found(session: Session, tmp_path: Path) -> None:
    """The control of the memory: words of the next program are written over those of the one that plays."""
    bench = compile_bench(tmp_path / "bench", options=("-DONE_MEMORY=1",))
    difference = differs(bench, session)
    assert difference is not None
    assert difference.startswith("tick ")
