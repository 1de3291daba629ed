"""The timing diagrams of buses, synchronisers and marker delays are those of a simulation.

Run as a program it draws them into docs/registers.md, docs/verilog.md and docs/pixels.md.
"""

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from building import BENCHES, REPOSITORY, tool

from tablegen.base.resources import resource_folder

BEGIN, END = "<!-- simulated ports -->\n", "<!-- /simulated ports -->\n"
ASKED = ("axi write", "axi read", "wb write", "wb read", "ready", "in", "marker")  # bits 52 and up
SEEN = (
    "awvalid", "awready", "wvalid", "wready", "bvalid", "bresp[1]", "arvalid", "arready", "rvalid", "rresp[1]",
    "axi host write", "axi commit", "axi trigger", "stb", "we", "ack", "err", "wb host write", "wb commit", "PULSE 0",
    "PULSE 1", "PULSE 2", "delay 7", "delay 1", "delay 0",
)  # fmt: skip
X_TABLE, COMMAND, STATUS, NOWHERE = 0x40000, 0x2C, 0x14, 0x3F0
COMMIT, TRIGGER = 1, 4
Clock = dict[str, int]
Names = dict[str, str]  # of rows: as they are seen, and as the page calls them


def axi() -> list[Clock]:
    """A word of a table, the commit, a read of the status that its master keeps waiting, and one that fails."""
    asked: list[Clock] = [{"ready": 1} for _ in range(40)]
    asked[2] |= {"axi write": 1, "address": X_TABLE, "data": 5}
    asked[8] |= {"axi write": 1, "address": COMMAND, "data": COMMIT}
    asked[20] |= {"axi read": 1, "address": STATUS}
    for clock in range(20, 28):
        asked[clock]["ready"] = 0
    asked[32] |= {"axi read": 1, "address": NOWHERE}
    return asked


def wishbone() -> list[Clock]:
    """A word of a table, the commit, a read of the status, and one that fails."""
    asked: list[Clock] = [{} for _ in range(32)]
    asked[2] = {"wb write": 1, "address": X_TABLE, "data": 5}
    asked[8] = {"wb write": 1, "address": COMMAND, "data": COMMIT}
    asked[20] = {"wb read": 1, "address": STATUS}
    asked[26] = {"wb read": 1, "address": NOWHERE}
    return asked


def pin() -> list[Clock]:
    """A long pulse and one of two clocks."""
    asked: list[Clock] = [{} for _ in range(24)]
    for clock in (*range(3, 11), 16, 17):
        asked[clock] = {"in": 1}
    return asked


def markers() -> list[Clock]:
    """Pulses that are closer together than the delay."""
    asked: list[Clock] = [{} for _ in range(24)]
    for clock in (2, 5, 8, 9, 10):
        asked[clock] = {"marker": 1}
    return asked


OF_AXI = {name: f"s_axi_{name}" for name in SEEN[:6]} | {"ready": "s_axi_[br]ready"}
OF_AXI |= {name: f"s_axi_{name}" for name in SEEN[6:10]} | {"axi host write": "write", "axi commit": "commit"}
OF_WISHBONE = {"stb": "wb_cyc_i, stb_i", "we": "wb_we_i", "ack": "wb_ack_o", "err": "wb_err_o"}
OF_WISHBONE |= {"wb host write": "write", "wb commit": "commit"}
DIAGRAMS: dict[str, list[tuple[str, Callable[[], list[Clock]], Names]]] = {
    "registers.md": [
        (
            "AXI4-Lite: a word of the table of x, `commit`, a slow read of `status`, and one where no register is",
            axi,
            OF_AXI,
        ),
        ("Wishbone: the same accesses", wishbone, OF_WISHBONE),
    ],
    "verilog.md": [
        (
            "`dac_synchronise` with `STAGES = 2`, of a pulse of 8 clocks and one of 2",
            pin,
            {name: name for name in ("in", "PULSE 0", "PULSE 1", "PULSE 2")},
        )
    ],
    "pixels.md": [
        (
            "`dac_marker_delay`, of pulses that are closer together than the longest delay",
            markers,
            {"marker": "in"} | {name: name for name in ("delay 0", "delay 1", "delay 7")},
        )
    ],
}


def simulate(asked: list[Clock], folder: Path) -> dict[str, str]:
    """Every signal on every clock, 0 and 1."""
    words = [
        sum(clock.get(name, 0) << 52 + bit for bit, name in enumerate(ASKED))
        | clock.get("address", 0) << 32
        | clock.get("data", 0)
        for clock in asked
    ]
    (folder / "stimulus.hex").write_text("".join(f"{word:x}\n" for word in words), "ascii")
    modules, out = resource_folder("firmware_templates") / "verilog", folder / "timing.vvp"
    sources = [path for name in ("bus", "cdc") for path in sorted((modules / name).glob("*.v"))]
    sources += [BENCHES / "port_timing_bench.v", modules / "adc" / "dac_marker_delay.v"]
    depth = f"-Pport_timing_bench.DEPTH={len(words)}"
    command = [tool("iverilog"), "-g2005", "-s", "port_timing_bench", depth, f"-I{modules / 'bus'}", "-o", out]
    subprocess.run([*command, *sources], check=True)
    shown = subprocess.run([tool("vvp"), "-n", out], cwd=folder, capture_output=True, text=True, check=True)
    lines = shown.stdout.split()
    seen = {name: "".join(line[bit] for line in lines) for bit, name in enumerate(SEEN)}
    return seen | {name: "".join(str(clock.get(name, 0)) for clock in asked) for name in ASKED}


def drawn(page: str, folder: Path) -> str:
    """The diagrams of a page: a column a clock, # where a signal is high."""
    text = "A column is a clock of a simulated run, `#` is high.\n"
    for title, asked, names in DIAGRAMS[page]:
        signals = simulate(asked(), folder)
        width = max(map(len, names.values())) + 2
        rows = [
            f"    {shown:{width}}{signals[name].replace('0', '_').replace('1', '#')}" for name, shown in names.items()
        ]
        text += f"\n{title}:\n\n" + "\n".join(rows) + "\n"
    return text + "\n"


def test_the_pages_show_what_is_simulated(tmp_path: Path) -> None:
    for page in DIAGRAMS:
        text = (REPOSITORY / "docs" / page).read_text("utf-8")
        assert text.partition(BEGIN)[2].partition(END)[0].strip() == drawn(page, tmp_path).strip(), page


def highs(signal: str) -> list[int]:
    return [clock for clock, level in enumerate(signal) if level == "1"]


def test_the_diagrams_show_what_they_say(tmp_path: Path) -> None:
    """Times that the pages give: of accesses, of errors, of synchronisers and of delays."""
    bus = simulate(axi(), tmp_path)
    assert len(highs(bus["axi host write"])) == len(highs(bus["axi commit"])) == 1
    assert [highs(bus["bvalid"])[0] - 2, highs(bus["bvalid"])[1] - 8] == [4, 4 + 6]  # `command` takes 6 more
    assert highs(bus["rvalid"]) == [24, 25, 26, 27, 28, 36]  # the first one until its master is ready
    assert [bus["rresp[1]"][clock] for clock in (28, 36)] == ["0", "1"]
    assert "1" not in bus["bresp[1]"] + bus["axi trigger"]
    cycles = simulate(wishbone(), tmp_path)
    assert (highs(cycles["ack"]), highs(cycles["err"])) == ([2 + 2, 8 + 2 + 6, 20 + 2], [26 + 2])
    assert len(highs(cycles["wb host write"])) == len(highs(cycles["wb commit"])) == 1
    crossed = simulate(pin(), tmp_path)
    assert len(highs(crossed["PULSE 1"])) == 2
    assert len(highs(crossed["PULSE 2"])) == 4
    assert crossed["PULSE 0"][2:] == crossed["in"][:-2]
    delayed = simulate(markers(), tmp_path)
    for clocks in (0, 1, 7):
        assert delayed[f"delay {clocks}"] == ("0" * clocks + delayed["marker"])[: len(delayed["marker"])]


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        for page in DIAGRAMS:
            path = REPOSITORY / "docs" / page
            before, _, rest = path.read_text("utf-8").partition(BEGIN)
            path.write_text(before + BEGIN + drawn(page, Path(folder)) + END + rest.partition(END)[2], "utf-8")


if __name__ == "__main__":
    sys.exit(main())
