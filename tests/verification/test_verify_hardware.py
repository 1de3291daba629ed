"""A build whose axes have different converters and amplifiers, from its files to volts, and through ``verify``.

The volts of every tick are worked out from the words that leave the build, by hand for each axis, and held against the
drive that the manifest states.
"""

import shutil
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import EXAMPLE, NAME, REMOVED, VARIANTS, Build, Variant, build
from editing import run
from kept_plays import own_program_alone
from manifest_integers import played_codes
from sets import LONG_TEST
from verifying import edit_manifest, make_right

from tablegen.certificate.certificate import certify
from tablegen.certificate.summary import summary
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan

# x: an amplifier of 15 on offset binary; y: one of -20 on complementary two's complement, in the upper bits of 24.
SCANNER = {
    "dac": {"bits": 16, "update_rate_hz": 500e3},
    "x.dac": {"v_min": -5.0, "v_max": 5.0, "output": "B"},
    "x.amplifier": {"gain": 15.0, "bias_v": 60.0},
    "y.dac": {
        "v_min": -2.5,
        "v_max": 2.5,
        "coding": "twos-complement",
        "inverted": True,
        "word_bits": 24,
        "align": "left",
        "output": "A",
    },
    "y.amplifier": {"gain": -20.0, "bias_v": 45.0, "max_slew_v_per_s": 1e6},
}
MIXED = Variant({**VARIANTS["short_frame"].scan, "dac": REMOVED, "amplifier": REMOVED, "x.park_v": 20.0}, SCANNER)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Build:
    return build(tmp_path_factory.mktemp("mixed"), MIXED)


def x_volts(word: int) -> float:
    """16 bits of offset binary over +-5 V, and an amplifier of 15 about 60 V."""
    return 15.0 * (-5.0 + 10.0 * word / 65536) + 60.0


def y_volts(word: int) -> float:
    """The upper 16 of 24 bits, every bit inverted, two's complement over +-2.5 V; an amplifier of -20 about 45 V."""
    assert word & 0xFF == 0
    upper = ~(word >> 8) & 0xFFFF
    signed = upper - 0x10000 if upper & 0x8000 else upper
    return -20.0 * (2.5 * signed / 0x8000) + 45.0


def words_sent(output: dict[str, Any], codes: list[int]) -> list[int]:
    """Coding and alignment as docs/sequencer.md has them."""
    flip = 1 << (output["dac_bits"] - 1) if output["coding"] == "twos-complement" else 0
    shift = output["word_bits"] - output["dac_bits"] if output["align"] == "left" else 0
    return [(code ^ flip) << shift for code in codes]


@pytest.mark.parametrize(("axis", "volts_of"), [("x", x_volts), ("y", y_volts)])
def test_the_words_of_each_axis_are_the_volts_of_its_drive(mixed: Build, axis: str, volts_of: Any) -> None:
    content = mixed.manifest["axes"][axis]
    line, fourier, drive, output = content["line"], content["fourier"], content["drive"], content["output"]
    angle = 2.0 * np.pi / line["ticks"] * np.arange(line["ticks"])
    w = fourier["a0"] + sum(
        a * np.cos(n * angle) + b * np.sin(n * angle)
        for n, (a, b) in enumerate(zip(fourier["a"], fourier["b"], strict=True), 1)
    )
    asked = drive["v_offset"] + drive["v_amplitude"] * (w - 0.5)
    played = [volts_of(word) for word in words_sent(output, played_codes(content))]
    lsb = {"x": 150.0, "y": 100.0}[axis] / 65536
    assert np.max(np.abs(np.array(played) - asked)) <= content["certificate"]["max_error_lsb"] * lsb * (1 + 1e-6)
    park = volts_of(words_sent(output, [output["park_code"]])[0])
    assert abs(park - {"x": 20.0, "y": 50.0}[axis]) <= 0.5001 * lsb
    ends = sorted(volts_of(words_sent(output, [output[end]])[0]) for end in ("code_min", "code_max"))
    reach = {"x": (0.0, 100.0), "y": (0.0, 95.0)}[axis]  # of the driver, and of the converter of y
    assert reach[0] <= ends[0] + 1e-6
    assert ends[1] <= reach[1] + 1e-6
    assert ends[0] - reach[0] <= lsb
    assert reach[1] - ends[1] <= lsb


def test_every_file_says_which_volts_a_code_is(mixed: Build) -> None:
    for name in (f"{NAME}.h", f"{NAME}.vh"):
        text = mixed.files[name].decode("ascii")
        assert "volts of code c   -15 V + 0.00228882 V c, at the piezo" in text
        assert "volts of code c   -4.99847 V + 0.00152588 V c, at the piezo" in text  # two inversions
    plan = make_plan(load(EXAMPLE))
    assert not [line for line in summary(plan, certify(plan)) if "volts of code" in line]


def test_the_slew_of_one_amplifier_is_the_guard_of_its_axis_alone(mixed: Build) -> None:
    x, y = (mixed.manifest["axes"][axis]["output"] for axis in "xy")
    assert y["max_step"] == int(1e6 / 500e3 / (100.0 / 65536))
    assert x["max_step"] < y["max_step"], "twice the steepest step of the line"


@pytest.mark.common
@pytest.mark.parametrize(
    ("target", "requests"),
    [
        ("c", True),
        pytest.param("verilog", False, marks=pytest.mark.rest),
        pytest.param("verilog", True, marks=LONG_TEST),
    ],
)
def test_both_sequencers_play_it(mixed: Build, target: str, requests: bool) -> None:
    options = (target, "--axis", "blocks") if target == "verilog" else (target,)
    with nullcontext() if requests else own_program_alone():
        outcome = run("verify", mixed.folder, "--target", *options)
    assert outcome.status == 0, outcome.out + outcome.err


@pytest.mark.common
def test_hardware_that_is_not_that_of_the_words_is_found(mixed: Build, tmp_path: Path) -> None:
    """Negative control: the amplifier of x in place of y's; and hardware of its own that is not stated."""
    x, y = (mixed.manifest["axes"][axis]["output"] for axis in "xy")
    assert y["own_hardware"] is True
    assert "own_hardware" not in x
    for key, value, told in (
        ("v_per_code", x["v_per_code"], "axes.y.table.scale is not what gain_word makes of the amplitude"),
        ("v_zero", x["v_zero"], "axes.y.output.offset_word is "),
        ("own_hardware", False, "axes.y.output.coding is twos-complement, of x it is offset-binary"),
    ):
        folder = tmp_path / key
        shutil.copytree(mixed.folder, folder)
        edit_manifest(folder, "axes", "y", "output", key, value=value)
        make_right(folder)
        outcome = run("verify", folder, "--target", "files")
        assert outcome.status == ExitStatus.MISMATCH
        assert told in outcome.err
