"""What is said of a scan before a device is asked: forms, sizes, what would not fit; and what it reads back."""

import tomllib
from pathlib import Path

import pytest
from building import EXAMPLE, IN_C, VARIANTS, Variant, build, write_variant
from client_rig import info_for
from replacing import replace

from tablegen.config.load import load
from tablegen.link.acceptance import first_objection
from tablegen.link.errors import Unsuitable
from tablegen.link.messages import AxisLimits, AxisShape, DeviceInfo, Feature, Reason
from tablegen.link.prepare import LEFT_ALIGNED, TWOS_COMPLEMENT, PreparedScan, check, harmonics_of
from tablegen.link.program_image import make_image, take_apart
from tablegen.link.refusal_reasons import explain, refused
from tablegen.link.word_difference import differences
from tablegen.manifest.read import NotABuild
from tablegen.planning.line_plan import make_plan


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("example"), Variant({"timing.lines": 40})).folder


@pytest.fixture(scope="module")
def scan(folder: Path) -> PreparedScan:
    return PreparedScan.of_build(folder)


@pytest.fixture(scope="module")
def info(scan: PreparedScan) -> DeviceInfo:
    return info_for(scan)


def objections(scan: PreparedScan, info: DeviceInfo, form: str = "table", any_rate: bool = False) -> list[str]:
    """What is found; nothing where it fits."""
    image = scan.image(form, info)  # type: ignore[arg-type]
    try:
        check(scan, image, info, (info.x_limits, info.y_limits), any_rate)
    except Unsuitable as unsuitable:
        return str(unsuitable).splitlines()
    return []


# Where scans come from


@pytest.mark.common
@pytest.mark.parametrize("variant", ["example", "direct_steps", "bits_24", "left_aligned", "inverting"])
def test_a_plan_and_its_build_are_the_same_upload(tmp_path: Path, variant: str) -> None:
    of_build = PreparedScan.of_build(build(tmp_path, VARIANTS[variant]).folder)
    of_plan = PreparedScan.of_plan(make_plan(load(write_variant(tmp_path / "again", VARIANTS[variant]))))
    assert (of_build.name, of_build.digest) == (of_plan.name, of_plan.digest)
    assert of_build.image("table") == of_plan.image("table")
    assert of_build.image("auto") == of_plan.image("auto")


def test_a_manifest_that_was_edited_is_not_uploaded(tmp_path: Path, folder: Path) -> None:
    text = (folder / "manifest.json").read_text("ascii")
    (tmp_path / "manifest.json").write_text(text.replace('"park_code": ', '"park_code": 1', 1), "ascii")
    with pytest.raises(NotABuild):
        PreparedScan.of_build(tmp_path)
    assert '"settle_lines": 2' in text
    (tmp_path / "manifest.json").write_text(text.replace('"settle_lines": 2', '"settle_lines": 0'), "ascii")
    with pytest.raises(NotABuild, match="was changed after the build"):
        PreparedScan.of_build(tmp_path)


# Forms


def test_automatic_is_the_smaller_form_that_the_device_takes(scan: PreparedScan, info: DeviceInfo) -> None:
    table, fourier = scan.image("table"), scan.image("fourier")
    assert 8 * len(fourier.data) <= len(table.data), "an eighth of the bytes, both axes"
    assert scan.image("auto").data == scan.image("auto", info).data == fourier.data
    assert scan.image("auto", replace(info, features=Feature.TABLES)).data == table.data
    harmonics = harmonics_of(fourier.data)
    assert harmonics[0] < harmonics[1]
    assert harmonics_of(scan.image("auto", replace(info, harmonics=harmonics[0])).data) == (harmonics[0], 0)
    assert scan.image("auto", replace(info, harmonics=harmonics[0] - 1)).data == table.data
    only = replace(info, features=Feature.FOURIER)
    assert scan.image("auto", only).data == fourier.data


def test_a_direct_table_has_no_fourier_words(tmp_path: Path) -> None:
    direct = PreparedScan.of_build(build(tmp_path, VARIANTS["direct"]).folder)
    assert direct.image("auto").data == direct.image("table").data
    with pytest.raises(Unsuitable, match="x: a direct table cannot be computed"):
        direct.image("fourier")
    mixed = Variant({"x.table": {"mode": "direct", "bits": 16}, "timing.lines": 40})
    both = PreparedScan.of_build(build(tmp_path / "mixed", mixed).folder)
    assert [harmonics > 0 for harmonics in harmonics_of(both.image("auto").data)] == [False, True]
    assert objections(both, info_for(both), "auto") == []


# What would be refused


@pytest.mark.common
@pytest.mark.parametrize("variant", sorted(VARIANTS))
def test_every_variant_fits_the_device_that_is_built_for_it(tmp_path: Path, variant: str) -> None:
    scan = PreparedScan.of_build(build(tmp_path, VARIANTS[variant]).folder)
    info = replace(info_for(scan), harmonics=512, image_bytes=1 << 22)
    assert objections(scan, info, "table") == []
    assert objections(scan, info, "auto") == []


def axis(info: DeviceInfo, **changes: int) -> DeviceInfo:
    """A device whose x is another one."""
    return replace(info, x=replace(info.x, **changes))


WRONG = {
    "shape: words": (
        lambda info: axis(info, word_bits=18),
        "table",
        ["x: table words of 16 bits; the device has 18: set table.bits"],
    ),
    "shape: codes": (
        lambda info: axis(info, dac_bits=18),
        "table",
        [
            "x: codes of 16 bits; the device has 18: set dac.bits",
            "x: converter words of 16 bits, offset-binary; the device sends of 16 bits, offset-binary, right-aligned: "
            "set dac.coding, word_bits and align",
        ],
    ),
    "shape: length": (
        lambda info: axis(info, index_bits=10),
        "table",
        ["x: a table of 2048 words; the device holds 1024: set table.length"],
    ),
    "coding": (
        lambda info: axis(info, converter=16 + TWOS_COMPLEMENT),
        "table",
        [
            "x: converter words of 16 bits, offset-binary; the device sends of 16 bits, twos-complement: "
            "set dac.coding, word_bits and align"
        ],
    ),
    "alignment": (
        lambda info: axis(info, converter=24 + LEFT_ALIGNED),
        "table",
        [
            "x: converter words of 16 bits, offset-binary; the device sends of 24 bits, offset-binary, left-aligned: "
            "set dac.coding, word_bits and align"
        ],
    ),
    "bytes": (
        lambda info: replace(info, image_bytes=5000),
        "table",
        ["8384 bytes; the device accepts 5000: upload --as fourier, or make the tables shorter"],
    ),
    "harmonics": (
        lambda info: replace(info, harmonics=20),
        "fourier",
        ["64 harmonics; the device supports at most 20: lower band_limit.harmonics, or upload --as table"],
    ),
    "no Fourier": (
        lambda info: replace(info, features=Feature.TABLES),
        "fourier",
        ["the device does not support Fourier words; upload --as table"],
    ),
    "no tables": (
        lambda info: replace(info, features=Feature.FOURIER),
        "table",
        ["the device does not support tables; upload --as fourier"],
    ),
    "rate": (
        lambda info: replace(info, update_rate_hz=250000),
        "table",
        [
            "built for 500000 ticks a second; the device runs at 250000: each line would take 2 times as long; set "
            "dac.update_rate_hz, or allow it with --any-rate"
        ],
    ),
    "codes": (
        lambda info: replace(info, y_limits=replace(info.y_limits, code_min=5000)),
        "table",
        [
            "y: its codes 0..65535 go beyond 5000..65535 of the device; lower scanner and scan, or raise the limit in "
            "its build"
        ],
    ),
    "step": (
        lambda info: replace(info, x_limits=replace(info.x_limits, max_step=100)),
        "table",
        [
            "x: its max_step of 2621 codes a tick is beyond 100 of the device; lower max_slew_v_per_s, or raise the "
            "limit"
        ],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_would_be_refused_is_said_with_a_remedy(scan: PreparedScan, info: DeviceInfo, case: str) -> None:
    change, form, said = WRONG[case]
    assert objections(scan, change(info), form) == said


def test_a_device_without_splines_takes_no_cubic_table(tmp_path: Path) -> None:
    scan = PreparedScan.of_build(build(tmp_path, IN_C["cubic"]).folder)
    info = replace(info_for(scan), harmonics=512)
    said = "{}: a cubic table; the device plays none: build it with DAC_SPLINE=1 in C, {}_INTERPOLATED=3 in Verilog, "
    assert objections(scan, info) == [f"{said.format(axis, axis.upper())}or set table.mode" for axis in "xy"]
    for form in ("table", "fourier", "auto"):
        assert objections(scan, replace(info, degree=3), form) == []


def test_everything_is_said_at_once(scan: PreparedScan, info: DeviceInfo) -> None:
    wrong = replace(axis(info, index_bits=10, word_bits=18), image_bytes=5000, update_rate_hz=1)
    assert len(objections(scan, wrong)) == 4


def test_another_rate_can_be_allowed_and_an_unknown_one_is_none(scan: PreparedScan, info: DeviceInfo) -> None:
    for rate in (0, 499999, 500000, 500001):
        assert objections(scan, replace(info, update_rate_hz=rate)) == []
    assert objections(scan, replace(info, update_rate_hz=499998)) != []
    assert objections(scan, replace(info, update_rate_hz=1), any_rate=True) == []


# Reasons

NOT_OF_AN_AXIS = {"version", "length", "harmonics", "incomplete"}


@pytest.mark.parametrize("reason", list(Reason), ids=lambda reason: reason.name)
def test_every_reason_has_a_sentence_of_its_own_with_a_remedy(
    scan: PreparedScan, info: DeviceInfo, reason: Reason
) -> None:
    image = scan.image("table")
    contents = take_apart(image.data, image.info.x, image.info.y)
    limits = info.x_limits, info.y_limits
    for found in (explain(reason, 1), explain(reason, 1, info, contents, limits)):
        assert len(found) > 30
        assert found not in [explain(other, 1) for other in Reason if other != reason]
    error = refused(4, reason, 1, info)
    assert str(error).startswith(f"the device refused COMMIT ({reason.name.lower()}): ")
    assert (error.request, error.reason, error.detail) == (4, reason, 1)


def test_reasons_are_those_of_the_document() -> None:
    page = (EXAMPLE.parents[1] / "docs" / "protocol.md").read_text("utf-8")
    for reason in Reason:
        assert f"| {reason.value} | `{reason.name.lower()}` |" in page


def test_unknown_reasons_and_requests_are_told_by_their_numbers() -> None:
    error = refused(77, 200, 12345)
    assert str(error).startswith("the device refused request 77 (200): reason 200, detail 12345")


def test_checks_name_axis_word_and_value(scan: PreparedScan, info: DeviceInfo) -> None:
    """Held against what the acceptance of docs/protocol.md finds in spoilt programs."""
    x = scan.program.x
    words = x.words.copy()
    words[77] = -words[77]
    program = replace(scan.program, x=replace(x, words=words))
    spoilt = replace(scan, program=program)
    image = make_image(program, scan.digest)
    contents = take_apart(image.data, image.info.x, image.info.y)
    limits = info.x_limits, info.y_limits
    found = first_objection(contents, *limits, None)
    assert found is not None
    reason, detail = found
    assert (reason, detail & 1) == (Reason.SLEW, 0)
    text = explain(reason, detail, info, contents, limits)
    assert text.startswith(f"x: at word {detail >> 1} of its table it moves faster than its max_step of 2621 codes")
    assert objections(spoilt, info) == [text]
    low = AxisLimits(0, 65535, 1 << 20, 10)
    assert explain(Reason.JUMP, 1, info, contents, (low, low)).startswith("y: it begins further than 10 codes")
    assert f"word 77 of its table ({words[77]})" in explain(Reason.RANGE, 2 * 77, info, contents, limits)
    assert "does not fit 16 bits" in explain(Reason.WORD, 2 * 3, info, contents, limits)
    assert "(at most" not in explain(Reason.LENGTH, info.image_bytes, info)
    assert f"at most {info.image_bytes} bytes" in explain(Reason.LENGTH, info.image_bytes, info)


# Reading back


@pytest.mark.parametrize("form", ["table", "fourier"])
def test_the_same_image_has_no_difference(scan: PreparedScan, form: str) -> None:
    assert differences(scan, scan.image(form).data) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("form", "at", "said"),
    [
        ("table", 0, "scan: line_ticks (byte 0) is 1251, not 1250"),
        ("table", 64 + 4 * 3, "x: gain (byte 76) is {found}, not {word}"),
        ("table", 128 + 4 * 9, "y: park_code (byte 164) is {found}, not {word}"),
        ("table", 60, "scan: unused word 15 (byte 60) is 1, not 0"),
        ("table", 192, "x: table word 0 (byte 192) is {found}, not {word}"),
        ("table", 192 + 2 * 2048 + 34, "y: table word 17 (byte 4322) is {found}, not {word}"),
        ("fourier", 192 + 8, "x: Fourier word 2 (byte 200) is {found}, not {word}"),
    ],
)
def test_the_first_difference_is_named(scan: PreparedScan, form: str, at: int, said: str) -> None:
    image = scan.image(form).data  # type: ignore[arg-type]
    changed = bytearray(image)
    changed[at] ^= 1
    if at == 0:
        changed[0] = image[0] + 1
    size = 2 if form == "table" and at >= 192 else 4
    word, found = (int.from_bytes(data[at : at + size], "little", signed=True) for data in (image, changed))
    told = differences(scan, bytes(changed))
    assert [str(difference) for difference in told] == [said.format(word=word, found=found)]


def test_an_image_of_another_length_is_told(scan: PreparedScan) -> None:
    image = scan.image("table").data
    assert str(differences(scan, image[:-1])[0]) == "its image ends before y: table word 2047 (byte 8382)"
    assert str(differences(scan, image + b"12")[0]) == "after the last word (byte 8384) is 2, not 0"
    assert len(differences(scan, image[:-100])) == 50
    assert str(differences(scan, b"")[0]) == "its image ends before scan: line_ticks (byte 0)"
    assert str(differences(scan, image[:190])[0]) == "its image ends before y: slow_remainder (byte 188)"


def test_the_example_is_what_these_numbers_are_of(scan: PreparedScan) -> None:
    values = tomllib.loads(EXAMPLE.read_text("utf-8"))
    assert values["dac"]["update_rate_hz"] == 500000.0
    assert isinstance(scan.image("table").info.x, AxisShape)
