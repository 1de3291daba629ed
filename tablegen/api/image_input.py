"""Read images that scripts give: the path of a file, an array of heights, or a result of ``read_image``."""

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from tablegen.api.read_image import Image
from tablegen.base.data_files import Source
from tablegen.base.input_errors import Problem, Rejected
from tablegen.calibration.laws.image_sizes import Acquisition, KnownSample, SampleImage
from tablegen.fitting.estimate import Estimate
from tablegen.images.files import ScanImage, channels_of, read_image, read_pair
from tablegen.images.formats.channel import Direction, choose, partner
from tablegen.images.line_length import Cell, Grating
from tablegen.numerics.arrays import Floats

ImageSource: TypeAlias = str | Path | Floats | Image
_SAMPLE = ("lattice_nm", "lattice", "cell", "pitch_nm", "angle_deg")
_ACQUISITION = ("turn", "window", "retrace_mirrored", "delay_pixels", "aspect")
_CHANNEL = ("channel", "retrace_channel", "frame")
IMAGE_OPTIONS = (*_SAMPLE, *_ACQUISITION, *_CHANNEL)


def check_names(how: dict[str, Any], names: Sequence[str]) -> None:
    """Check the names of keywords.

    Raises
    ------
    TypeError
        If one is none of ``names``.
    """
    if unknown := [name for name in how if name not in names]:
        raise TypeError(f"{unknown[0]} is none of {', '.join(names)}")


def read_trace_and_retrace(
    trace: ImageSource, retrace: ImageSource | None, how: dict[str, Any]
) -> tuple[ScanImage, ScanImage]:
    """Read trace and retrace of one scan; one file, or one image that was read, may have both.

    Raises
    ------
    Rejected
        If a file is wrong, or there is no retrace.
    """
    pair = read_trace_and_perhaps_retrace(trace, retrace, how, both=True)
    return pair[0], pair[1]


def read_trace_and_perhaps_retrace(
    trace: ImageSource, retrace: ImageSource | None, how: dict[str, Any], both: bool = False
) -> list[ScanImage]:
    """Read the trace, and the retrace if one is given or in the same file; with ``both`` it must not be missing.

    Raises
    ------
    Rejected
        If a file is wrong, the shapes differ, or a retrace is missing that is needed.
    """
    channel, retrace_channel, frame = (how.get(name) for name in _CHANNEL)
    if isinstance(trace, str | Path) and (retrace is None or isinstance(retrace, str | Path)):
        first, second = Path(trace), None if retrace is None else Path(retrace)
        if not both and second is None and retrace_channel is None and not _has_retrace(first, channel):
            return [read_image(first, channel, "trace", frame)]
        return list(read_pair(first, second, channel, retrace_channel, frame))
    if isinstance(trace, Image) and retrace is None:
        retrace = trace.retrace
    if retrace is None:
        if both:
            raise Rejected([Problem("retrace", 0, "", "missing; both directions are needed")])
        return [_scan_image(trace, "trace", how)]
    pair = [_scan_image(trace, "trace", how), _scan_image(retrace, "retrace", how)]
    if pair[0].heights.shape != pair[1].heights.shape:
        raise Rejected([Problem("retrace", 0, "", "has another shape than the trace")])
    return pair


def _scan_image(image: ImageSource, direction: Direction, how: dict[str, Any]) -> ScanImage:
    if isinstance(image, Image):
        return image.scan
    if isinstance(image, str | Path):
        return read_image(Path(image), how.get("channel"), direction, how.get("frame"))
    heights = np.ascontiguousarray(image, dtype=np.float64)
    if heights.ndim != 2 or min(heights.shape) < 2:
        why = f"has the shape {heights.shape}; it takes (rows, columns)"
        raise Rejected([Problem(direction, 0, "", why)])
    source = Source(direction, sha256(heights.tobytes()).hexdigest()[:16])
    return ScanImage(direction, source, heights, direction)


def _has_retrace(path: Path, channel: str | None) -> bool:
    """Return True if a file has the retrace of the trace that would be read, or does not say which one it is."""
    try:
        channels = channels_of(path)
        return partner(channels, choose(channels, channel, "trace")) is not None
    except (Rejected, ValueError):
        return True  # the reader of pairs reports the fault


def read_trace_beside(path: ImageSource, channel: str | None) -> ScanImage | None:
    """Read the trace of the same signal where a channel of a file is a retrace; None where there is not one trace."""
    if not isinstance(path, str | Path):
        return None
    channels = channels_of(Path(path))
    chosen = choose(channels, channel, "trace")
    traces = [one for one in channels if one.direction == "trace" and one.signal == chosen.signal]
    if chosen.direction != "retrace" or len(traces) != 1:
        return None
    return read_image(Path(path), str(traces[0].number))


def known_sample(
    *,
    lattice_nm: float | None = None,
    lattice: Literal["hexagonal", "square"] = "hexagonal",
    cell: tuple[float, float, float] | None = None,
    pitch_nm: float | None = None,
    angle_deg: tuple[float, float] | None = None,
) -> KnownSample:
    """Return the sample of these constants.

    Raises
    ------
    TypeError
        If they contradict each other, or none is given.
    """
    if lattice_nm is None and cell is None and pitch_nm is None:
        raise TypeError("images need the constant of their sample: lattice_nm, cell, or pitch_nm")
    if lattice_nm is not None and cell is not None:
        raise TypeError("lattice_nm and cell are two lattices; give one")
    if angle_deg is not None and pitch_nm is None:
        raise TypeError("angle_deg is for a grating, of pitch_nm; a lattice shows its angle")
    unit_cell = None
    if cell is not None:
        unit_cell = Cell(*cell, "given")
    elif lattice_nm is not None:
        unit_cell = (Cell.square if lattice == "square" else Cell.hexagonal)(lattice_nm)
    angle = None if angle_deg is None else Estimate(*angle_deg)
    return KnownSample(unit_cell, None if pitch_nm is None else Grating(pitch_nm, angle))


def sample_of(how: dict[str, Any]) -> KnownSample:
    """Return the sample that keywords of a function, or of a command, describe.

    Raises
    ------
    TypeError
        As ``known_sample``.
    """
    return known_sample(**_subset(how, _SAMPLE))


def acquisition_of(how: dict[str, Any]) -> Acquisition:
    """Return how images were taken, by keywords of a function or of a command."""
    return Acquisition(**_subset(how, _ACQUISITION))


def _subset(how: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    return {name: how[name] for name in names if name in how}


def sample_image(
    v_scan: float, v_offset: float | None, trace: ImageSource, retrace: ImageSource | None, how: dict[str, Any]
) -> tuple[SampleImage, list[ScanImage]]:
    """Read an image of a sample of known constant; return it with the channels of its files.

    Raises
    ------
    Rejected
        If a file is wrong.
    """
    images = read_trace_and_perhaps_retrace(trace, retrace, how)
    first, ratio = images[0], None
    if first.width_nm and first.height_nm:
        low, high = acquisition_of(how).window
        ratio = first.height_nm / (first.width_nm / (high - low))
    name = " and ".join(dict.fromkeys(one.file for one in images))
    heights = [one.heights for one in images]
    if len(images) == 1 and first.direction == "retrace":  # a way back is a way forward over the mirror image
        heights = [np.ascontiguousarray(first.heights[:, ::-1])]
        name = f"{name} (the retrace alone, mirrored)"
    return SampleImage(name, v_scan, v_offset, heights[0], heights[1] if len(images) > 1 else None, ratio), images
