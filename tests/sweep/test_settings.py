"""``--set KEY=VALUES``: ranges as a person expects them, lists, words; and what is refused."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.config.settings import MOST_VALUES, Setting, parse_setting
from tablegen.config.settings import check_repeated_keys as check_together


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("50:1000:50", tuple(range(50, 1001, 50))),
        ("10,50,90", (10, 50, 90)),
        ("0.1:0.5:0.1", (0.1, 0.2, 0.3, 0.4, 0.5)),
        ("1:2:0.3", (1.0, 1.3, 1.6, 1.9)),
        ("3:1:-1", (3, 2, 1)),
        ("-2:2:2", (-2, 0, 2)),
        ("5:5:1", (5,)),
        ("1e3:3e3:1e3", (1000, 2000, 3000)),
        ("1,4:6:1,9", (1, 4, 5, 6, 9)),
        ("window,truncate", ("window", "truncate")),
        ("'a, b',c d", ("a, b", "c d")),
        ("'50:100:50'", ("50:100:50",)),
        ("scanner.toml,../b.toml", ("scanner.toml", "../b.toml")),
        ("[0.1, 0.9],[0.2, 0.8]", ([0.1, 0.9], [0.2, 0.8])),
        ("true,false", (True, False)),
        ("c:\\scanner.toml", ("c:\\scanner.toml",)),
    ],
)
def test_values_are_those_that_a_person_expects(text: str, values: tuple[object, ...]) -> None:
    found = parse_setting(f"x.key={text}").values
    assert found == values
    assert [type(value) for value in found] == [type(value) for value in values]


@given(
    st.integers(-(10**6), 10**6), st.integers(0, 200), st.integers(1, 10**4), st.integers(0, 3), st.integers(0, 10**4)
)
def test_a_range_has_every_step_and_its_end_where_one_reaches_it(
    start: int, steps: int, step: int, digits: int, beyond: int
) -> None:
    """In decimal: every value is the float nearest to its fraction."""
    unit = 10**digits

    def shown(number: int) -> str:
        sign, size = "-" if number < 0 else "", abs(number)
        return f"{sign}{size // unit}.{size % unit:0{digits}d}" if digits else str(number)

    stop = start + steps * step + beyond % step
    found = parse_setting(f"k={shown(start)}:{shown(stop)}:{shown(step)}").values
    assert list(found) == [float(Fraction(start + at * step, unit)) for at in range(steps + 1)]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("x.size_nm", "is not KEY=VALUES"),
        ("=5", "is not KEY=VALUES"),
        ("x..y=5", "is not KEY=VALUES"),
        ("x=", "has an empty value"),
        ("x=1,,2", "has an empty value"),
        ("x=1:5", "has no step"),
        ("x=1:5:1:2", "has no step"),
        ("x=1:5:0", "a step of 0"),
        ("x=1:5:-1", "steps away from 5"),
        ("x=1:a:2", "is no range"),
        ("x=1,2,1", "has 1 twice"),
        (f"x=0:{MOST_VALUES}:1", "at most"),
    ],
)
def test_what_is_no_setting_is_refused_with_its_reason(text: str, why: str) -> None:
    with pytest.raises(Rejected, match=why) as caught:
        parse_setting(text)
    assert str(caught.value).startswith(f"--set {text}: ")


@pytest.mark.parametrize("keys", [("x.size_nm", "x.size_nm"), ("x.table", "x.table.bits")])
def test_a_key_is_set_once(keys: tuple[str, str]) -> None:
    with pytest.raises(Rejected):
        check_together([Setting(key, (1,)) for key in keys])
    check_together([Setting("x.table", (1,)), Setting("x.table_bits", (1,))])
