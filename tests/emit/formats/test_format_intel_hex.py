"""Intel HEX files as srecord reads them, against the words of the manifest."""

from pathlib import Path

import pytest
from building import NAME, run_clean
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted, little_endian
from manifest_integers import memories
from sets import quick

from tablegen.emit.formats.intel_hex import _records


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("intel_hex"), request.param, "intel-hex")


def decoded(text: bytes) -> bytes:
    """The bytes of a file from address 0, by the format's description; every sum is checked."""
    data, upper = bytearray(), 0
    *lines, last = text.decode("ascii").splitlines()
    assert last == ":00000001FF"
    for line in lines:
        record = bytes.fromhex(line.removeprefix(":"))
        assert line[0] == ":"
        assert sum(record) % 256 == 0
        assert len(record) == record[0] + 5
        if record[3] == 4:
            upper = int.from_bytes(record[4:6], "big") << 16
        else:
            assert record[3] == 0
            assert upper + int.from_bytes(record[1:3], "big") == len(data)
            data += record[4:-1]
    return bytes(data)


def test_the_bytes_are_the_words_of_the_manifest(built: Formatted) -> None:
    for name, (words, bits) in memories(built.manifest).items():
        assert decoded(built.file(f"_{name}.hex")) == little_endian(words, bits), name


@pytest.mark.common
def test_srecord_reads_the_words_of_the_manifest(built: Formatted, tmp_path: Path) -> None:
    for name, (words, bits) in memories(built.manifest).items():
        file = built.folder / f"{NAME}_{name}.hex"
        run_clean(["srec_cat", file, "-intel", "-o", tmp_path / name, "-binary"])
        assert (tmp_path / name).read_bytes() == little_endian(words, bits), name


def test_more_than_64_kib_have_their_addresses() -> None:
    data = bytes(range(256)) * 600 + b"end"
    text = "".join(_records(data))
    assert text.splitlines()[4096] == ":020000040001F9"
    assert decoded(text.encode("ascii")) == data


@pytest.mark.common
def test_srecord_reads_more_than_64_kib(tmp_path: Path) -> None:
    data = bytes(range(256)) * 600 + b"end"
    (tmp_path / "long.hex").write_text("".join(_records(data)), "ascii")
    run_clean(["srec_cat", tmp_path / "long.hex", "-intel", "-o", tmp_path / "long", "-binary"])
    assert (tmp_path / "long").read_bytes() == data


def test_a_changed_word_is_found(tmp_path: Path) -> None:
    names = [f"{NAME}_{name}.hex" for name in ("x", "y_fourier", "program")]
    check_finds_a_flip(formatted(tmp_path, "short", "intel-hex"), "intel-hex", names)
