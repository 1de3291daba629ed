"""Scan angles of image files: at 0 degrees the fast axis is x, at 90 degrees it is the other piezo, y."""

from collections.abc import Iterable, Sequence
from typing import Literal

from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.warnings import Remark, spoils
from tablegen.images.files import ScanImage

_TOLERANCE_DEG = 1.0  # between a line and an axis: the other piezo then has less than a thousandth of the line
_ZERO_DEG = 0.05  # what files round 0 to
_ANGLES = {"x": 0, "y": 90}


def fast_axis(angle_deg: float) -> Literal["x", "y"] | None:
    """Return the axis along which lines at this angle run; None where a line moves both piezos."""
    off = angle_deg % 180.0
    if min(off, 180.0 - off) <= _TOLERANCE_DEG:
        return "x"
    return "y" if abs(off - 90.0) <= _TOLERANCE_DEG else None


def is_turned(image: ScanImage) -> bool:
    """Return True where the file states an angle other than 0."""
    return image.angle_deg is not None and min(image.angle_deg % 360.0, -image.angle_deg % 360.0) > _ZERO_DEG


def angle_text(angle_deg: float) -> str:
    """Return the angle and what it means for the piezos, without the name of the file."""
    fast = fast_axis(angle_deg)
    what = "a line moved both piezos" if fast is None else f"the fast axis was {fast}"
    return f"scan angle {angle_deg:.4g} degrees: {what}"


def require_fast_axis(images: Sequence[ScanImage], axis: str) -> None:
    """Check that lines at the angle of each image show the branches of ``axis``.

    An angle of 0 passes for y too: instruments state it where the drives were exchanged by hand.

    Raises
    ------
    Rejected
        If an image has another fast axis, or its lines move both piezos.
    """
    problems = [Problem(one.file, 0, "", text) for one in images if is_turned(one) and (text := _conflict(one, axis))]
    if problems:
        raise Rejected(problems)


def angle_remarks(images: Iterable[object], axis: str) -> list[Remark]:
    """Return a remark on each image whose angle is not 0, or whose fast axis was not ``axis``; tables are skipped.

    Parameters
    ----------
    images
        Measurements of a fit.
    axis
        The axis that the fit takes for the fast one.
    """
    remarks: dict[Remark, None] = {}
    for image in images:
        if not isinstance(image, ScanImage) or image.angle_deg is None:
            continue
        name = image.source.name
        if text := _conflict(image, axis):
            remarks[spoils(f"{name}: {text}", code="scan-angle")] = None
        elif is_turned(image):
            why = "the file does not say which end of the line had the higher voltage"
            remarks[Remark(f"{name}: {angle_text(image.angle_deg)}, as --axis {axis}; {why}", code="scan-angle")] = None
    return list(remarks)


def running_scan_remarks(images: Iterable[ScanImage]) -> list[Remark]:
    """Return a remark on each image of a running scan, whose fast axis is x, that was scanned at another angle."""
    remarks: dict[Remark, None] = {}
    for image in images:
        if is_turned(image) and image.angle_deg is not None:
            text = f"{image.source.name}: {angle_text(image.angle_deg)}; the lines of a scan file are along x"
            remarks[spoils(f"{text}. Take the images at 0 degrees", code="scan-angle")] = None
    return list(remarks)


def _conflict(image: ScanImage, axis: str) -> str:
    """Describe the conflict of an image's angle with this axis, and what to try; empty without one."""
    if image.angle_deg is None:
        return ""
    fast, text = fast_axis(image.angle_deg), angle_text(image.angle_deg)
    if fast is None:
        return f"{text}; scan at {_ANGLES[axis]} degrees for --axis {axis}"
    if fast != axis:
        return f"{text}, not {axis}; give --axis {fast}, or scan at {_ANGLES[axis]} degrees"
    if abs(image.angle_deg % 360.0 - 180.0) <= _TOLERANCE_DEG:
        return f"{text}, from its high end to its low one, which exchanges trace and retrace; scan at 0 degrees"
    return ""
