"""Images that were already taken, put straight, as `tablegen correct` does it; given as files or as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected
from tablegen.correction.job import Choice, Images, OldAxis, OldScan, by_fit, by_scan_file, by_scanner, read_scan
from tablegen.correction.output_files import files_of
from tablegen.correction.straight import StraightScan
from tablegen.emit.write import write_files
from tablegen.images.files import ScanImage
from tablegen.numerics.arrays import Floats

Image = str | Path | Floats
_AXIS = ("size_v", "size_nm", "offset_v", "turn", "window")
_CHOICE = ("channel", "retrace_channel", "retrace_mirrored", "frame")
_REST = ("rate_hz", "lines", "delay_pixels")
_BACK = "slow_back"


def correct(
    trace: Image,
    retrace: Image | None = None,
    *,
    scanner: str | Path | None = None,
    scan: str | Path | None = None,
    lattice_nm: float | None = None,
    pitch_nm: float | None = None,
    fit: bool = False,
    **how: Any,
) -> "Corrected":
    """Put an image straight: by a scanner file, by the scan file that it was taken with, or by a fit to a lattice.

    Images are files that ``tablegen channels`` reads, or arrays of heights, (rows, columns), rows in the order of time,
    the left end of the line at the left in both directions. With ``scanner`` it has to be known how the image was
    taken; with ``fit``, or ``lattice_nm`` or ``pitch_nm``, which give the size, the sample has to be periodic.

    ``how`` the image was taken: ``size_v`` or ``size_nm``, ``offset_v``, ``turn`` and ``window`` of the fast axis, the
    same with ``slow_`` of the slow one, ``rate_hz``, ``lines`` in a period of the slow axis, ``slow_back``,
    ``delay_pixels``; and of files ``channel``, ``retrace_channel``, ``retrace_mirrored``, ``frame``. Volts are at the
    piezo, sizes peak to peak. Raises ``Rejected`` and ``Unphysical``.
    """
    if unknown := [name for name in how if name not in _NAMES]:
        raise TypeError(f"{unknown[0]} is none of {', '.join(_NAMES)}")
    fitted = fit or lattice_nm is not None or pitch_nm is not None
    if fitted == (scanner is not None or scan is not None):
        raise TypeError("give scanner, the scanner file, or scan, or fit=True for a periodic sample; one of the ways")
    if isinstance(trace, str | Path):
        if isinstance(retrace, np.ndarray):
            raise TypeError("give both images as files, or both as arrays")
        images = read_scan(Path(trace), None if retrace is None else Path(retrace), choice_of(how))
    else:
        images = _images(trace, retrace, bool(how.get("retrace_mirrored", False)))
    given = None if scanner is None else Path(scanner)
    return Corrected(straight(images, given, None if scan is None else Path(scan), taken_of(how), pitch_nm, lattice_nm))


def straight(
    images: Images,
    scanner: Path | None,
    scan: Path | None,
    taken: OldScan,
    pitch_nm: float | None,
    lattice_nm: float | None,
) -> StraightScan:
    """By the scan file where there is one, by the scanner file, or by a fit where there is neither."""
    if scan is not None:
        return by_scan_file(images, scan, scanner, taken)
    if scanner is not None:
        return by_scanner(images, scanner, taken)
    return by_fit(images, taken, pitch_nm, lattice_nm)[0]


def choice_of(how: Mapping[str, Any]) -> Choice:
    """Which channels of files; what is not given is as the files say."""
    return Choice(**{name: how[name] for name in _CHOICE if name in how})


def taken_of(how: Mapping[str, Any]) -> OldScan:
    """How an image was taken, of names as ``correct`` and the command have them."""
    x, y = ({key: how[f"{prefix}{key}"] for key in _AXIS if f"{prefix}{key}" in how} for prefix in ("", "slow_"))
    rest = {key: how[key] for key in _REST if key in how}
    return OldScan(x=OldAxis(**x), y=OldAxis(**y), back=bool(how.get(_BACK, False)), **rest)


_NAMES = (*_AXIS, *(f"slow_{name}" for name in _AXIS), *_REST, _BACK, *_CHOICE)


@dataclass(frozen=True, eq=False)
class Corrected:
    """An image put straight: ``trace`` and ``retrace``, by how much it was moved, how far both agree now."""

    scan: StraightScan

    @property
    def trace(self) -> Floats:
        """Heights of the trace, or of whatever there is, (rows, columns); NaN where nothing was imaged."""
        return self.scan.pictures[self.scan.judged[0]].heights

    @property
    def retrace(self) -> Floats | None:
        """Those of the retrace, on the same places; None without one."""
        return self.scan.pictures[self.scan.judged[1]].heights if len(self.scan.judged) > 1 else None

    @property
    def size_nm(self) -> tuple[float, float] | None:
        """Width and height of the picture; None where they are not known."""
        return self.scan.size_nm

    @property
    def moved_pixels(self) -> tuple[float, float]:
        """The largest displacement along x and y, the mean one aside."""
        return self.scan.moved_pixels

    @property
    def difference(self) -> tuple[float, float] | None:
        """Of trace and retrace, rms over that of both, before and after; None without a retrace."""
        return None if self.scan.agreement is None else self.scan.agreement.difference

    @property
    def record(self) -> dict[str, Any]:
        """What was done, as plain data: every file that is written has it."""
        return self.scan.record

    def write(self, path: str | Path) -> list[str]:
        """Write .gwy, .tif, .npy or .png, and what goes beside it; the names that changed. Raises ``CannotWrite``."""
        path = Path(path)
        if path.suffix.lower() not in (".gwy", ".tif", ".tiff", ".npy", ".png"):
            raise Rejected([Problem(str(path), 0, "", "the name has to end in .gwy, .tif, .npy or .png")])
        return write_files(path.parent, files_of(self.scan, path.stem, path.suffix.lower()))

    def __repr__(self) -> str:
        x, y = self.moved_pixels
        size = "" if self.size_nm is None else f", {self.size_nm[0]:.4g} x {self.size_nm[1]:.4g} nm"
        found = self.difference
        apart = "" if found is None else f"\n  trace and retrace differ by {found[0]:.3g} before, {found[1]:.3g} after"
        return f"<tablegen corrected image{size}: moved by up to {x:.3g} pixels along x, {y:.3g} along y{apart}>"


def _images(trace: Floats, retrace: Image | None, mirrored: bool) -> Images:
    """Arrays as the images of a file."""
    if isinstance(retrace, str | Path):
        raise TypeError("give both images as files, or both as arrays")
    found = []
    for direction, heights in (("trace", trace), ("retrace", retrace)):
        if heights is None:
            continue
        values = np.ascontiguousarray(heights, dtype=np.float64)
        if values.ndim != 2 or min(values.shape) < 2:
            why = f"has the shape {values.shape}; it takes (rows, columns)"
            raise Rejected([Problem(direction, 0, "", why)])
        source = Source(direction, sha256(values.tobytes()).hexdigest()[:16])
        found.append(ScanImage(direction, source, values, direction))
    if len({one.heights.shape for one in found}) > 1:
        raise Rejected([Problem("retrace", 0, "", "has another shape than the trace")])
    return Images(tuple(found), (True, False)[: len(found)], tuple(range(len(found))), (), mirrored)
