"""Which parameters of a test are in which set of tests; ``tests/README.md`` tells what the sets are."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest

LONG_TEST = (pytest.mark.long, pytest.mark.timeout(86_400))
# Beginnings of names of tools and dialects.
_COMMON = ("clang", "g++", "gcc-c++", "gcc-c11", "gcc-c99-32", "gcc_", "ghdl")
_REST = ("cppcheck", "zig")


def by_tool(names: Iterable[str]) -> list[Any]:
    """Parameters that name a tool: ``gcc`` and Icarus are quick, others common or of the rest."""
    marked = []
    for name in names:
        marks = [pytest.mark.common] if name.startswith(_COMMON) else []
        marks += [pytest.mark.rest] if name.startswith(_REST) else []
        marked.append(pytest.param(name, marks=marks))
    return marked


def quick(few: Collection[Any], parameters: Iterable[Any]) -> list[Any]:
    """Parameters of which a few are quick; with the others the test is common."""
    return _divided(few, parameters, pytest.mark.common)


def common(few: Collection[Any], parameters: Iterable[Any]) -> list[Any]:
    """Parameters of which a few are as the test is; with the others it is of the rest."""
    return _divided(few, parameters, pytest.mark.rest)


def _divided(few: Collection[Any], parameters: Iterable[Any], others: pytest.MarkDecorator) -> list[Any]:
    every = list(parameters)
    assert set(few) <= set(every)
    return [each if each in few else pytest.param(each, marks=others) for each in every]
