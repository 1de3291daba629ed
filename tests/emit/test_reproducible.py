"""The bytes of a build against those of the same build elsewhere.

Elsewhere is another directory, another day's time zone, locale or hash seed, and another processor: numpy, OpenBLAS
and the C library are told to do without the vector units that they would choose their kernels by.
"""

import os
import re
import socket
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np
import pytest
from building import EXAMPLE, REMOVED, REPOSITORY, VARIANTS, Variant, write_variant
from operator_files import operator_file
from sets import common, long

from tablegen.compensation.operator.file import operator_text

pytestmark = pytest.mark.common

# Builds several scans in one process, each beside its file, and tells which vector units numpy may use.
DRIVER = """
import sys
from pathlib import Path
from tablegen.cli import cli
for scan in sys.argv[1:]:
    cli.main(["build", scan, "-o", str(Path(scan).parent / "out"), "--quiet"], standalone_mode=False)
import numpy
core = getattr(numpy, "_core", None) or numpy.core  # numpy 1 has it in the open
features = core._multiarray_umath.__cpu_features__
print(" ".join(feature for feature, usable in features.items() if usable))
"""

NO_LIMITS: dict[str, object] = {"limits": {}}
POINTS = [
    {"offset_v": volts, "apparent_nm": 100.0 + 0.31 * volts + 0.0007 * volts**2} for volts in (5.0, 33.0, 61.0, 90.0)
]
RESPONSE = "hz,gain,phase_deg\n" + "".join(
    f"{f},{1.0 / abs(1.0 - (f / 41e3) ** 2 + 1j * f / 41e3 / 7.0):.9g},{-0.0011 * f:.9g}\n"
    for f in range(100, 90000, 700)
)
# Between them they take every branch of the float arithmetic: models, fits, dynamics and band limits.
SCANS: dict[str, Variant] = {
    "example": VARIANTS["example"],
    "direct": Variant({**VARIANTS["direct"].scan, **NO_LIMITS, "x.band_limit.harmonics": 75}),
    "finest": Variant(
        {**VARIANTS["bits_24"].scan, **NO_LIMITS, "x.offset_v": REMOVED, "x.offset_nm": 700.3},
        {"x.offset": {"points": POINTS}, "x.frequency.alpha": 0.0317},
    ),
    "lanczos": Variant(
        {**NO_LIMITS, "x.band_limit.method": "lanczos", "x.turn": 0.61803, "y.band_limit.method": "truncate"},
        {
            "x.hysteresis": {
                "model": "sinusoidal",
                "branches": [
                    {"turn": t, "forward": {"beta_max": 0.03, "rho": 2.7}, "backward": {"beta_max": 0.05, "rho": 1.9}}
                    for t in (0.45, 0.7)
                ],
            },
        },
    ),
    "refined": Variant(
        {
            **NO_LIMITS,
            "x.refinement": {
                "a": [0.00123, -0.00047, 0.0, 0.00021],
                "b": [-0.00151, 0.00062, 0.00033, -0.00009],
                "v_amplitude": 20.4,
                "v_offset": 50.0,
                "rate_hz": 400.0,
                "turn": 0.5,
                "window": [0.1, 0.9],
                "directions": "both",
            },
        }
    ),
    "measured": Variant(
        {**NO_LIMITS, "timing.line_rate_hz": 934.5, "x.size_nm": 77.7, "x.band_limit.harmonics": 40},
        {"x.resonance": {"response": "response.csv", "max_boost_db": 3.0}},
    ),
    "shaped": Variant(
        {**NO_LIMITS, "x.size_nm": 20.7, "timing.lines": 20, "dac.shaping": "scanner"},
        {
            "x.resonance": {"response": "response.csv", "max_boost_db": 3.0},
            "y.resonance": {"frequency_hz": 9131.7, "quality": 17.3, "delay_s": 1.3e-6},
        },
    ),
    "boosted": Variant(
        {**NO_LIMITS, "timing.line_rate_hz": 1990.0, "timing.pixels": 40, "x.size_of": "window", "x.size_nm": 61.0},
        {"x.resonance.max_boost_db": 1.0, "x.resonance.delay_s": 3.3e-6, "x.size.beta": 0.0},
    ),
    "operator": Variant(
        {**NO_LIMITS, "x.size_nm": 413.7, "x.offset_v": 46.3},
        {"x.hysteresis": {"model": "operator", "file": "x_operator.toml"}},
    ),
    "gentle": Variant(
        {
            **NO_LIMITS,
            "x.band_limit.max_scaling_error_percent": 0.23,
            "x.band_limit.directions": "forward",  # the way back then swings, and the range is held
            "x.band_limit.harmonics": "fewest",
            "y.band_limit.harmonics": REMOVED,
        }
    ),
    "chosen": Variant(
        {**NO_LIMITS, "x.table": {"mode": "auto"}, "y.table": {"mode": "interpolated", "max_error_lsb": 0.7}}
    ),
    "gentle operator": Variant(
        {**NO_LIMITS, "x.size_nm": 413.7, "x.offset_v": 46.3, "x.band_limit.max_scaling_error_percent": 1.7},
        {"x.hysteresis": {"model": "operator", "file": "x_operator.toml"}},
    ),
}


def operator() -> str:
    """Plays, a residual over them that differs from trace to trace, and creep."""
    file = operator_file(creep=0.027)

    def closed(values: list[float]) -> list[float]:
        """Coefficients of Chebyshev's polynomials that are 0 at both ends, as a loop that closes has them."""
        return [high - low for high, low in zip([0.0, 0.0, *values], [*values, 0.0, 0.0], strict=True)]

    lines = [
        msgspec.structs.replace(
            line,
            size=0.001 * (i - 1.3),
            rising=closed([0.002 / (k + 1 + i) for k in range(10)]),
            falling=closed([-0.003 / (k + 2 + i) for k in range(10)]),
        )
        for i, line in enumerate(file.lines)
    ]
    return operator_text(msgspec.structs.replace(file, lines=lines), [])


def write_scans(folder: Path) -> list[Path]:
    """All scans below a folder."""
    paths = []
    for name, variant in SCANS.items():
        paths.append(write_variant(folder / name, variant))
        (folder / name / "response.csv").write_text(RESPONSE, "ascii")
        (folder / name / "x_operator.toml").write_text(operator(), "ascii")
    return paths


def build_elsewhere(
    folder: Path, scans: list[Path], environment: Mapping[str, str] | None = None, options: tuple[str, ...] = ()
) -> set[str]:
    """Build in a process of its own, started in a folder; return the vector units that numpy may use there."""
    result = subprocess.run(
        [sys.executable, *options, "-c", DRIVER, *map(str, scans)],
        cwd=folder,
        env={**os.environ, **(environment or {})},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return set(result.stdout.split())


def built_files(folder: Path) -> dict[str, bytes]:
    """Every emitted file below a folder, by scan and name."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.glob("*/out/*"))}


def differing_lines(one: Mapping[str, bytes], other: Mapping[str, bytes]) -> list[str]:
    """What differs, short enough to be read."""
    found = [f"only in one: {name}" for name in set(one) ^ set(other)]
    for name in sorted(set(one) & set(other)):
        lines = zip(one[name].split(b"\n"), other[name].split(b"\n"), strict=False)
        found += [f"{name}:{i}: {a[:100]!r} or {b[:100]!r}" for i, (a, b) in enumerate(lines, start=1) if a != b]
        if len(one[name]) != len(other[name]):
            found.append(f"{name}: {len(one[name])} or {len(other[name])} bytes")
    return found[:40]


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("reference")
    build_elsewhere(folder, write_scans(folder))
    return built_files(folder)


def dispatched_features() -> list[str]:
    """What numpy chooses kernels by on this processor, under the names that this numpy gives them."""
    kernels = (getattr(np, "_core", None) or np.core)._multiarray_umath
    return [feature for feature in kernels.__cpu_dispatch__ if kernels.__cpu_features__[feature]]


ENVIRONMENTS: dict[str, dict[str, str]] = {
    "second run": {},
    "hash seed 0": {"PYTHONHASHSEED": "0"},
    "hash seed 4294967295": {"PYTHONHASHSEED": "4294967295"},
    "time zone": {"TZ": "Pacific/Kiritimati", "SOURCE_DATE_EPOCH": "86400"},
    "locale C": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "locale C.UTF-8": {"LC_ALL": "C.UTF-8", "LANG": "de_DE.UTF-8"},
    "OpenBLAS kernels": {"OPENBLAS_CORETYPE": "Prescott"},
    "OpenBLAS threads": {"OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"},
    # Names of features as glibc from 2.33 on and before it spells them; unknown ones are ignored.
    "C library kernels": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-AVX2_Usable,-FMA_Usable,-ERMS"},
}

# What one of these would change, it changes together with the others: in pairs whose effects are on different things.
TOGETHER: dict[str, tuple[str, ...]] = {
    "hash seed, time zone, locale C": ("hash seed 0", "time zone", "locale C"),
    "another hash seed, locale C.UTF-8, threads": ("hash seed 4294967295", "locale C.UTF-8", "OpenBLAS threads"),
}


@pytest.mark.rest
@pytest.mark.parametrize("name", TOGETHER)
def test_bytes_do_not_depend_on_environments_together(reference: dict[str, bytes], tmp_path: Path, name: str) -> None:
    environment = {key: value for one in TOGETHER[name] for key, value in ENVIRONMENTS[one].items()}
    build_elsewhere(tmp_path, write_scans(tmp_path), environment)
    assert differing_lines(reference, built_files(tmp_path)) == []


@pytest.mark.long  # which of them it is, where the tests above and below find a difference
@pytest.mark.timeout(86_400)
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_bytes_do_not_depend_on_the_environment(reference: dict[str, bytes], tmp_path: Path, name: str) -> None:
    build_elsewhere(tmp_path, write_scans(tmp_path), ENVIRONMENTS[name])
    assert differing_lines(reference, built_files(tmp_path)) == []


@pytest.mark.rest
def test_bytes_do_not_depend_on_vector_units(reference: dict[str, bytes], tmp_path: Path) -> None:
    """numpy without any kernel beyond its baseline, nor a C library or OpenBLAS with fused multiplication."""
    disabled = dispatched_features()
    environment = ENVIRONMENTS["C library kernels"] | ENVIRONMENTS["OpenBLAS kernels"]
    left = build_elsewhere(
        tmp_path, write_scans(tmp_path), {**environment, "NPY_DISABLE_CPU_FEATURES": " ".join(disabled)}
    )
    assert not left & set(disabled), "numpy did not give up the features; the comparison would mean nothing"
    assert differing_lines(reference, built_files(tmp_path)) == []


@pytest.mark.rest
@pytest.mark.parametrize("option", long(["-OO"], ["-O", "-OO", "-I"]))
def test_bytes_do_not_depend_on_the_interpreter_s_options(
    reference: dict[str, bytes], tmp_path: Path, option: str
) -> None:
    build_elsewhere(tmp_path, write_scans(tmp_path), options=(option,))
    assert differing_lines(reference, built_files(tmp_path)) == []


@pytest.mark.rest
@pytest.mark.parametrize("path", common(["relative"], ["absolute", "relative"]))
def test_bytes_do_not_depend_on_the_directory(reference: dict[str, bytes], tmp_path: Path, path: str) -> None:
    folder = tmp_path / "a scan of Zürich – 試料 \u00b5m"
    folder.mkdir()
    scans = write_scans(folder)
    build_elsewhere(folder, [scan.relative_to(folder) for scan in scans] if path == "relative" else scans)
    assert differing_lines(reference, built_files(folder)) == []


def test_a_different_scan_is_noticed(reference: dict[str, bytes], tmp_path: Path) -> None:
    """Negative control: a nanovolt of offset changes at least the manifest."""
    scan = write_variant(tmp_path / "example", Variant({"x.offset_v": 50.000000001}))
    build_elsewhere(tmp_path, [scan])
    example = {name: content for name, content in reference.items() if name.startswith("example/")}
    assert any("manifest.json" in line for line in differing_lines(example, built_files(tmp_path)))


def test_nothing_emitted_tells_where_or_when(reference: dict[str, bytes]) -> None:
    """No path, no host, no user, no date, and no name of a file that is not part of the build."""
    for name, content in reference.items():
        text = content.decode("ascii")
        words = set(re.findall(r"[\w.-]+", text))
        assert not words & {socket.gethostname(), "tmp", "home", "root", "Users"}, name
        assert str(REPOSITORY) not in text, name
        assert not re.search(r"(?<![\w.])(19|20)\d\d-\d\d-\d\d|\d\d:\d\d:\d\d", text), name
        assert not re.search(r"(?<![\w*/])/\w+/\w+", text), name
        assert EXAMPLE.name not in text, name
