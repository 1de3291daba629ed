"""The options in packages: those that the scan needs, under those of the project."""

import re
from pathlib import Path

import pytest
from building import NAME, Build, run_clean
from packed_library import DEMANDING
from short_scans import short

PACKAGES = ["arduino", "platformio", "esp-idf"]
FILE = "tablegen_options.h"
OPTIONS = ("TABLE_STORAGE_BITS", "OUTPUT_STORAGE_BITS", "SHAPING", "SPLINE")
DEFAULTS = dict(zip(OPTIONS, (16, 16, 0, 0), strict=True))


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """A build as three packages, of a scan that needs other values than the defaults."""
    return short(tmp_path_factory.mktemp("packages"), {"emit.formats": PACKAGES, **DEMANDING})


def values(folder: Path, *options: str | Path) -> dict[str, int]:
    """What the runtime in a folder is compiled with."""
    text = run_clean(["gcc", "-std=c99", "-Wpedantic", "-Wundef", "-E", "-dM", *options, folder / "dac_config.h"])
    return {name: int(value) for name, value in re.findall(r"^#define DAC_(\w+) (\d+)$", text, re.MULTILINE)}


def chosen(folder: Path, *options: str | Path) -> dict[str, int]:
    """Those of them that a scan decides."""
    return {name: value for name, value in values(folder, *options).items() if name in OPTIONS}


def needed(built: Build) -> dict[str, int]:
    """What the constants of a build say, of which some are missing at the default."""
    pairs = re.findall(rf"^#define {NAME.upper()}_(\w+) (\d+)$", built.files[f"{NAME}.h"].decode("ascii"), re.MULTILINE)
    return DEFAULTS | {name: int(value) for name, value in pairs if name in OPTIONS}


def test_the_runtime_has_the_options_of_the_scan(built: Build) -> None:
    assert needed(built) == dict(zip(OPTIONS, (32, 32, 2, 1), strict=True))
    assert chosen(built.folder) == needed(built)


def test_a_build_without_packages_has_the_defaults(tmp_path: Path) -> None:
    """A negative control: the header is what tells the runtime."""
    built = short(tmp_path, {"emit.formats": ["c"], **DEMANDING})
    assert FILE not in built.files
    assert chosen(built.folder) == DEFAULTS


def test_options_of_the_compiler_win(built: Build) -> None:
    assert chosen(built.folder, "-DDAC_SHAPING=3") == needed(built) | {"SHAPING": 3}


def test_a_header_of_the_project_wins_and_leaves_the_others(built: Build, tmp_path: Path) -> None:
    (tmp_path / "my_dac_config.h").write_text("#define DAC_SHAPING 3\n#define DAC_STRIDE 1\n", "ascii")
    own = (f"-I{tmp_path}", '-DDAC_CONFIG_FILE="my_dac_config.h"')
    assert chosen(built.folder, *own) == needed(built) | {"SHAPING": 3}
    assert values(built.folder, *own)["STRIDE"] == 1


def test_tables_stay_in_flash_on_an_avr_alone(built: Build, tmp_path: Path) -> None:
    (tmp_path / "avr").mkdir()
    (tmp_path / "avr" / "pgmspace.h").write_text("", "ascii")
    avr = ("-D__AVR__", f"-I{tmp_path}")
    given = [values(built.folder, *options)["PROGMEM"] for options in ((), avr, (*avr, "-DDAC_PROGMEM=0"))]
    assert given == [0, 1, 0]
