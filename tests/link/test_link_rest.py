"""Uploads of a scan whose x rests, or both axes: a device takes them as it takes a line scan, whose y rests."""

import pytest
from client_line import VirtualLine
from client_rig import client, model
from link_programs import INFO, LIMITS, make_scan
from replacing import replace
from resting import at_rest

from tablegen.link.acceptance import Playing, first_objection
from tablegen.link.messages import Reason
from tablegen.link.program_image import make_image, take_apart


@pytest.mark.parametrize("axes", ["x", "y", "xy"])
def test_a_device_takes_an_axis_at_rest(axes: str) -> None:
    """Alone, and in the place of a scan that runs."""
    scan = make_scan(3)
    image = make_image(at_rest(scan.program, axes), scan.digest)
    contents = take_apart(image.data, image.info.x, image.info.y)
    assert first_objection(contents, LIMITS, LIMITS, None) is None
    assert first_objection(contents, LIMITS, LIMITS, Playing(scan.program.x, scan.program.y, True)) is None
    with client(VirtualLine(model(INFO))) as device:
        device.upload(image)
        assert device.status().hash.hex() == scan.digest


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_place_outside_the_limits_is_refused_of_an_axis_at_rest_too(axis: str) -> None:
    program = at_rest(make_scan(3).program, axis)
    own = getattr(program, axis)
    output = replace(own.output, offset_word=(own.output.code_max + 3) << own.output.gain_q)
    image = make_image(replace(program, **{axis: replace(own, output=output)}), "0" * 64)
    objection = first_objection(take_apart(image.data, image.info.x, image.info.y), LIMITS, LIMITS, None)
    assert objection == (Reason.RANGE, int(axis == "y"))
