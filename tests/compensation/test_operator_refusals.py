"""Scans that an operator cannot serve: a message for each, at its key, whatever else was refused before."""

from pathlib import Path

import pytest
from editing import run
from operator_files import operator_file, write_operator_scan
from replacing import replace

from tablegen.base.input_errors import Rejected
from tablegen.compensation.operator.file import BoucWenTable
from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan


def refusals(folder: Path, *edits: str, still: bool = False) -> list[str]:
    """The messages about a scan of the example with an operator; with ``still`` one that moves nothing."""
    file = operator_file()
    if still:
        nothing = [[0.0] * len(row) for row in file.plays.weights]
        file = replace(file, plays=replace(file.plays, weights=nothing, reversible=[0.0, 0.0]))
    with pytest.raises(Rejected) as rejected:
        make_plan(load(write_operator_scan(folder, file, *edits)))
    return [f"{problem.key}: {problem.why}" for problem in rejected.value.problems]


def test_a_size_that_the_law_refuses_and_the_operator_makes(tmp_path: Path) -> None:
    found = refusals(tmp_path, "x.size_nm = 1265.0")
    assert found == [
        "x.size_nm: 1265 nm needs 1.001 of v_max; at most 1263.56 nm fit",
        "x.hysteresis.file: the operator makes 1265 nm with 97.27 V, and [x.size] refuses them: the two "
        "contradict each other; calibrate `size` again, or lower the size",
    ]


def test_check_of_a_size_that_the_law_refuses_and_bouc_wen_makes(tmp_path: Path) -> None:
    bouc_wen = BoucWenTable(depth_nm=30.0, n=1.3, beta=6.0, gamma=-2.0, asymmetry=0.3, bend=[0.0, 0.0])
    scan = write_operator_scan(tmp_path, replace(operator_file(), bouc_wen=bouc_wen), "x.size_nm = 1265.0")
    outcome = run("check", scan)
    assert outcome.status == 2
    assert "x.size_nm: 1265 nm needs 1.001 of v_max; at most 1263.56 nm fit" in outcome.err
    assert "and [x.size] refuses them: the two contradict each other" in outcome.err


@pytest.mark.parametrize("size_nm", [1400.0, 1e5, 1e9])
def test_a_size_that_both_refuse(tmp_path: Path, size_nm: float) -> None:
    law, operator = refusals(tmp_path, f"x.size_nm = {size_nm}")
    assert law.startswith(f"x.size_nm: {size_nm:g} nm needs ")
    assert operator.startswith("x.hysteresis.file: ")
    assert "of v_max by the operator; at this offset 100 % are left" in operator


@pytest.mark.parametrize(
    ("edits", "message"),
    [
        (("- x.size_nm", "x.size_v = 120"), "x.size_v: 120 V is above v_max = 100 V"),
        (("x.offset_v = -30.0",), "x.offset_v: -30 V is outside the driver's 0..100 V, by 30 V"),
        (("x.offset_v = 1000.0",), "x.offset_v: 1000 V is outside the driver's 0..100 V, by 900 V"),
    ],
)
def test_a_drive_that_is_refused_gives_one_message(tmp_path: Path, edits: tuple[str, ...], message: str) -> None:
    assert refusals(tmp_path, *edits) == [message]


def test_an_operator_that_moves_nothing(tmp_path: Path) -> None:
    assert refusals(tmp_path, still=True) == [
        "x.hysteresis.file: at 50 V it moves by 0 nm for 10 V, and no piezo stands still or runs backwards; "
        "calibrate it again"
    ]
