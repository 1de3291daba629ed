"""The manifest against everything that can be worked out again without the package.

Codes come from the manifest's table words in plain Python integers, table words from its Fourier words with sines of
mpmath, the waveform and the drive from their factors with numpy; the converter's volts come from the scan file.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import numpy.typing as npt
import pytest
from building import EXAMPLE, FEW, VARIANTS, Build, Variant, build, changed, to_toml
from manifest_integers import floor_shift, played_codes
from replacing import replace
from sets import quick

from tablegen.config.load import load
from tablegen.emit.formats import chosen
from tablegen.emit.render import render, runtime_files
from tablegen.planning.line_plan import LinePlan, Plan, make_plan

Json = dict[str, Any]
DIGITS = 5.001e-6  # half a unit in the sixth significant digit, relative to the figure that begins with 1
REQUIRED: Json = {
    "drive": {
        "v_offset": float,
        "v_scan": float,
        "v_scan_normalised": float,
        "m": float,
        "g": float,
        "forward": {"beta": float, "u_peak": float},
        "backward": {"beta": float, "u_peak": float},
        "turn": float,
        "model": str,
    },
    "line": {"ticks": int, "rate_hz": float, "rate_exact": [int], "requested_hz": float},
    "fourier": {
        "band_limit": str,
        "harmonics": int,
        "a0": float,
        "a": [float],
        "b": [float],
        "q_format": str,
        "a0_word": int,
        "a_words": [int],
        "b_words": [int],
    },
    "table": {"mode": str, "bits": int, "scale": float, "words": [int]},
    "output": {
        "gain_word": int,
        "gain_q": int,
        "offset_code": int,
        "code_min": int,
        "code_max": int,
        "max_step": int,
        "dac_bits": int,
        "coding": str,
    },
    "certificate": {
        "max_error_lsb": float,
        "rms_error_lsb": float,
        "lowest_code": int,
        "highest_code": int,
        "headroom_low": int,
        "headroom_high": int,
        "largest_step": int,
        "max_step": int,
        "scaling_error_percent": {
            "forward": dict.fromkeys(("total", "band_limit", "quantisation", "model"), float),
        },
    },
}


@pytest.fixture(
    scope="module",
    params=quick(FEW, VARIANTS),
)
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Build:
    return build(tmp_path_factory.mktemp("variant"), VARIANTS[request.param])


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Build:
    return build(tmp_path_factory.mktemp("example"), VARIANTS["example"])


@pytest.fixture(params=["x", "y"])
def axis(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name


def misfits(value: Any, shape: Any, path: str = "") -> list[str]:
    """Where a JSON value lacks a required key or has another type; keys beyond the required ones are welcome."""
    if isinstance(shape, dict):
        if not isinstance(value, dict):
            return [f"{path} is no object"]
        missing = [f"{path}.{key} is missing" for key in shape if key not in value]
        return missing + [
            fault for key in shape if key in value for fault in misfits(value[key], shape[key], f"{path}.{key}")
        ]
    if isinstance(shape, list):
        if not isinstance(value, list):
            return [f"{path} is no array"]
        return [fault for i, item in enumerate(value) for fault in misfits(item, shape[0], f"{path}[{i}]")]
    return [] if type(value) is shape else [f"{path} is {value!r}, no {shape.__name__}"]


def strict_json(content: bytes) -> Json:
    """JSON without NaN, infinities, or a key given twice."""

    def refuse(constant: str) -> float:
        raise AssertionError(f"{constant} is no JSON")

    def unique(pairs: list[tuple[str, Any]]) -> Json:
        assert len(dict(pairs)) == len(pairs)
        return dict(pairs)

    found: Json = json.loads(content, parse_constant=refuse, object_pairs_hook=unique)
    return found


def asked_codes(axis: Json, scan: Mapping[str, Any]) -> npt.NDArray[np.float64]:
    """The real-valued codes of every tick: w(t) from its coefficients, the drive from its factors."""
    line, fourier, drive = axis["line"], axis["fourier"], axis["drive"]
    period = line["ticks"] // line["hold_ticks"]
    n = np.arange(1, fourier["harmonics"] + 1)
    w = np.concatenate(
        [
            fourier["a0"] + np.cos(angle) @ np.array(fourier["a"]) + np.sin(angle) @ np.array(fourier["b"])
            for k in np.array_split(np.arange(period), -(-period // 4096))
            for angle in [2.0 * np.pi / period * (np.outer(k, n) % period)]
        ]
    )
    volts = drive["v_offset"] + drive["m"] * drive["g"] * drive["v_scan"] * (w - 0.5)
    dac, amplifier = scan["dac"], scan["amplifier"]
    at_converter = (volts - amplifier["bias_v"]) / amplifier["gain"]
    codes = (at_converter - dac["v_min"]) / (dac["v_max"] - dac["v_min"]) * 2.0 ** dac["bits"]
    return np.repeat(codes, line["hold_ticks"])


@cache
def measured(built: Build, axis: str) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """What is played and what was asked for, at every tick of a period."""
    content = built.manifest["axes"][axis]
    return np.array(played_codes(content)), asked_codes(content, built.scan)


def rounded_sine(j: int, length: int) -> int:
    """round(2^30 sin(2 pi j / length)), ties away from zero."""
    with mpmath.workdps(40):
        value = mpmath.sinpi(mpmath.mpf(2 * j) / length) * 2**30
        magnitude = int(mpmath.floor(abs(value) + mpmath.mpf(1) / 2))
    return magnitude if value > 0 else -magnitude


def rounded_cosine(j: int, length: int) -> int:
    """The same of the cosine, also where a quarter of the length is not whole."""
    return rounded_sine(4 * j + length, 4 * length)


def rendered_words(fourier: Json, length: int, bits: int) -> list[int]:
    """Table words from Fourier words, in integers of any size."""
    sines = [rounded_sine(j, length) for j in range(length)]
    cosines = [rounded_cosine(j, length) for j in range(length)]
    terms = list(enumerate(zip(fourier["a_words"], fourier["b_words"], strict=True), start=1))
    words = []
    for k in range(length):
        total = fourier["a0_word"] * 2**30
        for n, (a, b) in terms:
            j = n * k % length
            total += a * cosines[j] + b * sines[j]
        words.append(min(max(floor_shift(total, 61 - bits), -(2 ** (bits - 1))), 2 ** (bits - 1) - 1))
    return words


def test_has_every_key_of_the_design(built: Build) -> None:
    manifest = strict_json(built.files["manifest.json"])
    top = {"tablegen": str, "hash": str, "name": str, "files": {}, "axes": {"x": REQUIRED, "y": REQUIRED}}
    assert misfits(manifest, top) == []
    if built.plan.x.band_limit.directions == "both":
        x = manifest["axes"]["x"]["certificate"]["scaling_error_percent"]
        assert set(x) == {"forward", "backward"}


def test_a_missing_key_and_a_wrong_type_are_found(example: Build) -> None:
    """Negative control of the check above."""
    manifest = example.manifest
    del manifest["axes"]["x"]["drive"]["forward"]["beta"]
    manifest["axes"]["x"]["table"]["words"][7] = 1.0
    assert misfits(manifest["axes"]["x"], REQUIRED) == [
        ".drive.forward.beta is missing",
        ".table.words[7] is 1.0, no int",
    ]


def test_files_are_those_on_disk_with_their_digests(built: Build) -> None:
    on_disk = {path.name: path.read_bytes() for path in built.folder.iterdir()}
    manifest = strict_json(on_disk.pop("manifest.json"))
    assert manifest["files"] == {name: hashlib.sha256(content).hexdigest() for name, content in on_disk.items()}
    assert list(manifest["files"]) == sorted(on_disk)


def test_every_file_is_ascii_with_unix_line_ends(built: Build) -> None:
    for content in built.files.values():
        assert content.isascii()
        assert b"\r" not in content
        assert content.endswith(b"\n")
        assert not [line for line in content.split(b"\n") if line != line.rstrip()]


def test_arrays_have_the_lengths_that_go_with_them(built: Build, axis: str) -> None:
    content = built.manifest["axes"][axis]
    fourier, table = content["fourier"], content["table"]
    assert {len(fourier[key]) for key in ("a", "b", "a_words", "b_words")} == {fourier["harmonics"]}
    low, high = -(2 ** (table["bits"] - 1)), 2 ** (table["bits"] - 1) - 1
    assert all(low <= word <= high for word in table["words"])
    assert all(abs(word) < 2**31 for key in ("a_words", "b_words") for word in fourier[key])


def test_rate_is_exact(built: Build, axis: str) -> None:
    line = built.manifest["axes"][axis]["line"]
    numerator, denominator = line["rate_exact"]
    asked = Fraction(str(built.scan["dac"]["update_rate_hz"]))
    assert Fraction(numerator, denominator) == asked / line["ticks"]
    assert np.gcd(numerator, denominator) == 1
    assert line["rate_hz"] == numerator / denominator
    lines = 1 if axis == "x" else built.scan["timing"]["lines"]
    assert line["requested_hz"] == built.scan["timing"]["line_rate_hz"] / lines


def test_rate_of_a_decimal_update_rate_is_exact(tmp_path: Path) -> None:
    """A tenth of a hertz is 1/10, not the float beside it."""
    found = build(tmp_path, Variant({"dac.update_rate_hz": 499999.7, "timing.ticks_per_line": 1250}))
    assert found.manifest["axes"]["x"]["line"]["rate_exact"] == [4999997, 12500]
    assert found.manifest["sequence"]["update_rate_hz"] == [4999997, 10]


def test_codes_from_words_are_those_of_the_package(built: Build, axis: str) -> None:
    line: LinePlan = getattr(built.plan, axis)
    content = built.manifest["axes"][axis]
    assert np.array_equal(measured(built, axis)[0], line.codes(0, content["line"]["ticks"]))


def test_codes_are_within_the_certificate_of_the_float_drive(built: Build, axis: str) -> None:
    """And the certificate's figures are those of this independent measurement, on every tick of the period."""
    content = built.manifest["axes"][axis]
    certificate, output = content["certificate"], content["output"]
    codes, asked = measured(built, axis)
    error = codes - asked
    assert certificate["ticks"] == len(codes)
    worst = float(np.max(np.abs(error)))
    assert worst * (1 - 1e-9) <= certificate["max_error_lsb"] <= worst * (1 + 1e-5)  # rounded up
    assert np.sqrt(np.mean(error**2)) == pytest.approx(certificate["rms_error_lsb"], rel=DIGITS)
    assert (codes.min(), codes.max()) == (certificate["lowest_code"], certificate["highest_code"])
    assert codes.min() - output["code_min"] == certificate["headroom_low"]
    assert output["code_max"] - codes.max() == certificate["headroom_high"]
    around = np.append(codes, codes[0])
    assert np.max(np.abs(np.diff(around))) == certificate["largest_step"]
    assert certificate["max_step"] == output["max_step"] >= certificate["largest_step"]


def test_quantisation_of_the_scaling_error_is_that_of_the_codes(built: Build, axis: str) -> None:
    """Chords of a twentieth of the line: slope of the played codes against that of the float drive, in the window."""
    content = built.manifest["axes"][axis]
    line, turn = content["line"], content["drive"]["turn"]
    low, high = content["fourier"]["window"]
    first, last = turn * low * line["ticks"], turn * high * line["ticks"]
    k = np.arange(int(np.ceil(first - 1e-6)), int(np.floor(last + 1e-6)) + 1)
    codes, asked = measured(built, axis)
    error = codes - asked
    run = round(0.05 * turn * line["ticks"])
    ideal = np.ptp(asked[k]) / len(k) * run
    chords = error[k[run:]] - error[k[:-run]]
    found = 100.0 * np.ptp(chords) / ideal
    # The ideal slope varies by twice the hysteresis over the window; only the size of the figure is held.
    assert content["certificate"]["scaling_error_percent"]["forward"]["quantisation"] == pytest.approx(found, rel=0.25)


def test_words_come_from_the_fourier_words(built: Build, axis: str) -> None:
    content = built.manifest["axes"][axis]
    words = content["table"]["words"]
    assert rendered_words(content["fourier"], len(words), content["table"]["bits"]) == words


def test_fourier_words_come_from_the_coefficients(built: Build, axis: str) -> None:
    """(2 w - 1) / scale in Q2.30, nearest."""
    content = built.manifest["axes"][axis]
    fourier, unit = content["fourier"], Fraction(2**30) / Fraction(content["table"]["scale"])
    exact = [(2 * Fraction(fourier["a0"]) - 1) * unit]
    exact += [2 * Fraction(c) * unit for c in (*fourier["a"], *fourier["b"])]
    words = [fourier["a0_word"], *fourier["a_words"], *fourier["b_words"]]
    # The last place of the float that was rounded leaves a trace beside the half.
    assert max(abs(word - value) for word, value in zip(words, exact, strict=True)) <= Fraction(1, 2) + Fraction(
        1, 10**6
    )


def test_gain_and_scale_make_the_amplitude(built: Build, axis: str) -> None:
    """gain_word / scale is the drive's amplitude in codes, exactly but for the float's last place."""
    content, scan = built.manifest["axes"][axis], built.scan
    drive, output = content["drive"], content["output"]
    lsb = (scan["dac"]["v_max"] - scan["dac"]["v_min"]) / 2 ** scan["dac"]["bits"] * scan["amplifier"]["gain"]
    asked = 0.5 * drive["m"] * drive["g"] * drive["v_scan"] / lsb
    full_scale = 2.0 ** (content["table"]["bits"] - 1 + content["table"]["guard_bits"])
    played = output["gain_word"] * full_scale / 2.0 ** output["gain_q"] / content["table"]["scale"]
    assert played == pytest.approx(asked, rel=1e-12)
    assert output["offset_code"] == floor_shift(output["offset_word"], output["gain_q"])


def digest_of(plan: Plan, built: Build) -> str:
    digest: str = json.loads(render(plan, built.certificates)["manifest.json"])["hash"]
    return digest


def test_hash_is_that_of_the_plan_in_the_manifest(built: Build) -> None:
    """Anyone can compute it: the manifest without its own version, hash, files and certificates, in canonical JSON."""
    record = built.manifest
    digest = record.pop("hash")
    del record["tablegen"], record["files"]
    for content in record["axes"].values():
        del content["certificate"]
    canonical = json.dumps(record, sort_keys=True, separators=(",", ":"))
    assert hashlib.sha256(canonical.encode()).hexdigest() == digest
    named = [name for name, content in built.files.items() if digest.encode() in content]
    runtime = {name for each in chosen(("c", "verilog")) for name in runtime_files(each)}
    assert {name for name in built.files if not name.endswith(".mem") and name not in runtime} == set(named)


def with_word(line: LinePlan) -> LinePlan:
    words = line.program.words.copy()
    words[len(words) // 3] += 1
    return replace(line, program=replace(line.program, words=words))


def with_fourier_word(line: LinePlan) -> LinePlan:
    b = line.fourier.b.copy()
    b[-1] -= 1
    return replace(line, fourier=replace(line.fourier, b=b))


def with_output(field: str) -> Callable[[LinePlan], LinePlan]:
    def change(line: LinePlan) -> LinePlan:
        output = line.program.output
        return replace(
            line, program=replace(line.program, output=replace(output, **{field: getattr(output, field) + 1}))
        )

    return change


CHANGES: dict[str, Callable[[LinePlan], LinePlan]] = {
    "word": with_word,
    "fourier word": with_fourier_word,
    **{
        field: with_output(field)
        for field in ("gain_word", "gain_q", "offset_word", "code_min", "code_max", "max_step", "park_code")
    },
}


@pytest.mark.parametrize("change", CHANGES)
def test_hash_changes_with_every_integer(example: Build, axis: str, change: str) -> None:
    x, y = (CHANGES[change](line) if line.axis == axis else line for line in example.plan.lines)
    plan = replace(example.plan, x=x, y=y)
    assert digest_of(plan, example) != example.manifest["hash"]


@pytest.mark.parametrize("field", ["ticks", "lines", "pixels", "settle_lines", "turn_tick", "turn_line"])
def test_hash_changes_with_the_schedule(example: Build, field: str) -> None:
    schedule = replace(example.plan.schedule, **{field: getattr(example.plan.schedule, field) + 1})
    assert digest_of(replace(example.plan, schedule=schedule), example) != example.manifest["hash"]


def test_hash_does_not_depend_on_how_the_toml_is_written(example: Build, tmp_path: Path) -> None:
    """The shipped text with its comments, the plain dump, and one with tables reversed and other line ends."""
    values, scanner = changed(EXAMPLE, {}), changed(EXAMPLE.with_name("scanner.toml"), {})
    plain = {key: value for key, value in values.items() if not isinstance(value, dict)}
    tables = {key: value for key, value in values.items() if isinstance(value, dict)}
    backwards = {**plain, **{key: dict(reversed(table.items())) for key, table in reversed(tables.items())}}
    text = to_toml(backwards).replace("200.0", "2.000e2").replace("\n", "\r\n") + "# the end"
    (tmp_path / "scan.toml").write_text(text, "utf-8", newline="")
    (tmp_path / "scanner.toml").write_text("# rewritten\n" + to_toml(scanner), "utf-8")
    digests = {digest_of(make_plan(load(path)), example) for path in (EXAMPLE, tmp_path / "scan.toml")}
    assert digests == {example.manifest["hash"]}
