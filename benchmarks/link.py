"""What an upload takes: shares of the line rate, bytes, and the time until a scan is in force, for docs/upload.md.

``python benchmarks/link.py`` prints the table, ``--write`` puts it into the page. Lines and their latencies are
virtual, the client is the real one, and the instructions of the device are counted in emulation, of the shipped
example.
"""

import argparse
import re
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests" / "helpers"))  # the line and the device are those of the tests

from link_line import Line  # noqa: E402

from tablegen.base.resources import c_link, c_runtime  # noqa: E402
from tablegen.certificate.certificate import certify  # noqa: E402
from tablegen.config.load import load  # noqa: E402
from tablegen.emit.render import render  # noqa: E402
from tablegen.link.device import Device  # noqa: E402
from tablegen.link.frames import Frame, FrameReader  # noqa: E402
from tablegen.link.messages import (  # noqa: E402
    ANSWER,
    DATA_BYTES,
    AxisLimits,
    AxisShape,
    DeviceInfo,
    Feature,
    Request,
)
from tablegen.link.model_device import ModelDevice  # noqa: E402
from tablegen.link.players import LinePlayer  # noqa: E402
from tablegen.link.prepare import PreparedScan  # noqa: E402
from tablegen.link.program_image import ProgramImage  # noqa: E402
from tablegen.planning.line_plan import make_plan  # noqa: E402
from tablegen.verification.c.emulate import Processor, compile_bare  # noqa: E402

EXAMPLE = HERE.parent / "examples" / "annexin_200nm.toml"
MEMORY = HERE.parent / "examples" / "firmware" / "memory.c"
PAGE = HERE.parent / "docs" / "upload.md"
CLOCKS = 1.5  # an instruction, with the wait states of a flash memory
_BITS = 10  # of a byte on the wire
_FILL_TICKS = 256
_PHASES = 25  # of the line in which an upload begins
_NOTE = f"""
`make link` measures this table on the shipped example: the real client on a virtual line, its time from BEGIN until the
scan is active. Instructions are counted in emulation, with {CLOCKS} clocks each. "Active" is the longest time from the
first byte of HELLO, over all places of a line at which an upload can begin. It does not include the computing time of
the host.
"""
_MOST = AxisLimits(0, 65535, 65535, 65535)


@dataclass(frozen=True)
class Part:
    """A processor, its clock, and the ticks of the converters while the link works."""

    name: str
    core: str
    clock_hz: float
    tick_hz: int


PARTS = (
    Part("Cortex-M4 of 168 MHz at 500,000 samples a second", "cortex-m4", 168e6, 500_000),
    Part("Cortex-M3 of 72 MHz at 200,000", "cortex-m3", 72e6, 200_000),
    Part("Cortex-M3 of 50 MHz at 100,000", "cortex-m3", 50e6, 100_000),
)


@dataclass(frozen=True)
class Work:
    """Instructions of a device: for a tick of both axes, a byte of DATA, and from COMMIT until the program waits."""

    tick: float
    byte: float
    most: int  # of one call of dac_link_work()
    commit: int


def example() -> tuple[PreparedScan, PreparedScan]:
    """The example, and the same as another scan."""
    scan = PreparedScan.of_plan(make_plan(load(EXAMPLE)))
    other = replace(scan, digest="5" * 64)
    return scan, other


def count(core: str, image: ProgramImage, folder: Path) -> Work:
    """Upload an image to a bare processor."""
    plan = make_plan(load(EXAMPLE))
    for name, content in render(plan, certify(plan)).items():
        (folder / name).write_bytes(content)
    own = [HERE / "link_count.c", MEMORY, folder / f"{plan.name}.c", folder / f"{plan.name}.h"]
    sources = [*c_runtime(), *c_link(), *own]
    options = ("-std=c99", "-O2")
    machine = Processor(compile_bare(folder / f"{core}.elf", sources, core, None, options), core)
    machine.call("count_start")
    filled = machine.call("count_fill").instructions
    calls: list[int] = []

    def ask(request: Request, payload: bytes) -> int:
        """A request; the instructions until there is nothing to do."""
        wire = Frame(request, 0, 1, payload).encode()
        machine.write("incoming", wire)
        machine.write("incoming_bytes", len(wire).to_bytes(4, "little"))
        taken = machine.call("count_receive").instructions
        while (called := machine.call("count_work")).result:
            calls.append(called.instructions)
            taken += called.instructions
        taken += machine.call("count_transmit").instructions
        sent = machine.read("outgoing")[: machine.word("outgoing_bytes")]
        answers = FrameReader().feed(sent)
        assert [answer.type for answer in answers] == [request | ANSWER][: request != Request.COMMIT], answers
        return taken

    ask(Request.HELLO, b"\1")
    ask(Request.BEGIN, image.info.pack())
    data = sum(
        ask(Request.DATA, at.to_bytes(4, "little") + image.data[at : at + DATA_BYTES])
        for at in range(0, len(image.data), DATA_BYTES)
    )
    committed = ask(Request.COMMIT, image.info.image_crc.to_bytes(4, "little"))
    return Work(filled / _FILL_TICKS, data / len(image.data), max(calls), committed)


def device_s(part: Part, work: Work) -> float:
    """Seconds of the checks and the rendering, in the time that the samples leave."""
    samples = part.tick_hz * work.tick * CLOCKS / part.clock_hz
    return work.commit * CLOCKS / part.clock_hz / (1.0 - samples)


class _Watched(ModelDevice):
    """Tells when the program that was uploaded came into force."""

    def __init__(self, *arguments: object, **more: object) -> None:
        super().__init__(*arguments, **more)  # type: ignore[arg-type]
        self.line: Line
        self.in_force_s = 0.0

    def tick(self, ticks: int = 1) -> None:
        before = self.player.swaps
        super().tick(ticks)
        if self.player.swaps != before:
            self.in_force_s = self.line.now_s


def _line(scan: PreparedScan, baud: int, back_s: float, tick_hz: int, checking: int = 0, window: int = 8) -> Line:
    """The example plays at the far end."""
    shapes = [AxisShape(axis.index_bits, axis.bits, axis.output.dac_bits) for axis in (scan.program.x, scan.program.y)]
    features = Feature.TABLES | Feature.FOURIER | Feature.READBACK
    info = DeviceInfo(1, features, window, DATA_BYTES, 64, 8384, shapes[0], shapes[1], _MOST, _MOST, tick_hz)
    device = _Watched(info, LinePlayer(scan.program), checking=checking)
    device.line = Line(device, baud=baud, back_s=back_s, tick_hz=tick_hz)
    return device.line


@dataclass(frozen=True)
class Rate:
    """Shares of the line rate from BEGIN until in force: of the image alone, and of all that is on the wire."""

    payload: float
    wire: float
    wire_bytes: int


def rate(scan: PreparedScan, image: ProgramImage, baud: int, back_s: float, window: int = 8) -> Rate:
    """An upload over a paced line, to a device that takes so many frames at a time."""
    line = _line(scan, baud, back_s, 500_000, window=window)
    with Device(line.open, random=Random(1), sleep=line.sleep) as client:
        client.arm()
        client.trigger()
        result = client.upload(image, force=True)
    share = _BITS / baud / result.seconds
    return Rate(share * result.bytes, share * result.wire_bytes, result.wire_bytes)


def until_in_force(scan: PreparedScan, image: ProgramImage, part: Part, checks_s: float) -> Iterator[float]:
    """Seconds from the first byte of HELLO at 115200 baud, for uploads that begin at several places of a line."""
    line_s = scan.program.schedule.ticks / part.tick_hz
    for phase in range(_PHASES):
        line = _line(scan, 115200, 0.001, part.tick_hz, checking=round(checks_s * part.tick_hz))
        with Device(line.open, random=Random(1), sleep=line.sleep) as client:
            client.arm()
            client.trigger()
        line.sleep(0.05 + line_s * phase / _PHASES)
        start = line.now_s
        with Device(line.open, random=Random(2), sleep=line.sleep) as client:
            client.upload(image)
        assert isinstance(line.device, _Watched)
        yield line.device.in_force_s - start


def table() -> str:
    """What the page has."""
    scan, other = example()
    tables, words = other.image("table"), other.image("fourier")
    slow, fast = rate(scan, tables, 115200, 0.001), rate(scan, tables, 460800, 0.016)
    small = rate(scan, words, 115200, 0.001)
    rows = [
        ("tables, 115200 baud, 1 ms each way: share of the line rate", f"{slow.payload:.1%}", "92 %"),
        ("the same with all bytes on the wire", f"{slow.wire:.1%}", ""),
        ("tables, 460800 baud, 16 ms from device to host: all bytes on the wire", f"{fast.wire:.1%}", "85 %"),
        ("the same, the program image alone", f"{fast.payload:.1%}", ""),
        ("bytes from the host from BEGIN to COMMIT, tables", f"{slow.wire_bytes}", ""),
        ("the same, Fourier words", f"{small.wire_bytes}", f"{slow.wire_bytes // 8}"),
    ]
    with tempfile.TemporaryDirectory() as folder:
        core = PARTS[0].core
        whole, work = (count(core, image, Path(folder)) for image in (tables, words))
        rows += [
            (f"instructions of a {core}: a byte of DATA", f"{whole.byte:.0f}", ""),
            ("from COMMIT until tables wait for a line", f"{whole.commit}", ""),
            ("from COMMIT until Fourier words do", f"{work.commit}", ""),
            ("the longest `dac_link_work`, but for the rendering", f"{whole.most}", ""),
        ]
        for part in PARTS:
            checks_s = device_s(part, count(part.core, words, Path(folder)))
            latest = 1e3 * max(until_in_force(scan, words, part, checks_s))
            what = f"Fourier words, 115200 baud, {part.name}: active"
            rows.append((f"{what} ({1e3 * checks_s:.0f} ms of it in the device), ms", f"{latest:.0f}", "150"))
    head = "| | measured | asked for |\n|---|---|---|\n"
    return head + "".join(f"| {what} | {value} | {asked} |\n" for what, value, asked in rows) + _NOTE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    write = parser.parse_args().write
    text = table()
    print(text)
    if write:
        page = PAGE.read_text("utf-8")
        marked = re.compile(r"(?<=<!-- measured -->\n).*(?=<!-- /measured -->)", flags=re.DOTALL)
        PAGE.write_text(marked.sub(lambda _: text, page, count=1), "utf-8")


if __name__ == "__main__":
    main()
