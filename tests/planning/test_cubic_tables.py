"""Cubic tables of a build: how few bits they take, what they leave, and what refuses them."""

from fractions import Fraction

import numpy as np
import pytest
from building import IN_C, Build, Variant, build
from editing import SCAN, SCANNER, edited, run, write_pair
from manifest_integers import played_codes

from tablegen.certificate.certificate import certify
from tablegen.certificate.summary import summary
from tablegen.verification.play.placement import Placement

CUBIC = {
    "x.table": {"mode": "cubic", "length": 128, "bits": 14},
    "y.table": {"mode": "cubic", "length": 256, "bits": 14},
    "emit.formats": ["c"],
}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """The example with cubic tables of 1792 and 3584 bits."""
    return build(tmp_path_factory.mktemp("cubic"), Variant(CUBIC))


@pytest.mark.parametrize(("axis", "bits", "most"), [("x", 1792, 0.84), ("y", 3584, 0.90)])
def test_less_than_an_lsb_in_few_bits(built: Build, axis: str, bits: int, most: float) -> None:
    line = getattr(built.plan, axis)
    assert len(line.program.words) * line.program.bits == bits
    assert most - 0.01 < certify(built.plan)[axis].max_error_lsb < most


def test_a_build_says_what_a_device_needs_for_it(built: Build) -> None:
    """Where nothing can refuse: options of a compiler, and the clocks that `verify` gives to such a tick."""
    fast, low_area = (Placement(axis, spline=True).tick_clocks for axis in ("pipelined", "serial"))  # type: ignore[arg-type]
    needs = f"needs DAC_SPLINE=1 in C; in Verilog {fast} clocks a tick, {low_area} in low area"
    assert "\n".join(summary(built.plan, certify(built.plan))).count(needs) == 2, "of x and y"
    assert "_SPLINE 1" in built.files["annexin_200nm.h"].decode()


@pytest.mark.common
@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_model_plays_what_plain_integers_play(built: Build, axis: str) -> None:
    program = getattr(built.plan, axis).program
    assert played_codes(built.manifest["axes"][axis]) == program.codes(np.arange(program.ticks)).tolist()


@pytest.mark.parametrize("axis", ["x", "y"])
def test_words_are_the_series_through_the_projection(built: Build, axis: str) -> None:
    """Of the coefficients of the manifest, by a sum over the period: the spline of the words is nearest to w."""
    content = built.manifest["axes"][axis]
    fourier, table = content["fourier"], content["table"]
    length = len(table["words"])
    n = np.arange(1, fourier["harmonics"] + 1)
    x = n / length
    # The Poisson sum of the B-spline's spectrum, so many terms that the rest is below 1e-15.
    overlap = sum(np.sinc(x + m) ** 8 for m in range(-40, 41))
    turned = (
        (np.array(fourier["a"]) - 1j * np.array(fourier["b"])) * np.sinc(x) ** 4 / overlap * np.exp(-2j * np.pi * x)
    )
    t = np.arange(length) / length
    w = fourier["a0"] + (turned @ np.exp(2j * np.pi * np.outer(n, t))).real
    words = (2.0 * w - 1.0) / table["scale"] * 2.0 ** (table["bits"] - 1)
    assert np.abs(words - table["words"]).max() < 0.5 + 1e-3


def test_the_gain_makes_up_for_the_unit(built: Build) -> None:
    """12 units for the LSB of a word, where the gain counts with 16."""
    content = built.manifest["axes"]["x"]
    output, drive = content["output"], content["drive"]
    codes = 12 * 2 ** (content["table"]["bits"] - 1) * Fraction(output["gain_word"], 2 ** output["gain_q"])
    amplitude = 0.5 * drive["v_amplitude"] / output["v_per_code"]
    assert float(codes) / content["table"]["scale"] == pytest.approx(amplitude)


def test_a_step_of_y(tmp_path_factory: pytest.TempPathFactory) -> None:
    wide = build(tmp_path_factory.mktemp("wide"), IN_C["cubic_wide"])
    assert certify(wide.plan)["x"].max_error_lsb < 0.7
    assert wide.manifest["axes"]["x"]["table"]["guard_bits"] == 4


def message(tmp_path, *changes: str) -> list[str]:  # type: ignore[no-untyped-def]
    write_pair(tmp_path, edited(SCAN, *changes), SCANNER)
    outcome = run("build", tmp_path / "scan.toml", "-o", tmp_path / "out")
    assert outcome.status == 2
    return outcome.messages


def test_what_is_refused(tmp_path_factory: pytest.TempPathFactory) -> None:
    cubic = "x.table.mode = 'cubic'"
    (why,) = message(tmp_path_factory.mktemp("few"), cubic, "x.table.length = 64")
    assert why.endswith("x.band_limit.harmonics: 32 harmonics are too many; a table of 64 words carries 31")
    (why,) = message(tmp_path_factory.mktemp("length"), cubic, "x.table.length = 100")
    assert "100 is not a power of two" in why
