"""Sections as HTML: one template, one style, one script, which the page admits by its digest."""

from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files as resources
from typing import Any

from markupsafe import Markup

from tablegen.charts.svg import svg, swatch
from tablegen.html_report.blocks import Section, TableCell
from tablegen.html_report.number_text import coded, visible
from tablegen.html_report.ranking import Finding


def document(
    title: str,
    verdict: TableCell,
    findings: Sequence[Finding],
    sections: Sequence[Section],
    notice: str = "",
    foot: str = "",
    answers: Sequence[str] = (),
) -> bytes:
    """Render the whole page as UTF-8. All texts are escaped here, whatever their origin."""
    script = _resource("page.js")
    context = {
        "title": visible(title),
        "verdict": verdict,
        "findings": findings,
        "sections": sections,
        "notice": notice,
        "answers": answers,
        "foot": foot,
        "style": Markup(_resource("page.css")),
        "script": Markup(script),
        "script_hash": b64encode(sha256(script.encode()).digest()).decode("ascii"),
        "coded": coded,
        "svg": svg,
        "swatch": swatch,
    }
    text: str = _template().render(context)
    return text.encode("utf-8")


def _resource(name: str) -> str:
    return (resources("tablegen.html_report") / name).read_text("utf-8")


@cache
def _template() -> Any:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, autoescape=True
    )
    return environment.from_string(_resource("page.html.j2"))
