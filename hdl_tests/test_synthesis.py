"""Synthesis: no latch, no net with two drivers, and the areas and rates that docs/resources.md gives.

What is placed and routed takes long, so every run measures the two axes at one seed and the multipliers of each family;
``make test-long`` measures the whole page again. The page is held against the requirements every time, and has a digest
of the Verilog and of its rows: a change of either is seen at once.
"""

import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from building import REPOSITORY, tool
from sets import LONG_TEST, long, one_of
from test_lint import complete
from test_parameters import written

sys.path.insert(0, str(REPOSITORY / "benchmarks"))
import resources

MODULES = resources.MODULES
BUS, ADC, SLOW, PAIR = (MODULES / name for name in ("bus", "adc", "slow", "pair"))
CHECKED: dict[str, tuple[str, Mapping[str, int]]] = {
    "as_it_comes": ("dac_sequencer", {}),
    "multiplier_blocks": ("dac_sequencer", {"PLAIN_MULTIPLIER": 1}),
    "direct": ("dac_sequencer", {"X_INTERPOLATED": 0, "Y_INTERPOLATED": 0}),
    "low_area": ("dac_sequencer", {"LOW_AREA": 1, "X_POWER_UP_CODE": 32768}),
    "low_area_direct": ("dac_sequencer", {"LOW_AREA": 1, "X_INTERPOLATED": 0}),
    "fourier": ("dac_sequencer", {"FOURIER": 1}),
    "low_area_fourier": ("dac_sequencer", {"LOW_AREA": 1, "FOURIER": 1}),
    "narrow": ("dac_sequencer", {"DAC_BITS": 8, "X_WORD_BITS": 8, "Y_WORD_BITS": 8, "TICK_BITS": 8, "LINE_BITS": 4}),
    "wide": ("dac_sequencer", {"DAC_BITS": 24, "X_WORD_BITS": 24, "Y_WORD_BITS": 24, "PLAIN_MULTIPLIER": 1}),
    "wide_words": ("dac_sequencer", {"DAC_BITS": 8, "X_WORD_BITS": 24, "Y_WORD_BITS": 20}),
    "wide_codes": ("dac_sequencer", {"DAC_BITS": 24, "X_WORD_BITS": 8, "Y_WORD_BITS": 12, "LOW_AREA": 1}),
    "first": ("dac_sequencer", {"SHAPING": 1}),
    "second_wide_words": ("dac_sequencer", {"SHAPING": 2, "DAC_BITS": 8, "X_WORD_BITS": 24, "Y_WORD_BITS": 8}),
    "scanner": ("dac_sequencer", {"SHAPING": 3, "PLAIN_MULTIPLIER": 1}),
    "scanner_low_area": ("dac_sequencer", {"SHAPING": 3, "LOW_AREA": 1, "DAC_BITS": 24}),
    "cubic": ("dac_sequencer", {"X_INTERPOLATED": 3, "X_INDEX_BITS": 7, "X_WORD_BITS": 14}),
    "cubic_y_plain": ("dac_sequencer", {"Y_INTERPOLATED": 3, "PLAIN_MULTIPLIER": 1, "SHAPING": 3}),
    "cubic_low_area": ("dac_sequencer", {"X_INTERPOLATED": 3, "Y_INTERPOLATED": 3, "LOW_AREA": 1}),
    "slow_part": ("dac_sequencer", {"SLOW_PART": 1, "LOW_AREA": 1, "X_INTERPOLATED": 3, "X_INDEX_BITS": 6}),
    "pixels": ("dac_sequencer", {"PIXEL_INDEX_BITS": 9, "LOW_AREA": 1}),
    "alternate": ("dac_sequencer", {"ALTERNATE": 1, "X_INTERPOLATED": 0, "X_POWER_UP_CODE": 32768}),
    "spi": ("dac_spi", {}),
    "spi_chain": ("dac_spi", {"TOPOLOGY": 3, "FRAME_BITS": 24, "WORD_BITS": 20, "HALF_PERIOD": 3, "CPHA": 1}),
    "spi_two_channels": ("dac_spi", {"TOPOLOGY": 1, "FRAME_BITS": 24, "LDAC_CLOCKS": 0}),
    "axi_stream": ("dac_axi_stream", {"WORD_BITS": 20}),
    "axi_lite": ("dac_axi_lite", {"ADDRESS_BITS": 32}),
    "axi_lite_fourier": ("dac_axi_lite", {"FOURIER": 1, "COUNT_BITS": 32, "X_INDEX_BITS": 16}),
    "wishbone": ("dac_wishbone", {"FOURIER": 1}),
    "adc_pixels": ("adc_pixels", {}),
    "adc_two_channels": ("adc_pixels", {"CHANNELS": 2, "SAMPLE_BITS": 18, "COUNT_BITS": 14, "DEPTH_BITS": 9}),
    "marker_delay": ("dac_marker_delay", {"SIGNALS": 5, "DELAY_BITS": 10}),
    "fourier_renderer": ("dac_fourier", {"MULTIPLIER": 1}),
    "coding": ("dac_coding", {}),
    "boot": ("dac_boot", {}),
    "slow_boot": ("dac_slow_boot", {}),
    "pixel_boot": ("dac_pixel_boot", {}),
    "loader": ("program_loader", {"FOURIER": 1, "UPDATE_RATE": 500_000}),
    "loader_direct": (
        "program_loader",
        {"X_INTERPOLATED": 0, "Y_INTERPOLATED": 0, "DAC_BITS": 24, "MEMORY_BYTES": 8192, "UPDATE_RATE": 500_000},
    ),
    "slow_part_scanner": ("dac_sequencer", {"SLOW_PART": 1, "LOW_AREA": 1, "SHAPING": 3, "X_INTERPOLATED": 3}),
}


def check(
    top: str, parameters: Mapping[str, int], run_in: Path, folder: Path = MODULES
) -> subprocess.CompletedProcess[str]:
    (run_in / "words.mem").write_text("0\n", "ascii")
    given = {name: written(value) for name, value in complete(top, parameters).items()}
    values = " ".join(f"-chparam {name} {value}" for name, value in given.items())
    script = (
        f"read_verilog -defer {folder}/*.v {BUS}/*.v {ADC}/*.v {SLOW}/*.v {PAIR}/*.v; "
        f"hierarchy -check -top {top} {values}; proc; opt; check -assert; "
        "select -assert-none t:$dlatch t:$adlatch t:$dlatchsr t:$sr t:$_DLATCH_* t:$_SR_*"
    )
    return subprocess.run([tool("yosys"), "-q", "-p", script], capture_output=True, text=True, cwd=run_in)


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(2, CHECKED))
def test_has_no_latch_and_no_conflict(name: str, tmp_path: Path) -> None:
    done = check(*CHECKED[name], tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.rest
@pytest.mark.parametrize(
    ("text", "instead"),
    [
        (
            "assign writable = !committed && !draining;",
            "reg w; assign writable = w; always @* if (take) w = committed;",
        ),
        ("assign writable = !committed && !draining;", "assign writable = !committed; assign writable = !draining;"),
        ("assign writable = !committed && !draining;", "assign writable = !writable && !draining;"),
    ],
    ids=["latch", "two_drivers", "loop"],
)
def test_a_fault_would_be_seen(text: str, instead: str, tmp_path: Path) -> None:
    for path in MODULES.glob("dac_*.v"):
        (tmp_path / path.name).write_text(path.read_text("utf-8"), "utf-8")
    bank = tmp_path / "dac_bank.v"
    assert bank.read_text("utf-8").count(text) == 1
    bank.write_text(bank.read_text("utf-8").replace(text, instead), "utf-8")
    assert check("dac_sequencer", {}, tmp_path, tmp_path).returncode != 0


# The page.
def holds(name: str, cells: int | None, mhz: float | None, multipliers: int) -> None:
    case = resources.CASES[name]
    if case.most_cells is not None:
        assert cells is not None
        assert cells <= case.most_cells
    if case.least_mhz is not None:
        assert mhz is not None
        assert mhz >= case.least_mhz
    if case.most_multipliers is not None:
        assert multipliers <= case.most_multipliers


@pytest.mark.parametrize("name", resources.CASES)
def test_page_meets_the_requirements(name: str) -> None:
    row = resources.page_rows()[name]
    holds(name, int(row[4] or 0), float(row[9] or 0), int(row[8]))


def pinned() -> bool:
    """The tools are those of the page; with others, only the requirements hold."""
    version = subprocess.run([tool("yosys"), "-V"], capture_output=True, text=True, check=True).stdout
    return re.match(r"Yosys 0\.23 ", version) is not None


def test_the_page_is_of_this_verilog() -> None:
    """What is measured follows from what the digest is of, and from the versions of the tools."""
    rest = resources.PAGE.read_text("utf-8").partition(resources.BEGIN)[2]
    rows, _, rest = rest.partition(resources.END)
    digest = resources.DIGEST.match(rest)
    assert digest is not None
    assert digest[1] == resources.digest(rows), "run `make resources`"


@pytest.mark.parametrize("old", ["+ step", "reg ", "1'b1"])
def test_a_change_of_the_verilog_changes_the_digest(tmp_path: Path, old: str) -> None:
    for path in MODULES.rglob("*.v"):
        copy = tmp_path / path.relative_to(MODULES)
        copy.parent.mkdir(exist_ok=True)
        copy.write_text(path.read_text("utf-8"), "utf-8")
    assert resources.digest("", tmp_path) == resources.digest("") != resources.digest("a row")
    module = tmp_path / "dac_interpolator.v"
    text = module.read_text("utf-8")
    module.write_text(f"// another comment\n{text}", "utf-8")
    assert resources.digest("", tmp_path) == resources.digest("")
    assert old in text
    module.write_text(text.replace(old, f"{old[:-1]}0", 1), "utf-8")
    assert resources.digest("", tmp_path) != resources.digest("")


@pytest.mark.rest
@pytest.mark.parametrize(
    "name",
    long(
        ["axis_serial", "axis_serial_ECP5", "axis_7-series_24"],
        ["axis", "axis_serial", "loader", "axis_serial_ECP5", "axis_ECP5_16", "axis_7-series_16", "axis_7-series_24"],
    ),
)
def test_meets_the_requirements(name: str) -> None:
    """At the first seed: the cells are near those of the page, the rate is at least that of its slowest seed."""
    tool("nextpnr-ice40")
    result = resources.measure(resources.CASES[name], resources.SEEDS[:1])
    row = resources.page_rows()[name]
    holds(name, result.cells, result.mhz, result.counts["multipliers"])
    if pinned():
        assert [str(result.counts[kind]) for kind in ("LUT", "FF", "RAM", "multipliers")] == row[5:9]
    if pinned() and result.cells is not None:
        assert abs(result.cells - int(row[4])) <= 10  # packing depends on the seed
    if pinned() and result.mhz is not None:
        assert result.mhz >= int(row[9]) - 0.5


@pytest.mark.rest
def test_multipliers_of_the_ecp5_are_those_of_the_page() -> None:
    """Without a placement."""
    counts = resources.measure(resources.CASES["axis_ECP5_16"], ()).counts
    holds("axis_ECP5_16", None, None, counts["multipliers"])
    if pinned():
        assert [str(counts[kind]) for kind in ("LUT", "FF", "RAM", "multipliers")] == resources.page_rows()[
            "axis_ECP5_16"
        ][5:9]


@pytest.mark.parametrize("name", [pytest.param(name, marks=LONG_TEST) for name in resources.CASES])
def test_page_is_what_is_measured(name: str) -> None:
    case = resources.CASES[name]
    result = resources.measure(case)
    holds(name, result.cells, result.mhz, result.counts["multipliers"])
    if pinned():
        assert resources.row(case, result) in resources.PAGE.read_text("utf-8").splitlines()
