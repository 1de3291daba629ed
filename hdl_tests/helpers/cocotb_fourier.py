"""Run the bench of the Fourier renderer to its end, and hold what it wrote against what was expected."""

import json
import os
from pathlib import Path

import cocotb
from cocotb.triggers import RisingEdge


def rendered(results: Path) -> list[dict[str, object]]:
    """What the bench wrote, job by job: clocks of busy and [axis, address, word] as they came."""
    jobs: list[dict[str, object]] = []
    words: list[list[int]] = []
    for line in results.read_text("ascii").splitlines():
        kind, *rest = line.split()
        assert kind in ("w", "e"), line
        numbers = [int(value) for value in rest]
        if kind == "w":
            assert numbers[0] == 1, f"a table word while not busy: {line}"
            words.append(numbers[1:])
        else:
            jobs.append({"clocks": numbers[0], "words": words})
            words = []
    assert not words, "table words after the last job"
    return jobs


# A renderer at fault may never end; the limit goes by how long the jobs ought to take.
@cocotb.test(timeout_time=int(os.environ.get("FOURIER_NANOSECONDS", "1000000")), timeout_unit="ns")
async def every_word_is_as_expected(dut: object) -> None:
    """Each word of a table once, at its address, and busy as long as the header says."""
    await RisingEdge(dut.finished)  # type: ignore[attr-defined]
    jobs = rendered(Path(os.environ["FOURIER_RESULTS"]))
    expected = json.loads(Path(os.environ["FOURIER_EXPECTED"]).read_text("ascii"))
    assert len(jobs) == len(expected)
    for i, (job, wanted) in enumerate(zip(jobs, expected, strict=True)):
        assert job["clocks"] == wanted["clocks"], f"job {i}: busy for {job['clocks']} clocks, not {wanted['clocks']}"
        if wanted["words"] is None:  # ended by a reset: what came of it by then must be right
            words = {address: word for _, address, word in job["words"]}
            assert len(words) == len(job["words"])
            for address, word in words.items():
                assert word == wanted["beginning"][address], f"job {i}: word {address}"
            continue
        assert {axis for axis, _, _ in job["words"]} == {wanted["axis"]}, f"job {i}: the wrong axis"
        assert sorted(address for _, address, _ in job["words"]) == list(range(len(wanted["words"]))), f"job {i}"
        for _, address, word in job["words"]:
            assert word == wanted["words"][address], (
                f"job {i}: word {address} is {word}, not {wanted['words'][address]}"
            )
