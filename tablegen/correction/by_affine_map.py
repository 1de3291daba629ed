"""Correct width, height and shear of images of a lattice by its cell alone."""

from typing import Any

from tablegen.base.input_errors import Unphysical
from tablegen.correction.affine_map import affine_map
from tablegen.correction.corrected_images import corrected
from tablegen.correction.fit_checks import check_agreement, check_sample_cell
from tablegen.correction.lattice_bow import check_bows
from tablegen.correction.scan_images import Images, check_reference
from tablegen.correction.straight import StraightScan


def by_affine_map(images: Images, lattice_nm: float | None, kind: str) -> StraightScan:
    """Correct width, height and shear of images of a lattice by its cell; lines and rows stay straight.

    Parameters
    ----------
    images
        Images of a file that has its size.
    lattice_nm
        Constant of the lattice in nm; None where it is unknown: then the width of the file stands.
    kind
        "hexagonal" or "square".

    Raises
    ------
    Unphysical
        If the cell does not determine the map, the map is implausible, or the image does not support it.
    """
    check_reference(images)
    images = images.of_imaged_rows()
    first = images.first
    if first.width_nm is None or first.height_nm is None:
        raise Unphysical("--affine needs a file that has its size, which decides between cells of several sizes")
    heights = [images.heights(i) for i in images.reference]
    ways = [images.forward[i] for i in images.reference]
    affine = affine_map(heights, ways, (first.width_nm, first.height_nm), lattice_nm, kind)
    distortion = affine.distortion
    size = distortion.x_range[1] - distortion.x_range[0], distortion.y_range[1] - distortion.y_range[0]
    record: dict[str, Any] = {"by": "affine map of a lattice", "sources": images.sources, **images.angle}
    record |= {"lattice_nm": lattice_nm, "lattice": affine.kind, "affine": affine.record}
    record["not_corrected"] = "displacement within lines and between rows"
    scan = corrected(images, distortion, size, record)
    check_agreement(scan.agreement)
    pictures = [scan.pictures[i].heights for i in images.reference]
    rows, columns = images.shape
    start = affine.sides_nm(first.height_nm) * [columns / size[0], rows / size[1]]
    bows = check_bows(pictures, start, scan.agreement)
    check_sample_cell(pictures, size, affine.constant_nm, affine.kind, lattice_nm is not None, start)
    names = ["trace" if way else "retrace" for way in ways]
    scan.record["affine"]["bows_percent"] = {name: one.record for name, one in zip(names, bows, strict=True)}
    return scan
