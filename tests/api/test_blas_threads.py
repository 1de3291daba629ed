"""Functions that fit run BLAS in one thread, as the commands do: more would spin, and a notebook has set nothing."""

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import tablegen
from tablegen.base.blas_threads import one_blas_thread


def threads() -> set[int]:
    """Threads of every BLAS that is loaded."""
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_work_runs_in_one_thread_and_gives_the_others_back() -> None:
    """Whatever the environment allows: a notebook has set nothing."""
    with threadpool_limits(2, "blas"):
        assert threads() == {2}
        assert one_blas_thread(threads)() == {1}
        assert threads() == {2}


@pytest.mark.parametrize(
    "name", ["calibrate", "calibrate_images", "calibrate_operator", "refine", "correct", "simulate"]
)
def test_what_fits_is_limited(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has the limit around all of its work."""
    assert getattr(tablegen, name).__wrapped__.__name__ == name
