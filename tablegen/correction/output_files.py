"""Corrected pictures as files: .gwy, .tif, .npy and .png, each with the record of its correction.

Pixels that were not imaged are masked: a mask in .gwy, NaN in .tif and .npy, transparent in .png. Heights are those of
the input except in .png, whose range stands in its text. gwyfile writes .gwy, tifffile .tif, Pillow .png.
"""

import json
from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

import numpy as np
import numpy.typing as npt

from tablegen.correction.straight import ScanPicture, StraightScan
from tablegen.numerics.arrays import Floats

MODULES = {".gwy": "gwyfile", ".tif": "tifffile", ".tiff": "tifffile", ".png": "PIL", ".npy": None}
_LEVELS = 65535  # grey levels of a PNG; 0 is transparent
_KEY = "tablegen correct"  # of the provenance
_METRES = {"pm": 1e-12, "nm": 1e-9, "µm": 1e-6, "μm": 1e-6, "um": 1e-6, "mm": 1e-3}
_NM_PER_CM = 1e7


def files_of(scan: StraightScan, name: str, suffix: str) -> dict[str, bytes]:
    """Return the files of a scan by name: ``name`` and ``suffix``, and their companions."""
    return _WRITERS[suffix](scan, name, suffix)


def _shown(picture: ScanPicture) -> Floats:
    """Return the heights with the first row of the picture on top."""
    return np.ascontiguousarray(picture.heights[::-1] if picture.bottom_first else picture.heights)


def _titles(pictures: Sequence[ScanPicture]) -> list[str]:
    """Return the titles of pictures: all different, and each with its direction where there are both."""
    both = len({picture.forward for picture in pictures}) > 1
    titles: list[str] = []
    for number, picture in enumerate(pictures):
        side = "trace" if picture.forward else "retrace"
        title = picture.title or (side if both else "corrected")
        if both and picture.title and not _says_direction(title):
            title = f"{title} {side}"
        titles.append(title if title not in titles else f"{title} {number}")
    return titles


def _says_direction(title: str) -> bool:
    return any(word in title.lower() for word in ("trace", "forward", "backward"))


def _text(scan: StraightScan, **more: Any) -> str:
    return json.dumps({**scan.record, **more}, ensure_ascii=False, allow_nan=False)


def _npy(scan: StraightScan, name: str, suffix: str) -> dict[str, bytes]:
    """Return one picture as a matrix, several as rows x columns each; the record beside it."""
    heights = [picture.heights for picture in scan.pictures]
    out = BytesIO()
    np.save(out, heights[0] if len(heights) == 1 else np.stack(heights), allow_pickle=False)
    channels = [
        {"title": title, "unit": picture.unit, "direction": "trace" if picture.forward else "retrace"}
        for title, picture in zip(_titles(scan.pictures), scan.pictures, strict=True)
    ]
    beside = json.dumps({**scan.record, "channels": channels}, indent=2, ensure_ascii=False, allow_nan=False)
    return {f"{name}{suffix}": out.getvalue(), f"{name}.json": f"{beside}\n".encode()}


def _tiff(scan: StraightScan, name: str, suffix: str) -> dict[str, bytes]:
    """Return a page of 32-bit floating point for each picture."""
    import tifffile

    out = BytesIO()
    size = scan.size_nm
    with tifffile.TiffWriter(out) as writer:
        for title, picture in zip(_titles(scan.pictures), scan.pictures, strict=True):
            rows, columns = picture.heights.shape
            more: dict[str, Any] = {}
            if size is not None:
                more["resolution"] = (columns / size[0] * _NM_PER_CM, rows / size[1] * _NM_PER_CM)
                more["resolutionunit"] = "CENTIMETER"
            writer.write(
                _shown(picture).astype(np.float32),
                photometric="minisblack",
                metadata=None,
                description=json.dumps({**scan.record, "title": title, "unit": picture.unit}),
                software=scan.record["program"],
                contiguous=False,
                **more,
            )
    return {f"{name}{suffix}": out.getvalue()}


def _png(scan: StraightScan, name: str, suffix: str) -> dict[str, bytes]:
    """Return a file of 16-bit grey for each picture; its text states the heights of black and white."""
    from PIL import Image as Pillow
    from PIL.PngImagePlugin import PngInfo

    files = {}
    titles = _titles(scan.pictures)
    for title, picture in zip(titles, scan.pictures, strict=True):
        heights = _shown(picture)
        imaged = np.isfinite(heights)
        low, high = (float(one(heights[imaged])) for one in (np.min, np.max))
        grey = 1.0 + np.rint((heights - low) * ((_LEVELS - 1) / (high - low if high > low else 1.0)))
        grey = np.where(imaged, grey, 0.0)
        info = PngInfo()
        scale = {"level_1": low, f"level_{_LEVELS}": high, "unit": picture.unit}
        info.add_itxt(_KEY, _text(scan, title=title, grey=scale))
        out = BytesIO()
        image = Pillow.fromarray(grey.astype(np.uint16))
        more: dict[str, Any] = {} if imaged.all() else {"transparency": 0}
        image.save(out, "png", pnginfo=info, **more)
        part = "" if len(titles) == 1 else f"_{_plain(title)}"
        files[f"{name}{part}{suffix}"] = out.getvalue()
    return files


def _plain(title: str) -> str:
    """Reduce a title to a part of a file's name."""
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in title)[:60]


def _gwy(scan: StraightScan, name: str, suffix: str) -> dict[str, bytes]:
    """Return a data field, a mask and a text for each picture."""
    from gwyfile.objects import GwyContainer, GwyDataField

    container = GwyContainer()
    rows, columns = scan.pictures[0].heights.shape
    x, y = (float(columns), float(rows)) if scan.size_nm is None else (1e-9 * value for value in scan.size_nm)
    across = "" if scan.size_nm is None else "m"
    for number, (title, picture) in enumerate(zip(_titles(scan.pictures), scan.pictures, strict=True)):
        heights = _shown(picture)
        imaged = np.isfinite(heights)
        factor = _METRES.get(picture.unit)
        values = np.where(imaged, heights, np.mean(heights[imaged])) * (1.0 if factor is None else factor)
        unit = picture.unit if factor is None else "m"

        def field(data: npt.NDArray[Any], height: str) -> Any:
            return GwyDataField(data, xreal=x, yreal=y, si_unit_xy=across, si_unit_z=height)

        container[f"/{number}/data/title"] = title
        container[f"/{number}/data"] = field(values, unit)
        if not imaged.all():
            container[f"/{number}/mask"] = field((~imaged).astype(np.float64), "")
        container[f"/{number}/meta"] = GwyContainer({_KEY: _text(scan)})
    out = BytesIO()
    container.tofile(out)
    return {f"{name}{suffix}": out.getvalue()}


_WRITERS: dict[str, Callable[[StraightScan, str, str], dict[str, bytes]]] = {
    ".gwy": _gwy,
    ".tif": _tiff,
    ".tiff": _tiff,
    ".npy": _npy,
    ".png": _png,
}
