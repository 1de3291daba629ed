"""The WAV file as Python's reader has it, against what the manifest plays."""

import struct
import wave
from fractions import Fraction
from pathlib import Path

import pytest
from building import NAME
from editing import SCAN, edited, run, write_pair
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted
from manifest_integers import played_codes
from replacing import replace
from sets import quick

from tablegen.base.input_errors import Unphysical
from tablegen.emit.formats.wav import FORMAT
from tablegen.emit.stored import stored_content
from tablegen.manifest.read import read_build


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("wav"), request.param, "wav")


def test_the_samples_are_a_frame_of_the_manifest(built: Formatted) -> None:
    manifest = built.manifest
    axes, sequence = manifest["axes"], manifest["sequence"]
    dac_bits = axes["x"]["output"]["dac_bits"]
    bits = 16 if dac_bits <= 16 else 32
    with wave.open(str(built.folder / f"{NAME}.wav"), "rb") as file:
        assert (file.getnchannels(), 8 * file.getsampwidth(), file.getcomptype()) == (2, bits, "NONE")
        assert Fraction(file.getframerate()) == Fraction(*sequence["update_rate_hz"])
        ticks = file.getnframes()
        assert ticks == sequence["line_ticks"] * sequence["frame_lines"]
        data = file.readframes(ticks)
    samples = struct.unpack(f"<{2 * ticks}{'h' if bits == 16 else 'i'}", data)
    wanted = {}
    for name, axis in axes.items():
        codes = played_codes(axis) * (ticks // axis["line"]["ticks"])
        wanted[name] = [(code - 2 ** (dac_bits - 1)) * 2 ** (bits - dac_bits) for code in codes]
    assert list(samples[0::2]) == wanted["x"]
    assert list(samples[1::2]) == wanted["y"]


def test_the_header_is_that_of_the_specification(built: Formatted) -> None:
    """The canonical 44 bytes, whose sizes are those of the file."""
    content = built.file(".wav")
    riff, size, kind, fmt, length, pcm, channels, rate, byte_rate, block, bits, data, data_size = struct.unpack(
        "<4sI4s4sIHHIIHH4sI", content[:44]
    )
    assert (riff, kind, fmt, length, pcm, channels, data) == (b"RIFF", b"WAVE", b"fmt ", 16, 1, 2, b"data")
    assert (size, data_size) == (len(content) - 8, len(content) - 44)
    assert (block, byte_rate) == (2 * bits // 8, rate * block)


@pytest.mark.parametrize(
    ("rate", "why"),
    [
        (
            Fraction(999_999, 2),
            "the update rate is 499999.5 Hz, and the sample rate of a WAV file a whole number of Hz",
        ),
        (Fraction(1 << 31), "is 2147483648 Hz, and the sample rate of a WAV file of 4 bytes a tick at most 1073741823"),
    ],
)
def test_a_rate_that_no_file_has_is_refused(tmp_path: Path, rate: Fraction, why: str) -> None:
    content = stored_content(read_build(formatted(tmp_path, "short", "wav").folder))
    schedule = replace(content.schedule, update_rate_hz=rate)
    with pytest.raises(Unphysical, match=why):
        FORMAT.files(replace(content, program=replace(content.program, schedule=schedule)))


def test_the_refusal_of_a_rate_says_where_and_what_fits(tmp_path: Path) -> None:
    scan = write_pair(tmp_path, edited(SCAN, "dac.update_rate_hz = 500000.4", "+ [emit]\nformats = ['wav']"))
    outcome = run("build", scan, "-o", tmp_path / "out")
    assert outcome.status == 2
    (told,) = outcome.messages
    line = scan.read_text("utf-8").splitlines().index("formats = ['wav']") + 1
    assert told.startswith(f"{scan}:{line}: emit.formats: the update rate is 500000.4 Hz")
    assert told.endswith("a dac.update_rate_hz of 500000 would fit")
    assert not (tmp_path / "out").exists()


def test_a_changed_sample_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "wav"), "wav", [f"{NAME}.wav"])
