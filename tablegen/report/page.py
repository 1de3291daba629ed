"""The page: its sections in order, and the one template that makes HTML of them."""

from base64 import b64encode
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from importlib.resources import files as resources
from typing import Any

from markupsafe import Markup

from tablegen.report.asked import asked, files, verification
from tablegen.report.basis import basis
from tablegen.report.blocks import Charts, Section
from tablegen.report.chart import Chart
from tablegen.report.corrections import corrections
from tablegen.report.errors import errors
from tablegen.report.lattice import lattice
from tablegen.report.lines import lines
from tablegen.report.playing import played_axes
from tablegen.report.promises import certificate
from tablegen.report.ranking import ranked
from tablegen.report.spectrum import quantisation, spectrum
from tablegen.report.subject import Subject
from tablegen.report.svg import svg, swatch
from tablegen.report.usable import usable
from tablegen.report.words import coded, visible

Tell = Callable[[str], None]


def sections(subject: Subject, tell: Tell = lambda _: None) -> list[Section]:
    """All that the page shows, what tells most of the image first."""
    planned = subject.planned
    if planned is None:
        found = [asked(subject), certificate(subject), lines(subject, None), spectrum(subject), quantisation(subject)]
        return [*found, corrections(subject), verification(subject), files(subject)]
    tell("playing the scan on what the scanner file says")
    axes = played_axes(planned)
    tell("drawing")
    picture = lattice(planned, axes)
    return [
        *([] if picture is None else [picture]),
        certificate(subject),
        asked(subject),
        lines(subject, axes),
        errors(planned, axes),
        spectrum(subject),
        quantisation(subject),
        corrections(subject),
        usable(planned),
        basis(planned),
        verification(subject),
        files(subject),
    ]


def charts_of(found: list[Section]) -> dict[str, Chart]:
    """Every chart of a page by its key."""
    blocks = (block for section in found for block in section.blocks if isinstance(block, Charts))
    return {chart.key: chart for block in blocks for chart in block.charts}


def page(subject: Subject, found: list[Section]) -> bytes:
    """The page as UTF-8. The same subject gives the same bytes: no date, and no folder of this machine."""
    manifest = subject.manifest
    planned = subject.planned
    scanner = "" if planned is None else planned.setup.scanner.name
    script = _resource("page.js")
    findings = ranked(subject)
    broken = sum(one.weight == "limit" for one in findings)
    context = {
        "title": visible(f"{manifest.name} on {scanner}" if scanner else manifest.name),
        "hash": manifest.hash,
        "version": manifest.tablegen,
        "findings": findings,
        "broken": broken,
        "spoils": sum(one.weight == "spoils" for one in findings),
        "from_directory": planned is None,
        "sections": found,
        "style": Markup(_resource("page.css")),
        "script": Markup(script),
        "script_hash": b64encode(sha256(script.encode()).digest()).decode("ascii"),
        "limited": planned is not None and planned.limited,
        "coded": coded,
        "svg": svg,
        "swatch": swatch,
    }
    text: str = _template().render(context)
    return text.encode("utf-8")


def _resource(name: str) -> str:
    return (resources("tablegen.report") / name).read_text("utf-8")


@cache
def _template() -> Any:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, autoescape=True
    )
    return environment.from_string(_resource("page.html.j2"))
