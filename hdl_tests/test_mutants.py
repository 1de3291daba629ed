"""Tests of the tests: every mutant of the Verilog is found by the bench that plays it; the Verilog itself is not."""

from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from mutants import Verdict
from programs import random_dual
from sets import long
from stream_mutants import BENCHES, MUTANTS, SHAPES, Mutant, bench_of, judge, script_of

from tablegen.verification.play.stream import Script

FIRSTS = {name: mutant for mutant in reversed(MUTANTS) for name in (f"{mutant.file}.v", mutant.where)}
SOME = [*MUTANTS[::16], *FIRSTS.values()]  # with the first of each module and of each bench
# A bench of each kind of axis; a slow part is played by `test_stream_slow` in the rest.
AS_IT_IS = ("digits", "low area", "second", "pixel tables", "pair sweep", "cubic")


@pytest.mark.rest
@pytest.mark.parametrize("name", long(AS_IT_IS, BENCHES))
def test_the_verilog_as_it_is_passes(name: str, tmp_path: Path) -> None:
    assert judge(None, tmp_path, name) == Verdict(False, "")


@pytest.mark.long
@pytest.mark.timeout(86_400)
@pytest.mark.parametrize("name", BENCHES)
def test_it_passes_in_the_bench_of_the_streams_too(name: str, tmp_path: Path) -> None:
    played = bench_of(name, tmp_path).play(script_of(name))
    assert played.equal, played


def test_the_documentation_counts_them() -> None:
    page = REPOSITORY / "docs" / "verilog.md"
    assert f"{len(MUTANTS)} faults put into the Verilog" in page.read_text("utf-8")


def test_no_mutant_is_listed_twice() -> None:
    assert len({(mutant.file, mutant.old, mutant.new, mutant.where) for mutant in MUTANTS}) == len(MUTANTS) > 100
    assert all(mutant.source for mutant in MUTANTS)


@pytest.mark.rest
@pytest.mark.parametrize("mutant", long(SOME, MUTANTS), ids=lambda mutant: f"{mutant.file}: {mutant.breaks}")
def test_every_mutant_is_found(mutant: Mutant, tmp_path: Path) -> None:
    assert judge(mutant, tmp_path).killed


@pytest.mark.rest
def test_a_strobe_that_is_late_at_times_is_found_by_its_time(tmp_path: Path) -> None:
    """Ticks are so far apart that its codes and markers are right all the same."""
    late = "reg late = 0;\n    always @(posedge clock) begin\n        late <= tick && line;"
    old, new = (
        "    always @(posedge clock) begin\n        strobe <= tick;",
        "        strobe <= (tick && !line) || late;",
    )
    mutant = Mutant("a line's first strobe is a clock late", "dac_verdict", old, f"    {late}\n{new}", "plain")
    bench, script = bench_of("plain", tmp_path, mutant), Script()
    program = random_dual(np.random.default_rng(1), SHAPES["plain"], kind="tame")
    script.load(program)
    script.request("commit", program=program)
    script.tick_every(5)
    script.wait_ticks(2)
    script.request("arm", "trigger")
    script.wait_ticks(200)
    played = bench.play(script)
    assert played.mismatch is None
    assert played.jitter > 0
