"""Table 1, and the numbers of the abstract."""

from paper import figure_2, figure_3, figure_6, laws
from paper.figure_5_played import SIDES
from paper.measured import by_operator, full_scale
from paper.rows import Printed, Row, Source, about, between, limits

TITLE = "Table 1"
TEXT = """The table shows the effect of each cause on an image of an uncorrected scanner, and the error that a
correction leaves. The sections below have the details. The column "operator" is that of the
[operator](../operator.md) in place of the paper's corrections."""


def rows() -> list[Row]:
    """Table 1 by its lines, then the abstract."""
    size_law = laws.size_law()
    offset = figure_2.range_difference()
    size = -figure_3.needed(size_law, figure_3.LARGEST_NM)
    triangle = full_scale("triangle").error
    hysteresis = max(abs(triangle.forward.peak[0]), abs(triangle.backward.peak[0]))
    rate = figure_6.change_of(3.0)
    in_order = [offset, size, hysteresis, rate]
    place = [sorted(in_order, reverse=True).index(value) + 1 for value in in_order]
    known, law = Source.IDENTIFIED, Source.LAW
    typical = "typical scan size: 600 nm, the calibration of section 6, by (6)"
    found = [
        Row("table 1", "offset voltage", about("30", "%", before="max. "), offset, known),
        Row("table 1", "scan size, at full scale, (10)", about("25", "%", before="max. "), size, law),
        Row("table 1", typical, limits("below 15 %", "%", high=15.0), -figure_3.needed(size_law, 600.0), law),
        Row("table 1", "hysteresis, 100 V, either direction", between("5", "10", "%", "max. "), hysteresis, known),
        Row("table 1", "scan rate, three times", between("1", "2", "%", "max. about "), rate, law),
    ]
    for number, (what, rank) in enumerate(zip(("offset", "size", "hysteresis", "rate"), place, strict=True), 1):
        printed = Printed(str(number), "", number, number, 0)
        found.append(Row("table 1", f"contribution order of the {what}", printed, rank, known, decimals=0))
    found.append(
        Row(
            "abstract",
            "largest error of the apparent size over the offset",
            between("20", "30", "%", "up to "),
            figure_2.at_ends()[1],
            known,
        )
    )
    return [*found, *_improvement()]


def _improvement() -> list[Row]:
    """The factors by which the corrections reduce the errors of the virtual scanner."""
    before, after = full_scale("triangle").error, full_scale("harmonic").error
    said = limits("an order of magnitude", "times", low=10.0, decimals=0)
    forward, backward = (abs(getattr(before, side).peak[0] / getattr(after, side).peak[0]) for side in SIDES)
    size = figure_3.calibrated()
    ratio = size.before_percent / size.largest_percent
    known, residual = Source.IDENTIFIED, "residual, ratio before to after (17)"
    operators = [abs(getattr(before, side).peak[0] / getattr(by_operator(), side).peak[0]) for side in SIDES]
    return [
        Row("abstract", f"{residual}, forward", said, forward, known, operator=operators[0]),
        Row("abstract", f"{residual}, backward", said, backward, known, operator=operators[1]),
        Row(
            "abstract",
            "size error, ratio before to after (6) and (10)",
            said,
            ratio,
            known,
            operator=size.before_percent / figure_3.operator_percent(),
        ),
    ]
