"""Arrays of NumPy of one period: for notebooks, and for Python that drives a DAQ card."""

import zipfile
from io import BytesIO

import numpy as np
import numpy.typing as npt

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.waveforms import waveforms


class Npz(Format):
    """The format npz: ``NAME.npz``."""

    name = "npz"
    purpose = "NumPy arrays of a line of x and a frame of y: x_time_s, x_volts, x_codes, x_start .. y_inside"
    file_names = "NAME.npz"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render one archive."""
        arrays: dict[str, npt.NDArray[np.generic]] = {}
        for waveform in waveforms(content):
            arrays[f"{waveform.axis}_time_s"] = waveform.time_s.astype("<f8")
            arrays[f"{waveform.axis}_volts"] = waveform.volts.astype("<f8")
            arrays[f"{waveform.axis}_codes"] = waveform.codes.astype("<i4")
            arrays |= {f"{waveform.axis}_{name}": marker for name, marker in waveform.markers.items()}
        return {f"{content.name}.npz": _archive(arrays)}


FORMAT = Npz()


def _archive(arrays: dict[str, npt.NDArray[np.generic]]) -> bytes:
    """Write what ``numpy.savez`` does, with the same bytes on every machine; not compressed, as zlibs differ."""
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.create_system = 3  # Unix, wherever it is written
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, _array(array))
    return buffer.getvalue()


def _array(array: npt.NDArray[np.generic]) -> bytes:
    """Write an array in the format .npy, version 1.0, whose header ends at a multiple of 64 bytes."""
    header = f"{{'descr': {array.dtype.str!r}, 'fortran_order': False, 'shape': {array.shape}, }}"
    padding = -(10 + len(header) + 1) % 64
    text = f"{header}{' ' * padding}\n".encode("ascii")
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + array.tobytes()
