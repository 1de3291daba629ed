"""The timing diagrams of docs/verilog.md are those of a simulation; run as a program it draws them into the page."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from building import BENCHES, REPOSITORY, tool
from programs import random_dual

from tablegen.base.resources import verilog_runtime
from tablegen.device.registers import program_words
from tablegen.verification.play.sequencer_shape import SequencerShape

PAGE = REPOSITORY / "docs" / "verilog.md"
BEGIN, END = "<!-- simulated -->\n", "<!-- /simulated -->\n"
ASKED = ("write", "tick", "commit", "arm", "trigger", "park", "withdraw", "reset")  # bits 56 and up
SEEN = ("writable", "refused", "committed", "armed", "running", "strobe", "swapped", "playing", "line", "parked")
Clock = dict[str, int]


def taken() -> list[Clock]:
    """A program is committed, taken by the first tick, played from arm and trigger on, and parked."""
    asked: list[Clock] = [{} for _ in range(96)]
    asked[0] = asked[1] = {"write": 1}
    asked[1 + 1] = {"commit": 1}
    for clock in range(6, 96, 8):
        asked[clock] |= {"tick": 1}
    asked[9] = {"arm": 1}
    asked[17] = {"trigger": 1}
    asked[43] = {"park": 1, "trigger": 1, "arm": 1}
    return asked


def refused() -> list[Clock]:
    """A line of 429 ticks in 8 bits: its commit is refused until it is discarded and written again."""
    asked: list[Clock] = [{} for _ in range(30)]
    asked[2] = {"write": 1, "data": 429}
    asked[4] = {"commit": 1}
    asked[9] = {"write": 1, "data": 20}
    asked[11] = {"commit": 1}
    asked[15] = {"withdraw": 1}
    asked[18] = asked[19] = {"write": 1, "data": 20}
    asked[20] = {"commit": 1}
    asked[24] = {"tick": 1}
    return asked


DIAGRAMS = (
    ("A program is written, committed and taken, a scan starts, and a park stops it, whatever comes with it",
     taken, ("write", "commit", "writable", "committed", "tick", "arm", "trigger", "park", "armed", "running",
             "strobe", "swapped", "playing", "line", "parked")),
    ("`write` of a line of 429 ticks where `TICK_BITS` is 8, of 20 ticks, and a whole program after `withdraw`",
     refused, ("write", "commit", "withdraw", "writable", "refused", "committed", "tick")),
)  # fmt: skip


def simulate(asked: list[Clock], folder: Path) -> dict[str, str]:
    """Every signal on every clock, 0 and 1, after a whole program was written."""
    program = random_dual(np.random.default_rng(1), SequencerShape(16, 1, 3, 16, 1, 2, 16), (20, 20), tame=True)
    words = program_words(program.schedule, program.x, program.y)
    written = [1 << 56 | at << 32 | word for at, word in enumerate(words)]
    for region, table in ((1, program.x.words), (2, program.y.words)):
        written += [1 << 56 | region << 48 | at << 32 | int(word) & 0xFFFFFFFF for at, word in enumerate(table)]
    played = [
        sum(clock.get(name, 0) << 56 + bit for bit, name in enumerate(ASKED)) | clock.get("data", words[0])
        for clock in asked
    ]
    (folder / "stimulus.hex").write_text("".join(f"{word:x}\n" for word in [*written, *played]), "ascii")
    out = folder / "timing.vvp"
    sources = [BENCHES / "timing_bench.v", *(path for path in verilog_runtime() if path.name != "program_loader.v")]
    depth = f"-Ptiming_bench.DEPTH={len(written) + len(played)}"
    subprocess.run([tool("iverilog"), "-g2005", "-s", "timing_bench", depth, "-o", out, *sources], check=True)
    shown = subprocess.run([tool("vvp"), "-n", out], cwd=folder, capture_output=True, text=True, check=True)
    lines = shown.stdout.split()[len(written) :]
    seen = {name: "".join(line[bit] for line in lines) for bit, name in enumerate(SEEN)}
    return seen | {name: "".join(str(clock.get(name, 0)) for clock in asked) for name in ASKED}


def drawn(folder: Path) -> str:
    """All diagrams: a column a clock, # where a signal is high."""
    text = "A column is a clock of a simulated run, `#` is high; `LOW_AREA = 0, PLAIN_MULTIPLIER = 0`.\n"
    for title, asked, names in DIAGRAMS:
        signals = simulate(asked(), folder)
        rows = [f"    {name:10}{signals[name].replace('0', '_').replace('1', '#')}" for name in names]
        text += f"\n{title}:\n\n" + "\n".join(rows) + "\n"
    return text + "\n"


def test_the_page_shows_what_is_simulated(tmp_path: Path) -> None:
    assert PAGE.read_text("utf-8").partition(BEGIN)[2].partition(END)[0].strip() == drawn(tmp_path).strip()


def test_the_diagrams_show_what_they_say(tmp_path: Path) -> None:
    """A strobe 36 clocks after its tick, the refused commit, and nothing that plays after the park."""
    played = simulate(taken(), tmp_path)
    ticks = [clock for clock, high in enumerate(played["tick"]) if high == "1"]
    assert [clock for clock, high in enumerate(played["strobe"]) if high == "1"] == [
        tick + 36 for tick in ticks if tick + 36 < len(played["tick"])
    ]
    assert "1" not in played["running"][44:]
    assert "1" in played["playing"]
    stopped = simulate(refused(), tmp_path)
    assert stopped["refused"][6] == "1"
    assert stopped["committed"].index("1") == 23  # a clock later than behind a word of another page


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
        PAGE.write_text(before + BEGIN + drawn(Path(folder)) + END + rest.partition(END)[2], "utf-8")


if __name__ == "__main__":
    sys.exit(main())
