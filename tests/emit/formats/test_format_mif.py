"""MIF files as srecord reads them, against the words of the manifest."""

import re
from pathlib import Path

import pytest
from building import NAME, run_clean
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted
from manifest_integers import memories
from sets import quick


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("mif"), request.param, "mif")


def test_every_address_has_its_word(built: Formatted) -> None:
    for name, (words, bits) in memories(built.manifest).items():
        text = built.file(f"_{name}.mif").decode("ascii")
        settings = dict(re.findall(r"^(\w+)=(\w+);$", text, re.MULTILINE))
        radix = {"ADDRESS_RADIX": "HEX", "DATA_RADIX": "HEX"}
        assert settings == {"WIDTH": str(bits), "DEPTH": str(len(words)), **radix}, name
        body = text.split("CONTENT BEGIN\n")[1].removesuffix("END;\n")
        pairs = [re.fullmatch(r"([0-9A-F]+) : ([0-9A-F]+);", line) for line in body.splitlines()]
        found = [(int(pair[1], 16), int(pair[2], 16)) for pair in pairs if pair]
        assert found == [(at, word % 2**bits) for at, word in enumerate(words)], name
        assert len(pairs) == len(found)


@pytest.mark.common
def test_srecord_reads_the_words_of_the_manifest(built: Formatted, tmp_path: Path) -> None:
    """It gives a word as many bytes as its bits take, the least significant first."""
    for name, (words, bits) in memories(built.manifest).items():
        run_clean(["srec_cat", built.folder / f"{NAME}_{name}.mif", "-mif", "-o", tmp_path / name, "-binary"])
        size = -(-bits // 8)
        wanted = b"".join((word % 2**bits).to_bytes(size, "little") for word in words)
        assert (tmp_path / name).read_bytes() == wanted, name


def test_a_changed_word_is_found(tmp_path: Path) -> None:
    names = [f"{NAME}_{name}.mif" for name in ("x", "y_fourier", "program")]
    check_finds_a_flip(formatted(tmp_path, "short", "mif"), "mif", names)
