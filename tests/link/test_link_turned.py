"""Uploads of a scan at an angle: to devices that play slow parts, and to those that do not."""

from pathlib import Path

import pytest
from client_rig import Bench, Watched, info_for, model
from editing import run
from replacing import replace
from turned_scans import write_turned

from tablegen.link.acceptance import first_objection
from tablegen.link.messages import AxisLimits, More, Reason, Request
from tablegen.link.prepare import PreparedScan
from tablegen.link.program_image import PROGRAM_BYTES, make_image, parts_of, take_apart

pytestmark = pytest.mark.common

SHORT = ("timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")
NAMES = ["table", "second table", "slow table", "gain", "ratio"]


@pytest.fixture(scope="module")
def toml(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_turned(tmp_path_factory.mktemp("turned"), 30.0, *SHORT)


@pytest.fixture(scope="module")
def folder(toml: Path) -> Path:
    assert run("build", toml, "-o", toml.parent / "build", "-q").status == 0
    return toml.parent / "build"


@pytest.fixture(scope="module")
def scan(folder: Path) -> PreparedScan:
    return PreparedScan.of_build(folder)


def test_an_image_has_the_parts_of_both_axes(scan: PreparedScan) -> None:
    image = scan.image("table")
    contents = take_apart(image.data, image.info.x, image.info.y)
    size = PROGRAM_BYTES
    for page, shape, axis in ((1, image.info.x, scan.program.x), (2, image.info.y, scan.program.y)):
        parts = parts_of(contents.words, page, shape)
        assert [part.name for part in parts] == NAMES
        size += sum(part.length * part.size for part in parts)
        assert repr(contents.program(page).frame()) == repr(axis.frame())  # type: ignore[union-attr]
    assert len(image.data) == size


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_range_and_the_step_of_its_certificate_pass_and_no_less(scan: PreparedScan, axis: str) -> None:
    program = getattr(scan.program, axis)
    least, most, steepest = program.extremes
    fits = {"code_min": least, "code_max": most, "max_step": steepest, "park_code": most}
    everything = AxisLimits(0, (1 << program.output.dac_bits) - 1, 1 << 24, 1 << 24)

    def reason(**changes: int) -> Reason | None:
        output = replace(program.output, **(fits | changes))
        changed = replace(program, fast=replace(program.fast, output=output))
        image = make_image(replace(scan.program, **{axis: changed}), scan.digest)
        contents = take_apart(image.data, image.info.x, image.info.y)
        objection = first_objection(contents, everything, everything, None)
        return None if objection is None else objection[0]

    assert reason() is None
    assert reason(code_max=most - 1, park_code=most - 1) == reason(code_min=least + 1) == Reason.RANGE
    assert reason(max_step=steepest - 1) == Reason.SLEW


def test_upload_and_readback(toml: Path, folder: Path, scan: PreparedScan) -> None:
    bench = Bench(model(info_for(scan)))
    outcome = bench.run("upload", folder)
    assert outcome.status == 0, outcome.err
    assert outcome.out.startswith(f"annexin_200nm {scan.digest[:12]} is active, generation 2")
    assert bench.device.status().hash.hex() == scan.digest
    assert "is already active" in bench.run("upload", toml).out
    read = bench.run("readback", folder)
    assert (read.status, read.out.split(":")[1]) == (0, f" {len(scan.image('table').data)} bytes, all equal\n")
    bench.run("arm")
    bench.run("trigger")
    assert bench.run("upload", toml, "--force", "--swap", "line").status == 0


def test_a_readback_names_the_word_that_differs(folder: Path, scan: PreparedScan) -> None:
    from tablegen.link.word_difference import differences

    data = bytearray(scan.image("table").data)
    data[-1] ^= 1
    data[60 + 64] ^= 1
    names = [difference.word for difference in differences(scan, bytes(data))]
    assert names == ["x: slow_remainder", "y: ratio word 16"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"more": More(0)}, "the device plays one table for each axis alone: build its firmware with DAC_SLOW_PART=1"),
        ({"slow_knots": 16}, "x: 17 knots; the device has memory for 16"),
        ({"slow_index_bits": 5}, "y: a slow table of 64 words; the device holds 32"),
    ],
)
def test_a_device_without_room_gets_nothing(
    changes: dict[str, object], message: str, folder: Path, scan: PreparedScan
) -> None:
    bench = Bench(model(replace(info_for(scan), **changes)))
    bench.open = lambda url, baud: setattr(bench, "line", Watched(bench.device)) or bench.line  # type: ignore[method-assign]
    outcome = bench.run("upload", folder)
    assert (outcome.status, message in outcome.err) == (9, True), outcome.err
    assert bench.line.count(Request.BEGIN) == 0  # type: ignore[attr-defined]


def test_a_dry_run_prints_sizes(folder: Path, scan: PreparedScan) -> None:
    outcome = run("upload", folder, "--dry-run")
    assert outcome.status == 0
    assert f"table     {len(scan.image('table').data):>6} " in outcome.out
    assert "fourier   none: x: a table with a slow part is not sent as Fourier words" in outcome.out
