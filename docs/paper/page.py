"""The page: every printed number, ours, and whether they are the same; with the pictures that it has."""

from collections import Counter
from collections.abc import Callable

from matplotlib.figure import Figure

from paper import drawn_5_played, figure_2, figure_3, figure_5_growth, figure_5_laws, figure_5_played, figure_6, table_1
from paper.drawing import png
from paper.rows import Row, Source, faults

Pictures = dict[str, tuple[str, Callable[[], Figure]]]
SECTIONS: tuple[tuple[str, str, Callable[[], list[Row]], Pictures], ...] = (
    (table_1.TITLE, table_1.TEXT, table_1.rows, {}),
    *((m.TITLE, m.TEXT, m.rows, m.PICTURES) for m in (figure_2, figure_3, figure_5_laws)),
    (figure_5_played.TITLE, figure_5_played.TEXT, figure_5_played.rows, drawn_5_played.PICTURES),
    *((m.TITLE, m.TEXT, m.rows, m.PICTURES) for m in (figure_5_growth, figure_6)),
)
PICTURES: Pictures = {name: picture for *_, pictures in SECTIONS for name, picture in pictures.items()}

_HEAD = """# The paper's numbers, and ours

Every number that the text, Table 1 and the captions of *Feedforward Compensation of Piezo Nonlinearity for
High-Precision High-Speed Atomic Force Microscopy* (Umeda and Kodera) print of a result. `make paper` writes this
page and its pictures; `tests/test_paper.py` holds it against what the program does.

The paper measured a piezo. We did not: what is not an equation here is the [virtual scanner](../virtual.md), **a
simulation, and identified on some of these very numbers**. Hence the column "from":

| from | what agreement is worth |
|---|---|
| law | an equation as `tablegen` has it, with the paper's parameters: that we compute what the paper computes |
| law, fitted | an equation through the paper's own numbers: that these belong together |
| arithmetic | the paper's numbers against each other; nothing of ours |
| simulation, identified | none: the virtual scanner was made for it; a difference is what it cannot do at once |
| simulation | some: it follows from other numbers, this one was not used |

A row is "same" if our number lies in the range "same if": half a unit of the last printed digit; where the paper
says about, approximately, roughly or ~, a tenth of the value if that is more, with three digits a unit of the last; a
thousandth where it says exactly. The verdict is computed. Pictures have ours as lines and what the paper prints as open
circles; its curves are not available. Figures 1 and 4 print no result.
"""

_SLIPS = """## Slips in the paper

What has to be read differently than it is printed; the program does so.

| where | printed | read |
|---|---|---|
| (8) | k_scan, in nm/V by (5) | nm per full scale, k times V_max: otherwise alpha is off by V_max |
| section 8, figure 5b | beta = 0.9 for -9 % | 0.09 |
| section 8 | the inverse of (16) is plotted in 5b | of (15) |
| section 9 | rho in nm⁻¹ | no unit: V / V_max in (22) has none |
| (20) | gamma | infinite at u_peak - beta = 0.2197 and 0.7803, beyond which the sign is wrong; xi, xi gamma are not |
| (17), figure 5a | backward u_peak 0.48, peak near 0.55 | 0.48 along the sweep; on the drive's axis 1 - 0.48 = 0.52 |
| figure 5h, caption | dependence on gamma | on u_peak, as the text has it |
| (23) | R less alpha_DL, a difference of nm and a number | R normalised to its value at f_DH |
| section 10 | f_DL for the reference frequency | f_DH |
| sections 5 and 6 | 200 nm is 13 V; 400 nm becomes 436 nm | 436 nm takes 200 nm at 20 V: another scanner |
"""


def all_rows() -> list[tuple[str, list[Row]]]:
    """Section titles and their rows; raises ``ValueError`` where one needs a reason, or has one too many."""
    found = [(title, make()) for title, _, make, _ in SECTIONS]
    wrong = faults(row for _, rows in found for row in rows)
    if wrong:
        raise ValueError("\n".join(wrong))
    return found


def page() -> str:
    """README.md of this folder."""
    made = all_rows()
    parts = [_HEAD, _summary([row for _, rows in made for row in rows])]
    for (title, rows), (_, text, _, pictures) in zip(made, SECTIONS, strict=True):
        parts.append(f"## {title}\n\n{text}\n")
        parts.append(_table(rows))
        parts.extend(f"![{alt}]({name}.png)\n" for name, (alt, _) in pictures.items())
    return "\n".join([*parts, _SLIPS])


def pictures() -> dict[str, bytes]:
    """Every picture by its file name."""
    return {f"{name}.png": png(draw()) for name, (_, draw) in PICTURES.items()}


def _table(rows: list[Row]) -> str:
    head = "| in the paper | what | paper | same if | ours | from | same, or why not |\n|---|---|---|---|---|---|---|\n"
    cells = (
        (row.figure, row.what, row.printed.text, row.printed.within, row.ours_text, row.source, row.verdict)
        for row in rows
    )
    return head + "".join(f"| {' | '.join(line)} |\n" for line in cells)


def _summary(rows: list[Row]) -> str:
    count = Counter((row.source, row.same) for row in rows)
    lines = ["| from | numbers | same | differ |", "|---|---|---|---|"]
    for source in Source:
        same, other = count[source, True], count[source, False]
        lines.append(f"| {source} | {same + other} | {same} | {other} |")
    same = sum(row.same for row in rows)
    lines.append(f"| all | {len(rows)} | {same} | {len(rows) - same} |")
    return "\n".join(lines) + "\n"
