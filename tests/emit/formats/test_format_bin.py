"""Raw files as srecord and numpy read them, against the words of the manifest."""

import sys
from pathlib import Path

import numpy as np
import pytest
from building import NAME, run_clean
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted, little_endian
from manifest_integers import memories
from sets import quick


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("bin"), request.param, "bin")


def test_numpy_reads_the_words_of_the_manifest(built: Formatted) -> None:
    assert sys.byteorder == "little"
    for name, (words, bits) in memories(built.manifest).items():
        kind = "u4" if name == "program" else "i1" if bits <= 8 else "i2" if bits <= 16 else "i4"
        assert np.fromfile(built.folder / f"{NAME}_{name}.bin", f"<{kind}").tolist() == words, name


@pytest.mark.common
def test_srecord_reads_the_words_of_the_manifest(built: Formatted) -> None:
    for name, (words, bits) in memories(built.manifest).items():
        dump = run_clean(["srec_cat", built.folder / f"{NAME}_{name}.bin", "-binary", "-o", "-", "-hex-dump"])
        found = "".join(line.partition(":")[2].partition("#")[0] for line in dump.splitlines())
        assert bytes.fromhex(found.replace("-", " ")) == little_endian(words, bits), name


def test_a_changed_word_is_found(tmp_path: Path) -> None:
    names = [f"{NAME}_{name}.bin" for name in ("x", "y_fourier", "program")]
    check_finds_a_flip(formatted(tmp_path, "short", "bin"), "bin", names)
