"""The user's own image beside the prediction: levelled, with its size and the range of its heights."""

import numpy as np

from tablegen.charts.chart import Raster
from tablegen.charts.png import data_address, indexed_png
from tablegen.charts.style import LEFT_OUT, palette, shades_of
from tablegen.correction.agreement import levelled
from tablegen.html_report.blocks import HeightScale, PagePicture, Paragraph, Pictures, ScaleBar, Section
from tablegen.html_report.subject import OwnImage, Subject

_MOST_PIXELS = 256  # of a side: what a page shows at its width, and a bound of its size
_OTHER_SIZE = 0.02  # difference from the size of the scan that is remarked
_SHAPES = (0.2, 5.0)  # height over width that a picture is drawn with


def own_picture(image: OwnImage, window_nm: tuple[float, float] | None) -> PagePicture:
    """Return the picture of an image, whose size is that of its file, else that of the scan, ``window_nm``."""
    heights, unit = np.asarray(image.heights, dtype=np.float64), image.unit
    if unit == "m":
        heights, unit = 1e9 * heights, "nm"
    heights = np.where(np.isfinite(heights), levelled(heights), np.nan)
    rows, columns = heights.shape
    step = max(-(-count // _MOST_PIXELS) for count in (rows, columns))
    pixels = heights[::step, ::step]
    pixels = pixels[::-1] if image.bottom_first else pixels
    finite = pixels[np.isfinite(pixels)]
    low, high = (float(np.percentile(finite, share)) for share in (1.0, 99.0)) if len(finite) else (0.0, 0.0)
    raster = Raster(pixels, (0.0, 1.0), (0.0, 1.0), low, high, "grey")
    size = image.size_nm or window_nm
    shape = rows / columns if size is None else size[1] / size[0]
    whose = "" if image.size_nm or size is None else ", size of the scan file"
    title = f"your image: {image.name}{', ' + image.channel if image.channel else ''} (measured{whose})"
    return PagePicture(
        title,
        _picture(shades_of(raster)),
        "your own image, levelled line by line",
        (),
        round(min(max(shape, _SHAPES[0]), _SHAPES[1]), 4),
        None if size is None else ScaleBar.of(size[0]),
        size,
        HeightScale(low, high, unit or "units of the file", _picture(np.arange(LEFT_OUT, dtype=np.uint8)[None])),
    )


def _picture(shades: np.typing.NDArray[np.uint8]) -> str:
    return data_address(indexed_png(shades, palette("grey")))


def image_remarks(image: OwnImage, window_nm: tuple[float, float] | None) -> tuple[Paragraph, ...]:
    """Return what was done to the image, and a warning where its size is not that of the scan."""
    text = "Your image is levelled line by line; its shades end where 1 % of its heights are below or above."
    if max(image.heights.shape) > _MOST_PIXELS:
        text += f" At most {_MOST_PIXELS} pixels of a side are shown."
    if image.size_nm is not None and window_nm is not None:
        off = max(abs(one / other - 1.0) for one, other in zip(image.size_nm, window_nm, strict=True))
        if off > _OTHER_SIZE:
            (width, height), (x, y) = image.size_nm, window_nm
            other = f"its file says {width:.4g} x {height:.4g} nm, and this scan images {x:.4g} x {y:.4g} nm"
            return Paragraph(text, "quiet"), Paragraph(f"Your image may be of another scan: {other}.", "warn")
    return (Paragraph(text, "quiet"),)


def with_own_image(subject: Subject, simulated: Section | None) -> Section | None:
    """Return the section of the simulated pictures with the user's image beside them, or that image alone."""
    image, planned = subject.image, subject.planned
    if image is None:
        return simulated
    window_nm = None
    if planned is not None and not planned.plan.y.drive.resting:
        window_nm = planned.plan.x.drive.window_nm, planned.plan.y.drive.window_nm
    picture, remarks = own_picture(image, window_nm), image_remarks(image, window_nm)
    if simulated is None:
        return Section("image", "Your image", (Pictures((picture,)), *remarks))
    blocks = tuple(
        Pictures((*block.pictures, picture)) if isinstance(block, Pictures) else block for block in simulated.blocks
    )
    return Section(
        simulated.key, "A lattice, before and after (simulation), and your image", (*blocks, *remarks), simulated.lead
    )
