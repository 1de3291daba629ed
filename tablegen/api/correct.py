"""Correct existing images, as `tablegen correct` does; given as files or as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tablegen.api.image_input import ImageSource, check_names, read_trace_and_perhaps_retrace
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.input_errors import Problem, Rejected
from tablegen.charts.picture_file import PlottedCharts
from tablegen.correction.by_affine_map import by_affine_map
from tablegen.correction.by_fit import by_fit
from tablegen.correction.by_scanner import by_scan_file, by_scanner
from tablegen.correction.correction_text import correct_text
from tablegen.correction.old_scan import OldAxis, OldScan
from tablegen.correction.output_files import files_of
from tablegen.correction.scan_images import Choice, Images, read_scan
from tablegen.correction.straight import StraightScan
from tablegen.emit.write import write_files
from tablegen.numerics.arrays import Floats

_AXIS = ("size_v", "size_nm", "offset_v", "turn", "window")
_CHOICE = ("channel", "retrace_channel", "retrace_mirrored", "frame", "frames")
_REST = ("rate_hz", "lines", "delay_pixels")
_BACK = "slow_back"


@one_blas_thread
def correct(
    trace: ImageSource,
    retrace: ImageSource | None = None,
    *,
    scanner: str | Path | None = None,
    scan: str | Path | None = None,
    lattice_nm: float | None = None,
    lattice: Literal["hexagonal", "square"] | None = None,
    pitch_nm: float | None = None,
    fit: bool = False,
    affine: bool = False,
    **how: Any,
) -> "Corrected":
    """Correct an image: by a scanner file, by the scan file that it was taken with, or by a fit to a lattice.

    Parameters
    ----------
    trace, retrace : path, Image or array
        Files, results of ``read_image``, or heights of shape (rows, columns), rows in order of time, the left end of
        the line at the left in both directions. A file may have both, and all its channels are corrected.
    scanner, scan : path, optional
        Scanner file, with ``how`` the image was taken; or the scan file that it was taken with.
    lattice_nm, pitch_nm, fit : optional
        Constant in nm of a periodic sample, which is fitted; ``fit=True`` where it is unknown.
    lattice : {"hexagonal", "square"}, optional
        Kind of the lattice of ``lattice_nm``; hexagonal by default, unless the frame is straight as a square one.
    affine : bool
        Correct height and shear alone, and with ``lattice_nm`` the width, by the cell of a lattice of kind ``lattice``.
    **how : optional
        ``size_v`` in V peak to peak at the piezo or ``size_nm``, ``offset_v``, ``turn``, ``window`` of the fast axis,
        the same with ``slow_`` of the slow one; ``rate_hz``, ``lines``, ``slow_back``, ``delay_pixels``; of files
        ``channel``, ``retrace_channel``, ``retrace_mirrored``, ``frame``, or ``frames``: the first one and the one
        after the last, whose mean is corrected.

    Returns
    -------
    Corrected
        ``trace`` and ``retrace`` corrected; ``write`` makes a file.

    Raises
    ------
    Rejected
        A file is wrong, or an image has the wrong shape.
    Unphysical
        The sample has no period, or no scanner takes such an image.

    Examples
    --------
    >>> straight = tablegen.correct("trace.npy", "retrace.npy", lattice_nm=17.7)
    >>> before, after = straight.difference  # of trace and retrace, rms
    >>> after < 0.5 * before
    True
    """
    check_names(how, _NAMES)
    fitted = fit or affine or lattice_nm is not None or pitch_nm is not None
    if affine and (pitch_nm is not None or lattice is None):
        raise TypeError("affine needs lattice, the kind of the lattice; lattice_nm for the size too; and no pitch_nm")
    if fitted == (scanner is not None or scan is not None):
        raise TypeError("give scanner, the scanner file, or scan, or fit=True for a periodic sample; one of the ways")
    if isinstance(trace, str | Path):
        if not (retrace is None or isinstance(retrace, str | Path)):
            raise TypeError("give both images as files, or both as arrays")
        images = read_scan(Path(trace), None if retrace is None else Path(retrace), choice_of(how))
    else:
        if isinstance(retrace, str | Path):
            raise TypeError("give both images as files, or both as arrays")
        both = read_trace_and_perhaps_retrace(trace, retrace, how)
        mirrored = bool(how.get("retrace_mirrored", False))
        images = Images(tuple(both), (True, False)[: len(both)], tuple(range(len(both))), (), mirrored)
    files = [None if path is None else Path(path) for path in (scanner, scan)]
    if affine and lattice is not None:
        return Corrected(by_affine_map(images, lattice_nm, lattice), images)
    return Corrected(straight(images, files[0], files[1], old_scan_of(how), pitch_nm, lattice_nm, lattice), images)


def straight(
    images: Images,
    scanner: Path | None,
    scan: Path | None,
    old_scan: OldScan,
    pitch_nm: float | None,
    lattice_nm: float | None,
    kind: str | None = None,
) -> StraightScan:
    """Correct images by the scan file, else by the scanner file, else by a fit.

    Raises
    ------
    Rejected
        If a file is wrong.
    Unphysical
        If the sample has no period, or no scanner takes such an image.
    """
    if scan is not None:
        return by_scan_file(images, scan, scanner, old_scan)
    if scanner is not None:
        return by_scanner(images, scanner, old_scan)
    return by_fit(images, old_scan, pitch_nm, lattice_nm, kind)[0]


def choice_of(how: Mapping[str, Any]) -> Choice:
    """Return the choice of channels by keywords of ``correct``; the file decides the others."""
    return Choice(**{name: how[name] for name in _CHOICE if name in how})


def old_scan_of(how: Mapping[str, Any]) -> OldScan:
    """Return how an image was taken, by keywords of ``correct`` and of the command."""
    x, y = ({key: how[f"{prefix}{key}"] for key in _AXIS if f"{prefix}{key}" in how} for prefix in ("", "slow_"))
    rest = {key: how[key] for key in _REST if key in how}
    return OldScan(x=OldAxis(**x), y=OldAxis(**y), back=bool(how.get(_BACK, False)), **rest)


_NAMES = (*_AXIS, *(f"slow_{name}" for name in _AXIS), *_REST, _BACK, *_CHOICE)


@dataclass(frozen=True, eq=False, repr=False)
class Corrected(Result):
    """A corrected image: ``trace`` and ``retrace``, the displacement of its pixels, the distance of both that remains.

    ``scan`` has all channels that were corrected, ``images`` the originals.
    """

    scan: StraightScan
    images: Images

    @property
    def trace(self) -> Floats:
        """Heights of the trace, or of the only image, (rows, columns); NaN where nothing was imaged.

        Returns
        -------
        Floats
            In the unit of the file, shape (rows, columns).
        """
        return self.scan.pictures[self.scan.reference[0]].heights

    @property
    def retrace(self) -> Floats | None:
        """Heights of the retrace at the same positions, (rows, columns); None without one.

        Returns
        -------
        Floats or None
            In the unit of the file, shape (rows, columns).
        """
        return self.scan.pictures[self.scan.reference[1]].heights if len(self.scan.reference) > 1 else None

    @property
    def size_nm(self) -> tuple[float, float] | None:
        """Width and height of the picture; None where they are unknown."""
        return self.scan.size_nm

    @property
    def moved_pixels(self) -> tuple[float, float]:
        """The largest displacement of a pixel along x and y, less the mean one."""
        return self.scan.moved_pixels

    @property
    def difference(self) -> tuple[float, float] | None:
        """Difference of trace and retrace, rms over that of both, before and after; None without a retrace."""
        return None if self.scan.agreement is None else self.scan.agreement.difference

    @property
    def apart_pixels(self) -> tuple[float, float] | None:
        """Largest distance between trace and retrace of one feature, before and after; None where it is unknown."""
        return None if self.scan.agreement is None else self.scan.agreement.worst

    @property
    def record(self) -> dict[str, Any]:
        """The correction as plain data: every file that is written has it."""
        return self.scan.record

    def write(self, path: str | Path) -> list[str]:
        """Write .gwy, .tif, .npy or .png, and the files beside it, and return the names that changed.

        Raises
        ------
        Rejected
            If the name has another ending.
        CannotWrite
            If a file cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() not in (".gwy", ".tif", ".tiff", ".npy", ".png"):
            raise Rejected([Problem(str(path), 0, "", "the name has to end in .gwy, .tif, .npy or .png")])
        return write_files(path.parent, files_of(self.scan, path.stem, path.suffix.lower()))

    def summary(self) -> str:
        """Return what ``tablegen correct`` prints."""
        return "\n".join(correct_text(self.scan, self.images))

    def charts(self) -> PlottedCharts:
        """Return the charts that ``tablegen correct --plot`` draws."""
        from tablegen.html_report.corrected import correction_charts

        return correction_charts(self.scan, self.images.first.file)

    def _lines(self) -> Sequence[str]:
        x, y = self.moved_pixels
        size = "" if self.size_nm is None else f", {self.size_nm[0]:.4g} x {self.size_nm[1]:.4g} nm"
        difference = self.difference
        third = "there is no retrace, by which the result could be checked"
        if difference is not None:
            third = f"trace and retrace differ by {difference[0]:.3g} before, {difference[1]:.3g} after"
        return f"corrected image{size}", f"moved by up to {x:.3g} pixels along x, {y:.3g} along y", third
