"""Linear algebra in one thread: the matrices of fits are small, and further threads of BLAS would only spin."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def one_blas_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function, so that BLAS has one thread while it runs, and as many as before when it returns."""

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with blas_limited():
            return function(*args, **kwargs)

    return limited


@contextmanager
def blas_limited() -> Iterator[None]:
    """Limit BLAS to one thread; without threadpoolctl, of the extra ``calibrate``, nothing is limited."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        yield
        return
    with suppress(ImportError):
        import scipy.linalg  # noqa: F401 -- its own BLAS has to be loaded to be limited
    with threadpool_limits(limits=1, user_api="blas"):
        yield
