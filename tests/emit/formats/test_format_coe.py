"""COE files against the words of the manifest, by the description of AMD; srecord 1.64 reads none."""

import re
from pathlib import Path

import pytest
from building import NAME
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted
from manifest_integers import memories
from sets import quick


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("coe"), request.param, "coe")


def read(text: bytes) -> list[int]:
    """The words of a file, by AMD's description: settings end with a semicolon, words are separated by commas."""
    plain = re.sub(r"^;.*\n", "", text.decode("ascii"), flags=re.MULTILINE)
    settings = dict(setting.strip().split("=", 1) for setting in plain.split(";") if setting.strip())
    settings = {key.strip().lower(): value for key, value in settings.items()}
    assert settings.keys() == {"memory_initialization_radix", "memory_initialization_vector"}
    radix = int(settings["memory_initialization_radix"])
    return [int(word, radix) for word in re.split(r"[,\s]+", settings["memory_initialization_vector"].strip())]


def test_the_words_are_those_of_the_manifest(built: Formatted) -> None:
    for name, (words, bits) in memories(built.manifest).items():
        text = built.file(f"_{name}.coe")
        assert read(text) == [word % 2**bits for word in words], name
        assert text.startswith(f"; {NAME}, ".encode())


def test_a_changed_word_is_found(tmp_path: Path) -> None:
    names = [f"{NAME}_{name}.coe" for name in ("x", "y_fourier", "program")]
    check_finds_a_flip(formatted(tmp_path, "short", "coe"), "coe", names)
