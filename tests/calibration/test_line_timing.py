"""Turn and window of image files: a fit that took others says so."""

import numpy as np
import pytest

from tablegen.base.data_files import Source
from tablegen.images.files import ScanImage
from tablegen.images.line_timing import timing_remarks


def image(turn: float | None = None, window: tuple[float, float] | None = None) -> ScanImage:
    return ScanImage("folder/a.sxm", Source("a.sxm", "0"), np.eye(4), turn=turn, window=window)


@pytest.mark.parametrize(
    ("one", "said"),
    [
        *((image(), []), (image(0.5, (0.0, 1.0)), []), (image(0.504), [])),
        (image(12.5 / 15.0), ["a.sxm: the file states a turn of 0.8333, and the fit has 0.5; give --turn 0.8333"]),
        (image(0.5, (0.1, 0.9)), ["a.sxm: the file states a window of 0.1 to 0.9, and the fit has 0 to 1; give"]),
    ],
)
def test_another_timing_is_said_once_a_file(one: ScanImage, said: list[str]) -> None:
    remarks = timing_remarks([object(), one, one], 0.5, (0.0, 1.0))
    assert [remark[: len(text)] for remark, text in zip(remarks, said, strict=True)] == said
    assert {remark.weight for remark in remarks} <= {"spoils"}


def test_the_timing_of_the_file_is_no_remark() -> None:
    assert timing_remarks([image(12.5 / 15.0, (0.1, 0.9))], 0.8333, (0.1, 0.9)) == []
