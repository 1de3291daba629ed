"""Apply a distortion to the images of a scan, and check that trace and retrace are what they are called."""

from typing import Any

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.correction.agreement import difference
from tablegen.correction.distortion import Distortion, Resampler
from tablegen.correction.scan_images import Images
from tablegen.correction.straight import StraightScan, corrected_scan
from tablegen.images.pair_checks import check_heights, check_pair
from tablegen.numerics.arrays import Floats

_ALIKE = 0.3  # of the contrast: trace and retrace that differ by less are stored as declared
_BETTER = 0.6  # times the difference: the agreement that shows mirrored or exchanged images


def corrected(
    images: Images, distortion: Distortion, size: tuple[float, float] | None, record: dict[str, Any]
) -> StraightScan:
    """Apply a distortion to all channels, after the images that it is about were checked.

    Parameters
    ----------
    size
        Width and height of the straight pictures in nm; None where they are unknown.
    record
        What the JSON beside the pictures says of the correction; frames and what was left out are added.

    Raises
    ------
    Unphysical
        If the images are not those of a trace and a retrace.
    """
    heights = [images.heights(i) for i in images.reference]
    if len(heights) == 2:
        check_pair(heights[0], heights[1])
    else:
        check_heights("image", heights[0])
    check_order(images, distortion)
    if images.frames is not None:
        record["frames"] = list(images.frames)
    if images.left_out:
        record["left_out"] = list(images.left_out)
    return corrected_scan(images.pictures, distortion, size, images.reference, record)


def check_order(images: Images, distortion: Distortion) -> None:
    """Check that trace and retrace do not agree far better mirrored or exchanged.

    Each image is corrected with the distortion of the other direction, and compared.

    Raises
    ------
    Unphysical
        If they do.
    """
    if len(images.reference) < 2:
        return
    trace, retrace = (images.heights(i) for i in images.reference)
    ways = [Resampler.of(distortion, way) for way in (True, False)]

    def mismatch(one: Floats, other: Floats) -> float:
        return difference(ways[0](one), ways[1](other))

    as_stored = mismatch(trace, retrace)
    if as_stored < _ALIKE:
        return
    turned = np.ascontiguousarray(retrace[:, ::-1])
    if mismatch(trace, turned) < _BETTER * as_stored:
        advice = "leave --retrace-mirrored out" if images.mirrored else "give --retrace-mirrored"
        raise Unphysical(f"the retrace agrees with the trace only when it is mirrored; {advice}")
    if mismatch(retrace, trace) < _BETTER * as_stored:
        raise Unphysical(
            "trace and retrace agree only when they are exchanged; is the retrace the first of both files?"
        )
