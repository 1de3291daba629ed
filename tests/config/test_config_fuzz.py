"""Whatever stands in the two files, the answer is a build, a refusal or a broken limit: never a traceback, never NaN.

The frames are small, so that many of them are built; ``derandomize`` makes every run the same.
"""

import json
import math
import random
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec.inspect as types
import pytest
from editing import SCAN, SCANNER, Outcome, edited, run
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st
from sets import one_of

from tablegen.config.scanner import Scanner
from tablegen.config.schema import Scan

pytestmark = [pytest.mark.filterwarnings("error"), pytest.mark.common]  # numpy says so where it makes an inf or a nan
STEADY = settings(derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=False)
SMALL = (
    "timing.lines = 12",
    "timing.pixels = 20",
    "dac.update_rate_hz = 50e3",
    "y.band_limit.harmonics = 16",
    "- [limits]",
)
SMALL_SCAN = edited(SCAN, *SMALL)
VALUES = (
    "0", "-1", "1e308", "-1e308", "5e-324", "-0.0", "1e-9", "nan", "inf", "-inf", "true", "''", "'\u00fc'", "[]", "{}",
    "9223372036854775808", "0x" + "f" * 400, "1" * 4400, "[[[[0.5]]]]", "{ a = 1 }", "1979-05-27", "'''\n'''", "0.5",
    "\"\\u0000\"", "'" + "x" * 2000 + "'", "[" * 3000 + "]" * 3000, "[0.5, 0.5]", "[nan, 1]", "16", "1000000",
)  # fmt: skip
JUNK = (
    "[",
    "]",
    "=",
    "[[x]]",
    "[x]",
    "a.b.c = 1",
    "'''",
    '"',
    "\x00",
    "\ufeff",
    "\u2028",
    "x = {",
    "# \U0001f600",
    "name = 1",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all that is tried; it is empty but for the two files whenever a build begins."""
    return tmp_path_factory.mktemp("fuzz")


def build(folder: Path, scan: str | bytes, scanner: str | bytes) -> Outcome:
    """Build, and hold the outcome to what every outcome has to be."""
    out = folder / "out"
    for name, content in (("scan.toml", scan), ("scanner.toml", scanner)):
        (folder / name).write_bytes(content.encode("utf-8", "replace") if isinstance(content, str) else content)
    outcome = run("build", folder / "scan.toml", "-o", out)
    assert outcome.status in (0, 2, 3)
    written = sorted(path.name for path in out.iterdir()) if out.exists() else []
    if outcome.status == 0:
        manifest = json.loads((out / "manifest.json").read_text(encoding="ascii"), parse_constant=_not_a_number)
        assert written == sorted([*manifest["files"], "manifest.json"])
        assert all(message.startswith("warning: ") for message in outcome.messages), outcome.err
        for path in out.iterdir():
            path.unlink()
        out.rmdir()
    else:
        assert written == []
        assert not out.exists()
        assert outcome.messages, "a refusal says why"
    for message in outcome.messages:
        place = message.removeprefix("warning: ")
        assert place.startswith((f"{folder / 'scan.toml'}:", f"{folder / 'scanner.toml'}:")), message
        assert len(message) < 1000 + len(str(folder))
        assert not re.search(r"\b(nan|inf)\b(?! is no)(?!,)", message), message
    return outcome


def _not_a_number(text: str) -> float:
    raise AssertionError(f"{text} in the manifest")


def _fields(kind: Any, path: str) -> Iterator[tuple[str, Any]]:
    """The dotted names of all keys below a type of the schema, with their types, the branches of hysteresis aside."""
    for field in kind.fields:
        inner = field.type
        while isinstance(inner, types.Metadata | types.UnionType):
            inner = inner.type if isinstance(inner, types.Metadata) else inner.types[0]
        name = f"{path}.{field.encode_name}" if path else field.encode_name
        if isinstance(inner, types.StructType):
            yield from _fields(inner, name)
        elif not isinstance(inner, types.ListType):
            yield name, inner


SCAN_FIELDS = dict(_fields(types.type_info(Scan), ""))
SCANNER_FIELDS = dict(_fields(types.type_info(Scanner), ""))
# Keys that would make the frame large, the directory another one, or that say the same as one that is given.
FIXED = (
    "limits.",
    "name",
    "scanner",
    "timing.",
    "emit.",
    "dac.update_rate_hz",
    "response",
    "points",
    "y.frequency.reference_hz",
)


def _floats(fields: dict[str, Any], text: str) -> dict[str, tuple[float, float]]:
    """The numbers that stand in a file, with the ends of their ranges."""
    found = {}
    for key, kind in fields.items():
        if isinstance(kind, types.FloatType) and not any(part in key for part in FIXED):
            low = kind.ge if kind.ge is not None else kind.gt
            high = kind.le if kind.le is not None else kind.lt
            table, _, name = key.rpartition(".")
            header = f"[{table}]" if table else text[:1]
            if header in text and f"\n{name} = " in text.split(header, 1)[1].split("\n[", 1)[0]:
                found[key] = (float(low or 0.0), float(high or 0.0))
    return found


SCAN_FLOATS = _floats(SCAN_FIELDS, SCAN)
SCANNER_FLOATS = _floats(SCANNER_FIELDS, SCANNER)


def across(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers of a range, as many near 0 as far from it, and its ends."""
    least = max(abs(low), 1e-12) if low > 0.0 else 1e-12
    sizes = st.floats(math.log(least), math.log(max(abs(low), high))).map(math.exp)
    signed = st.one_of(sizes, sizes.map(lambda x: -x)) if low < 0.0 else sizes
    return st.one_of(signed.map(lambda x: min(max(x, low), high)), st.sampled_from((low, high, 0.5 * (low + high))))


@st.composite
def numbers(draw: st.DrawFn, ranges: dict[str, tuple[float, float]], most: int) -> list[str]:
    """Edits that put numbers of their ranges on some keys."""
    keys = draw(st.lists(st.sampled_from(sorted(ranges)), max_size=most, unique=True))
    return [f"{key} = {draw(across(*ranges[key]))!r}" for key in keys]


def test_the_keys_that_are_varied_are_those_of_the_files() -> None:
    assert len(SCAN_FLOATS) >= 10
    assert len(SCANNER_FLOATS) >= 15
    assert SCAN_FLOATS["x.turn"] == (0.0, 1.0)
    assert SCANNER_FLOATS["x.size.beta"] == (-0.5, 100.0)


@pytest.mark.rest
@pytest.mark.parametrize("key", one_of(2, sorted({*SCAN_FLOATS, *SCANNER_FLOATS})))
@settings(STEADY, max_examples=8)
@given(data=st.data())
def test_any_number_of_its_range_is_built_or_refused(folder: Path, key: str, data: st.DataObject) -> None:
    scan, scanner = SMALL_SCAN, SCANNER
    if key in SCAN_FLOATS:
        scan = edited(scan, f"{key} = {data.draw(across(*SCAN_FLOATS[key]))!r}")
    else:
        scanner = edited(scanner, f"{key} = {data.draw(across(*SCANNER_FLOATS[key]))!r}")
    build(folder, scan, scanner)


@settings(STEADY, max_examples=120)
@given(numbers(SCAN_FLOATS, 3), numbers(SCANNER_FLOATS, 3))
def test_numbers_of_their_ranges_together_are_built_or_refused(
    folder: Path, scan: list[str], scanner: list[str]
) -> None:
    build(folder, edited(SMALL_SCAN, *scan), edited(SCANNER, *scanner))


@st.composite
def setups(draw: st.DrawFn) -> tuple[str, str]:
    """Scans and scanners that a person might write, most of which can be built."""
    one = draw

    def number(low: float, high: float) -> float:
        return float(f"{one(st.floats(low, high)):.4g}")

    bits = one(st.integers(8, 24))
    scan = [
        f"dac.bits = {bits}",
        f"dac.coding = '{one(st.sampled_from(('offset-binary', 'twos-complement')))}'",
        f"amplifier.gain = {one(st.sampled_from((10.0, -10.0, 12.5)))}",
        f"timing.lines = {one(st.integers(12, 40))}",
        f"timing.pixels = {one(st.integers(1, 20))}",
        f"timing.line_rate_hz = {number(20.0, 500.0)}",
        f"y.motion = '{one(st.sampled_from(('ramp', 'step')))}'",
        *one(st.sampled_from(([], ["- amplifier.max_slew_v_per_s"]))),
    ]
    for axis in "xy":
        low, high = (one(st.sampled_from((0.0, 0.05, 0.1, 0.3))), one(st.sampled_from((0.7, 0.9, 0.95, 1.0))))
        mode = one(st.sampled_from(("direct", "interpolated", "auto")))
        directions = "forward" if axis == "y" else one(st.sampled_from(("both", "forward")))
        scan += [
            f"{axis}.size_nm = {number(5.0, 500.0)}",
            f"{axis}.offset_v = {number(20.0, 80.0)}",
            f"{axis}.size_of = '{one(st.sampled_from(('line', 'window')))}'",
            f"{axis}.turn = {number(0.4, 0.6) if axis == 'x' else number(0.85, 0.99)}",
            f"{axis}.band_limit.method = '{one(st.sampled_from(('window', 'lanczos', 'truncate')))}'",
            f"{axis}.band_limit.harmonics = {one(st.integers(1, 5 if axis == 'y' else 32))}",
            f"{axis}.band_limit.window = [{low}, {high}]",
            f"{axis}.band_limit.directions = '{directions}'",
            f"{axis}.table.mode = '{mode}'",
            f"- {axis}.table.length" if mode == "direct" else f"{axis}.table.length = {1 << one(st.integers(6, 12))}",
            f"{axis}.table.bits = {one(st.integers(8, 24))}",
        ]
        if mode == "auto":
            scan.append(f"{axis}.table.max_error_lsb = {number(0.3, 50.0)}")
            scan += [f"- {axis}.table.{key}" for key in ("length", "bits") if one(st.booleans())]
    scanner = [f"x.hysteresis.model = '{one(st.sampled_from(('harmonic', 'sinusoidal', 'triangle')))}'"]
    for axis in "xy":
        for side in ("forward", "backward"):
            branch = f"beta_max = {number(0.0, 0.15)}, rho = {number(0.1, 8.0)}, u_peak = {number(0.38, 0.7)}"
            scanner.append(f"{axis}.hysteresis.branches.{side} = {{ {branch} }}")
        scanner += [f"{axis}.size.beta = {number(-0.3, 1.0)}", f"{axis}.offset.m_plus = {number(0.8, 1.4)}"]
    scanner += [f"x.resonance.frequency_hz = {number(1e3, 1e5)}", f"x.resonance.quality = {number(0.5, 100.0)}"]
    scanner += [f"x.resonance.delay_s = {number(0.0, 1e-4)}", f"x.resonance.max_boost_db = {number(0.0, 40.0)}"]
    return edited(SMALL_SCAN, *scan), edited(SCANNER, *scanner)


def statuses_of_setups(folder: Path, count: int) -> list[int]:
    """Return the exit statuses of so many builds."""
    statuses: list[int] = []

    @settings(STEADY, max_examples=count, phases=[Phase.generate])
    @given(setups())
    def collect(setup: tuple[str, str]) -> None:
        statuses.append(build(folder, *setup).status)

    collect()
    return statuses


@pytest.mark.rest
def test_some_scans_that_a_person_might_write(folder: Path) -> None:
    """A quarter of them is built: the fuzz is worth nothing if all of it ends in the first refusal."""
    assert statuses_of_setups(folder, 40).count(0) >= 10


@pytest.mark.long
@settings(STEADY, max_examples=80)
@given(setups())
def test_a_scan_that_a_person_might_write_is_built_or_refused(folder: Path, setup: tuple[str, str]) -> None:
    build(folder, *setup)


@settings(STEADY, max_examples=150)
@given(key=st.sampled_from(sorted(SCAN_FIELDS)), value=st.sampled_from(VALUES))
@example(key="limits.max_scaling_error_percent", value="5e-324")  # far above it: how far is no float
def test_any_value_on_any_key_of_a_scan_is_built_or_refused(folder: Path, key: str, value: str) -> None:
    build(folder, _with(SMALL_SCAN, key, value), SCANNER)


@settings(STEADY, max_examples=150)
@given(key=st.sampled_from(sorted(SCANNER_FIELDS)), value=st.sampled_from(VALUES))
def test_any_value_on_any_key_of_a_scanner_is_built_or_refused(folder: Path, key: str, value: str) -> None:
    build(folder, SMALL_SCAN, _with(SCANNER, key, value))


def _with(text: str, key: str, value: str) -> str:
    table = key.rpartition(".")[0]
    if table and f"[{table}]" not in text:
        text += f"[{table}]\n"
    return edited(text, f"{key} = {value}")


@pytest.mark.rest
@settings(STEADY, max_examples=200)
@given(
    seed=st.integers(0, 1 << 30),
    ways=st.lists(
        st.sampled_from(("delete", "swap", "double", "junk", "cut", "other", "nest")), min_size=1, max_size=4
    ),
    scanner=st.booleans(),
)
def test_lines_deleted_swapped_doubled_and_spoilt_are_refused_or_built(
    folder: Path, seed: int, ways: list[str], scanner: bool
) -> None:
    pick = random.Random(seed)
    lines = (SCANNER if scanner else SMALL_SCAN).splitlines()
    for way in ways:
        at, other = pick.randrange(len(lines)), pick.randrange(len(lines))
        match way:
            case "delete":
                del lines[at]
            case "swap":
                lines[at], lines[other] = lines[other], lines[at]
            case "double":
                lines.insert(other, lines[at])
            case "junk":
                lines.insert(at, pick.choice(JUNK))
            case "cut":
                lines[at] = lines[at][: pick.randrange(len(lines[at]) + 1)]
            case "other":
                lines[at] = f"{lines[at].split('=')[0]} = {pick.choice(VALUES)}"
            case "nest":
                lines[at] = f"{lines[at].split('=')[0]} = {'{ a = ' * 40}{pick.choice(VALUES)}{'}' * 40}"
    text = "\n".join(lines)
    build(folder, *((SMALL_SCAN, text) if scanner else (text, SCANNER)))


@settings(STEADY, max_examples=150)
@given(at=st.integers(0, 10_000), put=st.binary(max_size=6), cut=st.integers(0, 20), scanner=st.booleans())
def test_any_bytes_anywhere_are_refused_or_built(folder: Path, at: int, put: bytes, cut: int, scanner: bool) -> None:
    content = (SCANNER if scanner else SMALL_SCAN).encode()
    at %= len(content)
    spoilt = content[:at] + put + content[at + cut :]
    build(folder, *((SMALL_SCAN, spoilt) if scanner else (spoilt, SCANNER)))


@pytest.mark.rest
@settings(STEADY, max_examples=30)
@given(st.lists(st.tuples(across(-1e5, 1e5), across(1e-6, 1e9)), min_size=3, max_size=5), st.floats(0.0, 100.0))
def test_any_offset_points_are_refused_or_built(folder: Path, points: list[tuple[float, float]], last: float) -> None:
    for rows in (points, [(last * (i + 1) / 9.0, 200.0 + 40.0 * (p[0] > 0.0)) for i, p in enumerate(points)]):
        text = ", ".join(f"{{ offset_v = {v!r}, apparent_nm = {nm!r} }}" for v, nm in rows)
        edits = ("- x.offset.m_minus", "- x.offset.m_plus", f"x.offset.points = [{text}]")
        build(folder, SMALL_SCAN, edited(SCANNER, *edits))


@pytest.mark.rest
@settings(STEADY, max_examples=40)
@given(
    model=st.sampled_from(("harmonic", "sinusoidal")),
    size=st.floats(1.0, 1200.0),
    turns=st.lists(st.floats(0.3, 0.7), min_size=1, max_size=4),
    branches=st.lists(st.tuples(across(0.0, 0.4999), across(1e-6, 100.0), across(1e-9, 0.999)), min_size=2, max_size=2),
)
def test_any_branches_are_refused_or_built(
    folder: Path, model: str, size: float, turns: list[float], branches: list[tuple[float, float, float]]
) -> None:
    shown = ["{{ beta_max = {!r}, rho = {!r}, u_peak = {!r} }}".format(*branch) for branch in branches]
    entries = "".join(
        f"[[x.hysteresis.branches]]\nturn = {turn!r}\nforward = {shown[0]}\nbackward = {shown[1]}\n" for turn in turns
    )
    scanner = edited(SCANNER, f"x.hysteresis.model = '{model}'", "- [[x.hysteresis.branches]]") + entries
    build(folder, edited(SMALL_SCAN, f"x.size_nm = {size!r}"), scanner)


@pytest.mark.rest
@settings(STEADY, max_examples=80)
@given(
    rows=st.lists(
        st.one_of(
            st.tuples(st.floats(0.1, 1e6), st.floats(1e-6, 1e6), st.floats(-1e6, 1e6)).map(
                lambda row: ",".join(map(repr, row))
            ),
            st.sampled_from(("", "# c", "1,2", "a,b,c", "1,nan,0", "inf,1,0", "1e400,1,0", "1_0,1,0", "\x00,1,1")),
        ),
        max_size=5,
    ),
    last=st.sampled_from(("", "2e6,0.01,-180", "2e6,1e6,90\r\n3e6,1e-6,1e6")),
)  # fmt: skip
def test_any_response_file_is_refused_or_built(folder: Path, rows: list[str], last: str) -> None:
    keys = ("frequency_hz", "quality", "delay_s")
    scanner = edited(SCANNER, *(f"- x.resonance.{key}" for key in keys), "x.resonance.response = 'r.csv'")
    (folder / "r.csv").write_text("\n".join(["hz,gain,phase_deg", *rows, last]), encoding="utf-8", newline="")
    build(folder, SMALL_SCAN, scanner)
