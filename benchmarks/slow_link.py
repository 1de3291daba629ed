"""What an upload takes over long ways, slow lines and lines that lose frames, for docs/upload.md.

``python benchmarks/slow_link.py`` prints the table, ``--write`` puts it into the page. The lines are virtual, the
client is the real one; the image is the tables of the shipped example.
"""

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from random import Random

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests" / "helpers"))  # the line and the device are those of the tests

from client_rig import info_for, model  # noqa: E402
from link_faults import Chances  # noqa: E402
from link_line import Line  # noqa: E402

from tablegen.config.load import load  # noqa: E402
from tablegen.link.device import Device  # noqa: E402
from tablegen.link.errors import LinkError  # noqa: E402
from tablegen.link.prepare import PreparedScan  # noqa: E402
from tablegen.planning.line_plan import make_plan  # noqa: E402

EXAMPLE = HERE.parent / "examples" / "annexin_200nm.toml"
PAGE = HERE.parent / "docs" / "upload.md"
_BAUD = 115200
_TICK_HZ = 500_000
_NOTE = """
`make link` measures this table: {size} bytes of tables, `--baud 115200`, a device that accepts eight frames at a time,
the default time-out. Bytes are all that the host wrote from opening the port on; seconds are those of the virtual
clock, from opening the port until the scan is active. Of several uploads the worst is shown.
"""


@dataclass(frozen=True)
class Way:
    """A line between host and device, and over how many uploads, each with chance of its own."""

    name: str
    uploads: int = 1
    baud: int = _BAUD
    round_trip_s: float = 0.002
    lose: float = 0.0


WAYS = (
    Way("as it should be: round trip 2 ms"),
    Way("round trip 0.5 s", round_trip_s=0.5),
    Way("round trip 1 s", round_trip_s=1.0),
    Way("round trip 2 s", round_trip_s=2.0),
    Way("line 12 times slower than `--baud` (9600)", baud=9600),
    Way("line 12 times slower, round trip 0.5 s", baud=9600, round_trip_s=0.5),
    Way("5 % of the frames lost, each way; 100 uploads", 100, lose=0.05),
    Way("15 % of the frames lost, each way; 100 uploads", 100, lose=0.15),
    Way("15 % lost, round trip 0.5 s; 100 uploads", 100, round_trip_s=0.5, lose=0.15),
)


@dataclass(frozen=True)
class Cost:
    """Of some uploads: how many finished; of those the most bytes in proportion, the mean, the most seconds."""

    finished: int
    proportion: float
    mean: float
    seconds: float
    slow_baud: int | None


def cost(scan: PreparedScan, way: Way) -> Cost:
    """Uploads over lines of this kind."""
    image = scan.image("table")
    proportions, seconds, slow = [], [], None
    for seed in range(way.uploads):
        device = model(info_for(scan))
        half_s = way.round_trip_s / 2.0
        line = Line(
            device,
            baud=way.baud,
            told_baud=_BAUD,
            out_s=half_s,
            back_s=half_s,
            tick_hz=_TICK_HZ,
            chances=Chances(lose=way.lose),
            seed=seed,
        )
        try:
            with Device(line.open, random=Random(seed), sleep=line.sleep) as client:
                slow = client.upload(image).slow_baud
        except LinkError as error:
            print(f"{way.name}, upload {seed}: {error}", file=sys.stderr)
            continue
        proportions.append(line.sent / len(image.data))
        seconds.append(line.now_s)
    count = len(proportions)
    return Cost(count, max(proportions), sum(proportions) / count, max(seconds), slow)


def table() -> str:
    """What the page has."""
    scan = PreparedScan.of_plan(make_plan(load(EXAMPLE)))
    text = "| way | finished | bytes sent / bytes of the image | s | said |\n|---|---|---|---|---|\n"
    text += "".join(row(way, cost(scan, way)) for way in WAYS)
    return text + _NOTE.format(size=len(scan.image("table").data))


def row(way: Way, found: Cost) -> str:
    """A line of the table."""
    mean = f" (mean {found.mean:.2f})" if way.uploads > 1 else ""
    said = f"answers come at about {found.slow_baud} baud" if found.slow_baud else ""
    sent = f"{found.proportion:.2f}{mean}"
    return f"| {way.name} | {found.finished} of {way.uploads} | {sent} | {found.seconds:.1f} | {said} |\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    write = parser.parse_args().write
    text = table()
    print(text)
    if write:
        page = PAGE.read_text("utf-8")
        marked = re.compile(r"(?<=<!-- slow -->\n).*(?=<!-- /slow -->)", flags=re.DOTALL)
        PAGE.write_text(marked.sub(lambda _: text, page, count=1), "utf-8")


if __name__ == "__main__":
    main()
