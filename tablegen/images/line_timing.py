"""Timing of a line as image files state it: the turn and the window, against those that a fit has taken."""

from collections.abc import Iterable

from tablegen.base.warnings import Remark, spoils
from tablegen.images.files import ScanImage

_SAME_TURN = 0.005  # of the line period
_SAME_WINDOW = 0.005  # of a sweep


def timing_remarks(images: Iterable[object], turn: float, window: tuple[float, float]) -> list[Remark]:
    """Return a remark on each image whose file states another turn or window than the fit has; tables are skipped.

    Parameters
    ----------
    images
        Measurements of a fit.
    turn, window
        Share of the line period that is forward, and part of each sweep that is imaged, as the fit took them.
    """
    remarks: dict[Remark, None] = {}
    for image in images:
        if not isinstance(image, ScanImage):
            continue
        name = image.source.name
        if image.turn is not None and abs(image.turn - turn) > _SAME_TURN:
            text = f"{name}: the file states a turn of {image.turn:.4g}, and the fit has {turn:.4g}"
            remarks[spoils(f"{text}; give --turn {image.turn:.4g}", code="image-timing")] = None
        if (
            image.window is not None
            and max(abs(a - b) for a, b in zip(image.window, window, strict=True)) > _SAME_WINDOW
        ):
            theirs, ours = ("{:.4g} to {:.4g}".format(*one) for one in (image.window, window))
            advice = "give --window {:.4g} {:.4g}, and the voltage of the whole sweep".format(*image.window)
            remarks[
                spoils(
                    f"{name}: the file states a window of {theirs}, and the fit has {ours}; {advice}",
                    code="image-timing",
                )
            ] = None
    return list(remarks)
