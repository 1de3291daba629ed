"""Which parameters of a test are in which set of tests; ``tests/README.md`` tells what the sets are."""

from collections.abc import Collection, Iterable, Sequence
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


def long(few: Collection[Any], parameters: Iterable[Any]) -> list[Any]:
    """Return parameters of which a few are as the test is; with the others it is of ``make test-long``."""
    return _divided(few, parameters, *LONG_TEST)


def one_of(number: int, parameters: Iterable[Any], names: int = 1) -> list[Any]:
    """Return parameters of which each first of a number is as the test is; with the others it is of ``make test-long``.

    ``names`` is the number of names that the test gives to a parameter.
    """
    values = [tuple(each) if names > 1 else (each,) for each in parameters]
    return [pytest.param(*each, marks=LONG_TEST if index % number else ()) for index, each in enumerate(values)]


def common_of(number: int, few: Collection[Any], parameters: Iterable[Any]) -> list[Any]:
    """Return parameters of which a few are as the test is, and of the others one of a number is of the rest.

    With all further ones the test is of ``make test-long``.
    """
    every = list(parameters)
    return common_and_rest(few, [each for each in every if each not in few][::number], every)


def common_and_rest(few: Collection[Any], some: Collection[Any], parameters: Iterable[Any]) -> list[Any]:
    """Return parameters of which a few are as the test is, and some of the others of the rest.

    With all further ones the test is of ``make test-long``.
    """
    every = list(parameters)
    marked = _divided(few, [each for each in every if each in few or each in some], pytest.mark.rest)
    return marked + _divided((), [each for each in every if each not in few and each not in some], *LONG_TEST)


def in_pairs(names: Sequence[str], others: Sequence[str], whole: Collection[str], always: str) -> list[Any]:
    """Return pairs of a name and another, marked for the sets of both.

    Names that are ``whole`` are there with every other, each further name with the one that is ``always`` there and
    one more, in turn. All further pairs are of ``make test-long``: they would find a fault that shows neither in
    another pair of the name nor in another pair of the other.
    """
    assert set(whole) <= set(names)
    turns = [other for other in others if other != always]
    tools = dict(zip(others, by_tool(others), strict=True))
    pairs = []
    for index, name in enumerate(names):
        for other in others:
            marks = list(tools[other].marks)
            if not (name in whole or other in (always, turns[index % len(turns)])):
                marks += LONG_TEST
            pairs.append(pytest.param(name, other, marks=marks))
    return pairs


def _divided(few: Collection[Any], parameters: Iterable[Any], *others: pytest.MarkDecorator) -> list[Any]:
    every = list(parameters)
    assert set(few) <= set(every)
    return [each if each in few else pytest.param(each, marks=others) for each in every]
