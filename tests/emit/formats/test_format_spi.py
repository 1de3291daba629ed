"""The output to serial converters: the ports and parameters of ``NAME_top``, and its own.

What it plays is compared in ``tests/verification/test_top_play.py`` and ``hdl_tests/test_converter_tops.py``.
"""

import re
from pathlib import Path

from building import NAME
from editing import run
from formatted import check_finds_a_flip, formatted

FILE = f"{NAME}_spi.v"
PINS = ["sclk", "cs_x_n", "cs_y_n", "mosi_x", "mosi_y", "ldac_n", "sending"]


def ports(text: str) -> list[str]:
    return re.findall(r"^    (?:, )?(?:input|output) +wire (?:\[[^\]]*\])? *(\w+)", text, re.MULTILINE)


def parameters(text: str) -> list[str]:
    return re.findall(r"^    parameter (?:\[31:0\] )?(\w+) = ([\w\']+)", text, re.MULTILINE)


def test_it_has_the_ports_and_parameters_of_the_top(tmp_path: Path) -> None:
    built = formatted(tmp_path, "short", "spi")
    text, top = (built.files[name].decode("ascii") for name in (FILE, f"{NAME}_top.v"))
    assert ports(text) == ports(top) + PINS
    own = parameters(top)
    assert len(own) > 10
    assert parameters(text)[: len(own)] == own


def test_a_changed_digit_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "spi"), "spi", [FILE])


def test_a_difference_is_shown_where_it_is(tmp_path: Path) -> None:
    """Also at the end of a long line."""
    built = formatted(tmp_path, "short", "spi")
    path = built.folder / FILE
    path.write_text(path.read_text("ascii").replace(".mosi_y(mosi_y)", ".mosi_y(mosi_x)"), "ascii")
    messages = run("verify", "--target", "files", built.folder).messages
    (told,) = (line for line in messages if line.startswith("spi files"))
    assert ".mosi_y(mosi_x)" in told
    assert ".mosi_y(mosi_y)" in told
