"""The page: every printed number, our number, and whether they are the same; with the pictures of the page."""

from collections import Counter
from collections.abc import Callable

from matplotlib.figure import Figure

from paper import drawn_5_played, figure_2, figure_3, figure_5_growth, figure_5_laws, figure_5_played, figure_6, table_1
from paper.drawing import png
from paper.rows import MADE_SO, OWN, Row, Source, faults

Pictures = dict[str, tuple[str, Callable[[], Figure]]]
SECTIONS: tuple[tuple[str, str, Callable[[], list[Row]], Pictures], ...] = (
    (table_1.TITLE, table_1.TEXT, table_1.rows, {}),
    *((m.TITLE, m.TEXT, m.rows, m.PICTURES) for m in (figure_2, figure_3, figure_5_laws)),
    (figure_5_played.TITLE, figure_5_played.TEXT, figure_5_played.rows, drawn_5_played.PICTURES),
    *((m.TITLE, m.TEXT, m.rows, m.PICTURES) for m in (figure_5_growth, figure_6)),
)
PICTURES: Pictures = {name: picture for *_, pictures in SECTIONS for name, picture in pictures.items()}

_TITLE = """# The paper's numbers, and ours

This page compares every result that the text, Table 1 and the captions of *Feedforward Compensation of Piezo
Nonlinearity for High-Precision High-Speed Atomic Force Microscopy* (Umeda and Kodera) print with our number. It is for
readers of the paper who want to check tablegen. The page on the [virtual scanner](../virtual.md) describes the
simulation behind many of our numbers. `make paper` writes this page and its pictures; `tests/docs/test_paper.py`
compares the page with the program.
"""

_EVIDENCE = """## What is evidence: {same} of {count}

The paper measured a piezo; we did not. A number of ours that is neither an equation nor arithmetic comes from the
virtual scanner. It is **a simulation, and was identified on some of these numbers**. Only a number that it was not
identified on is evidence that it is like the paper's scanner. There are {count} of them, of {all}; {same} agree
with the paper. The sections below have them again.
"""

_SOURCES = """## Where our numbers come from

The column "from" says where our number comes from:

| from | what agreement shows |
|---|---|
| simulation | something: the number follows from other numbers, and was not used itself |
| law | our number is an equation of `tablegen` with the paper's parameters: we compute what the paper computes |
| law, fitted | our number is an equation fitted to the paper's own numbers: these numbers belong together |
| arithmetic | the paper's numbers are consistent with each other; nothing of ours is used |
| simulation, identified | nothing: it was made to give this number, but cannot meet all numbers at once |
| input | nothing: it is the printed number, put in |

A row is "same" if our number lies in the range "same if". Where the printed number is the source of ours ("simulation,
identified" and "input"), a row that lies there says "made so" instead. The range is half a unit of the last printed
digit. If the paper says about, approximately, roughly or ~, it is a tenth of the value if that is more, and for three
digits a unit of the last digit. If the paper says exactly, it is a thousandth. The program computes the verdict. The
pictures show our numbers as lines and the printed numbers as open circles; the paper's curves are not available.
Figures 1 and 4 print no result.
"""

_SLIPS = """## Slips in the paper

The following places have to be read differently than they are printed; the program does so.

| where | printed | read |
|---|---|---|
| (8) | k_scan, in nm/V by (5) | nm per full scale, k times V_max: otherwise alpha is wrong by a factor of V_max |
| section 8, figure 5b | beta = 0.9 for -9 % | 0.09 |
| section 8 | the inverse of (16) is plotted in 5b | the inverse of (15) |
| section 9 | rho in nm⁻¹ | no unit: V / V_max in (22) has none |
| (20) | gamma | infinite at u_peak - beta = 0.2197 and 0.7803, and of wrong sign beyond; xi, xi gamma are finite |
| (17), figure 5a | backward u_peak 0.48, peak near 0.55 | 0.48 along the sweep; on the drive's axis 1 - 0.48 = 0.52 |
| figure 5h, caption | dependence on gamma | dependence on u_peak, as in the text |
| (23) | R minus alpha_DL, a difference of nm and a number | R normalised to its value at f_DH |
| section 10 | f_DL for the reference frequency | f_DH |
| sections 5 and 6 | 200 nm is 13 V; 400 nm becomes 436 nm | 436 nm needs 200 nm at 20 V: another scanner |
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
    every = [row for _, rows in made for row in rows]
    parts = [_TITLE, *_evidence(every), _SOURCES, _summary(every)]
    for (title, rows), (_, text, _, pictures) in zip(made, SECTIONS, strict=True):
        parts.append(f"## {title}\n\n{text}\n")
        parts.append(_table(rows))
        parts.extend(f"![{alt}]({name}.png)\n" for name, (alt, _) in pictures.items())
    return "\n".join([*parts, _SLIPS])


def pictures() -> dict[str, bytes]:
    """Every picture by its file name."""
    return {f"{name}.png": png(draw()) for name, (_, draw) in PICTURES.items()}


def _evidence(every: list[Row]) -> list[str]:
    """The numbers that could have come out otherwise, before all others."""
    rows = [row for row in every if row.source is Source.SIMULATED]
    counts = {"same": sum(row.same for row in rows), "count": len(rows), "all": len(every)}
    return [_EVIDENCE.format(**counts), _table(rows)]


def _table(rows: list[Row]) -> str:
    """With a column for the operator where a row has its number."""
    titles = ["in the paper", "what", "paper", "same if", "ours", "from", "same, or the reason"]
    lines = [
        [row.figure, row.what, row.printed.text, row.printed.within, row.ours_text, row.source, row.verdict]
        for row in rows
    ]
    if any(row.operator is not None for row in rows):
        titles.insert(5, "operator")
        for line, row in zip(lines, rows, strict=True):
            line.insert(5, row.operator_text)
    head = f"| {' | '.join(titles)} |\n|{'---|' * len(titles)}\n"
    return head + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _summary(rows: list[Row]) -> str:
    count = Counter((row.source, row.same) for row in rows)
    lines = [f"| from | numbers | same | {MADE_SO} | differ |", "|---|---|---|---|---|"]
    for source in Source:
        met, other = count[source, True], count[source, False]
        cells = ("", str(met)) if source in OWN else (str(met), "")
        lines.append(f"| {source} | {met + other} | {' | '.join(cells)} | {other} |")
    same, made_so = (sum(row.verdict == verdict for row in rows) for verdict in ("same", MADE_SO))
    lines.append(f"| all | {len(rows)} | {same} | {made_so} | {len(rows) - same - made_so} |")
    return "\n".join(lines) + "\n"
