"""Measurements in numpy's own files: the numbers of the CSV file, every fault at its row, and nothing unpickled."""

import io
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, FREQUENCY, GAIN, PHASE, TIME
from tablegen.calibration.tables.table import read_table

TIMES = np.arange(50) * 1e-3
MOVED = np.linspace(-3.0, 4.0, 50)


def faults(path: Path, *needed: object) -> list[str]:
    with pytest.raises(Rejected) as caught:
        read_table(path, [TIME, DISPLACEMENT] if not needed else list(needed))  # type: ignore[arg-type]
    return [str(one).removeprefix(f"{path}") for one in caught.value.problems]


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", "<i4", ">u2"])
def test_archives_have_the_numbers_that_were_saved(save: object, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "trace.npz"
    moved = np.arange(50).astype(kind)
    save(path, time_ms=TIMES * 1e3, displacement_um=moved, comment=np.array(["text"] * 3))  # type: ignore[operator]
    found = read_table(path, [TIME, DISPLACEMENT], [DRIVE])
    assert np.array_equal(found[TIME], TIMES * 1e3 * 1e-3)
    assert np.array_equal(found[DISPLACEMENT], np.arange(50) * 1e3)
    assert np.array_equal(found.lines, np.arange(1, 51))
    assert DRIVE not in found


def test_fields_of_a_structured_array_are_columns(tmp_path: Path) -> None:
    table = np.zeros(50, dtype=[("time_s", "<f8"), ("index", "<i2"), ("displacement_nm", ">f4")])
    table["time_s"], table["displacement_nm"] = TIMES, MOVED
    np.save(tmp_path / "trace.npy", table)
    found = read_table(tmp_path / "trace.npy", [TIME, DISPLACEMENT])
    assert np.array_equal(found[TIME], TIMES)
    assert np.array_equal(found[DISPLACEMENT], MOVED.astype(np.float32).astype(np.float64))


def test_conversions_are_those_of_csv(tmp_path: Path) -> None:
    text = "frequency_khz,gain_db,phase_rad\n1,0,0\n2,-6,-0.5\n30,12.5,-3\n"
    (tmp_path / "response.csv").write_text(text)
    np.savez(tmp_path / "response.npz", frequency_khz=[1, 2, 30], gain_db=[0, -6, 12.5], phase_rad=[0, -0.5, -3])
    csv, npz = (read_table(tmp_path / f"response.{end}", [FREQUENCY, GAIN, PHASE]) for end in ("csv", "npz"))
    assert {name: column.tolist() for name, column in csv.columns.items()} == {
        name: column.tolist() for name, column in npz.columns.items()
    }


def test_faults_name_their_row_and_column(tmp_path: Path) -> None:
    path = tmp_path / "trace.npz"
    moved = MOVED.copy()
    moved[[4, 17]] = np.nan, 2e12
    np.savez(path, time_s=TIMES, displacement_nm=moved)
    assert faults(path) == [
        ":5: displacement_nm: nan is not finite",
        ":18: displacement_nm: 2000000000000.0 is not below 1e+12 (displacement_nm)",
    ]
    np.savez(path, time_s=TIMES, displacement_nm=np.full(50, np.inf))
    assert len(faults(path)) == 21
    assert faults(path)[-1] == ":20: more faults follow; stopped"


@pytest.mark.parametrize(
    ("columns", "fault"),
    [
        ({"time_s": TIMES}, ": displacement_nm: missing (or displacement_pm, displacement_um, displacement_mm, "
                            "displacement_m); the header has time_s, or choose it: --columns displacement=NAME"),
        ({}, ": time_s: missing (or time_ms, time_us, time_ns); the header has , "
             "or choose it: --columns time=NAME"),
        ({"time_s": TIMES, "displacement_nm": MOVED[1:]},
         ": its columns have different numbers of rows: time_s 50, displacement_nm 49"),
        ({"time_s": TIMES[:0], "displacement_nm": MOVED[:0]}, ": has no numbers"),
        ({"time_s": TIMES, "displacement_nm": MOVED.reshape(5, 10)},
         ": displacement_nm: has shape 5 x 10; a column has one dimension"),
        ({"time_s": TIMES, "displacement_nm": np.array(1.0)},
         ": displacement_nm: has shape one number; a column has one dimension"),
        ({"time_s": TIMES, "displacement_nm": MOVED * 1j},
         ": displacement_nm: has elements of type complex128; real numbers are needed"),
        ({"time_s": TIMES, "time_ms": TIMES, "displacement_nm": MOVED},
         ": time_ms: the header has both time_s and time_ms; keep one of them, "
             "or choose it: --columns time=NAME"),
    ],
)  # fmt: skip
def test_columns_that_are_none(columns: dict[str, np.ndarray], fault: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "trace.npz", **columns)  # type: ignore[arg-type]
    assert faults(tmp_path / "trace.npz")[0] == fault


def test_a_plain_matrix_says_how_to_save_columns(tmp_path: Path) -> None:
    np.save(tmp_path / "trace.npy", np.stack([TIMES, MOVED], axis=1))
    (fault,) = faults(tmp_path / "trace.npy")
    assert fault.endswith("its columns have no names; write them by np.savez(FILE, time_s=..., displacement_nm=...)")


class Trap:
    """Ends the test if anything unpickles it."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return pytest.exit, ("unpickled",)


def test_objects_are_not_unpickled(tmp_path: Path) -> None:
    np.savez(tmp_path / "trace.npz", allow_pickle=True, time_s=TIMES, displacement_nm=np.array([Trap()]))
    (fault,) = faults(tmp_path / "trace.npz")
    assert "no array of numbers" in fault


def stored(header: str, numbers: bytes = b"\0" * 80) -> bytes:
    text = header.encode("latin-1")
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text + numbers


@pytest.mark.parametrize(
    "shape", ["(10000000000,)", "(11,)", "(9,)", "(-1,)", "(0,)", "(1 << 62, 1 << 62)", "()", "(10,) + (", "'x'"]
)
def test_a_header_that_promises_something_else(shape: str, tmp_path: Path) -> None:
    """Refused before any memory is taken."""
    header = f"{{'descr': [('time_s', '<f8')], 'fortran_order': False, 'shape': {shape}}}\n"
    (tmp_path / "trace.npy").write_bytes(stored(header))
    tracemalloc.start()
    (fault,) = faults(tmp_path / "trace.npy", TIME)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert fault.startswith(": cannot be read: ")
    assert peak < 20 << 20


@pytest.mark.common
def test_an_archive_that_unpacks_into_more_than_a_measurement_has(tmp_path: Path) -> None:
    path = tmp_path / "trace.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("time_s.npy", "w") as member:
        for _ in range(520):
            member.write(bytes(1 << 20))
    assert faults(path) == [": cannot be read: its arrays are above 512 MiB"]


@pytest.mark.common
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), archive=st.booleans())
def test_damaged_files_are_read_or_refused(data: st.DataObject, archive: bool, tmp_path: Path) -> None:
    """Whatever byte is changed, cut or added."""
    stream = io.BytesIO()
    if archive:
        np.savez_compressed(stream, time_s=TIMES, displacement_nm=MOVED)
    else:
        np.save(stream, np.zeros(3, dtype=[("time_s", "<f8"), ("displacement_nm", "<f8")]))
    content = bytearray(stream.getvalue())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / ("trace.npz" if archive else "trace.npy")
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))] if data.draw(st.booleans()) else content)
    try:
        found = read_table(path, [TIME, DISPLACEMENT])
    except Rejected as rejected:
        refused = [str(problem) for problem in rejected.problems]
        assert refused == [one for one in refused if one.startswith(str(path))] != []
    else:
        assert np.all(np.isfinite(found[TIME]))
