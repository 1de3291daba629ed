"""The archive as NumPy and zipfile read it, against what the manifest plays."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from building import NAME
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted
from manifest_integers import markers, played_codes, seconds
from sets import quick


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("npz"), request.param, "npz")


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_arrays_are_a_period_of_the_manifest(built: Formatted, axis: str) -> None:
    content = built.manifest["axes"][axis]
    codes, output = played_codes(content), content["output"]
    with np.load(built.folder / f"{NAME}.npz", allow_pickle=False) as arrays:
        assert arrays[f"{axis}_codes"].tolist() == codes
        assert arrays[f"{axis}_time_s"].tolist() == seconds(built.manifest, len(codes))
        volts = [output["v_zero"] + output["v_per_code"] * code for code in codes]
        assert arrays[f"{axis}_volts"].tolist() == volts
        wanted = markers(built.manifest, axis)
        for name in wanted[0]:
            assert arrays[f"{axis}_{name}"].dtype == np.bool_
            assert arrays[f"{axis}_{name}"].tolist() == [tick[name] for tick in wanted], name
        values = ("time_s", "volts", "codes", *wanted[0])
        assert set(arrays.files) == {f"{each}_{value}" for each in "xy" for value in values}


def test_each_array_is_what_numpy_writes(built: Formatted) -> None:
    """But for the room that newer versions of NumPy leave in the header."""
    with zipfile.ZipFile(built.folder / f"{NAME}.npz") as archive:
        assert archive.testzip() is None
        for entry in archive.infolist():
            assert (entry.date_time, entry.compress_type) == ((1980, 1, 1, 0, 0, 0), zipfile.ZIP_STORED)
            content = archive.read(entry)
            array = np.load(io.BytesIO(content), allow_pickle=False)
            assert array.dtype.str in {"<f8", "<i4", "|b1"}
            assert content.endswith(array.tobytes())
            assert (len(content) - array.nbytes) % 64 == 0


def test_a_changed_value_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "npz"), "npz", [f"{NAME}.npz"])
