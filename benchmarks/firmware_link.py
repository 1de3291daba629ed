"""What the C link takes on Cortex-M: instructions, code, memory, stack, as a table for docs/instructions.md.

``python benchmarks/firmware_link.py`` prints the table, ``--write`` puts it into the page. Whole uploads of the shipped
example are counted in emulation, call by call. Instructions are not cycles.
"""

import argparse
import hashlib
import re
import struct
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tablegen.base.resources import c_link, c_runtime
from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.emit.render import render
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import ANSWER, DATA_BYTES, TAG_BYTES, VERSION, Request
from tablegen.link.program_image import ProgramImage, make_image
from tablegen.planning.line_plan import make_plan
from tablegen.verification.c.emulate import CORES, Processor, compile_bare

HERE = Path(__file__).parent
EXAMPLE = HERE.parent / "examples" / "annexin_200nm.toml"
MEMORY = HERE.parent / "examples" / "firmware" / "memory.c"
PAGE = HERE.parent / "docs" / "instructions.md"
CASES = [("cortex-m0plus", "-O2"), ("cortex-m3", "-O2"), ("cortex-m4", "-O2"), ("cortex-m4", "-Os")]
KEY = bytes([7]) + bytes(31)


@dataclass(frozen=True)
class Upload:
    """Instructions of one, call by call of ``dac_link_work``."""

    frames: int  # of the longest call up to COMMIT
    checks: int  # of the longest call from COMMIT on
    all_checks: int
    stack: int


@dataclass(frozen=True)
class Counts:
    """Of a processor and an optimisation; instructions, and bytes."""

    receive: int
    idle: int
    table: Upload
    keyed: Upload
    fourier: Upload
    code: int
    state: int


class Device:
    """The link in emulation."""

    def __init__(self, core: str, optimisation: str, folder: Path) -> None:
        self.plan = make_plan(load(EXAMPLE))
        for name, content in render(self.plan, certify(self.plan)).items():
            (folder / name).write_bytes(content)
        name = self.plan.name
        sources = [*c_runtime(), *c_link(), HERE / "firmware_link_count.c", MEMORY]
        sources += [folder / f"{name}.c", folder / f"{name}.h"]
        self.processor = Processor(
            compile_bare(folder / "link.elf", sources, core, None, ("-std=c99", optimisation)), core
        )
        self.stack = 0

    def say(self, frame: Frame) -> tuple[list[int], list[Frame]]:
        """Instructions of each call until there is nothing to do, and what is answered."""
        wire = frame.encode()
        self.processor.write("incoming", wire)
        self.processor.write("incoming_bytes", struct.pack("<I", len(wire)))
        self.processor.call("link_feed")
        return self.work()

    def work(self) -> tuple[list[int], list[Frame]]:
        """The main loop until it has nothing to do."""
        counts, answers, reader = [], [], FrameReader()
        while True:
            called = self.processor.call("link_work")
            counts.append(called.instructions)
            self.stack = max(self.stack, called.stack)
            self.processor.call("link_drain")
            sent = self.processor.word("outgoing_bytes")
            answers += reader.feed(self.processor.read("outgoing", sent)) if sent else []
            if not called.result and not sent:
                return counts, answers


def _requests(image: ProgramImage) -> Iterator[Frame]:
    yield Frame(Request.HELLO, 0, 1, bytes([VERSION]))
    yield Frame(Request.BEGIN, 0, 1, image.info.pack())
    for at in range(0, len(image.data), DATA_BYTES):
        yield Frame(Request.DATA, 0, 1, struct.pack("<I", at) + image.data[at : at + DATA_BYTES])


def upload(device: Device, image: ProgramImage, key: bytes = b"") -> Upload:
    """A whole one, counted."""
    device.processor.call("link_start", int(bool(key)))
    device.stack = 0
    frames = max(max(device.say(request)[0]) for request in _requests(image))
    payload = struct.pack("<I", image.info.image_crc)
    if key:
        _, (challenge,) = device.say(Frame(Request.CHALLENGE, 0, 1))
        message = challenge.payload + struct.pack("<BBI", Request.COMMIT, 1, 1) + payload
        message += hashlib.blake2s(image.data).digest()
        payload += hashlib.blake2s(message, key=key, digest_size=TAG_BYTES).digest()
    counts, answers = device.say(Frame(Request.COMMIT, 1, 1, payload))
    assert answers == []
    device.processor.call("link_tick")
    _, (answer,) = device.work()
    assert answer.type == Request.COMMIT | ANSWER
    return Upload(frames, max(counts), sum(counts), device.stack)


def measure(core: str, optimisation: str, folder: Path) -> Counts:
    """Build the example for a core and count."""
    device = Device(core, optimisation, folder)
    program, digest = device.plan.program, bytes(32).hex()
    table = make_image(program, digest)
    fourier = make_image(program, digest, *(line.fourier.in_order for line in device.plan.lines))
    device.processor.call("link_start", 0)
    receive = device.processor.call("link_receive_one").instructions
    device.work()
    return Counts(
        receive=receive,
        idle=device.processor.call("link_work").instructions,
        table=upload(device, table),
        keyed=upload(device, table, KEY),
        fourier=upload(device, fourier),
        code=_code(core, optimisation, folder),
        state=int.from_bytes(device.processor.read("sizes", 4), "little"),
    )


def _code(core: str, optimisation: str, folder: Path) -> int:
    total = 0
    for source in c_link():
        if source.suffix == ".c":
            target = folder / f"{source.stem}.o"
            options = [*CORES[core].options, "-std=c99", optimisation, "-ffreestanding"]
            _run("arm-none-eabi-gcc", *options, "-c", str(source), "-o", str(target))
            total += int(_run("arm-none-eabi-size", str(target)).splitlines()[1].split()[0])
    return total


def _run(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def table(measured: dict[tuple[str, str], Counts]) -> str:
    """That of the page."""
    text = "| | " + " | ".join(f"{core} `{level}`" for core, level in measured) + " |\n"
    text += "|---|" + "---|" * len(measured) + "\n"
    for what, value in (
        ("`dac_link_receive`, a byte", lambda c: c.receive),
        ("`dac_link_work` with nothing to do", lambda c: c.idle),
        ("the longest call while frames come in", lambda c: max(c.table.frames, c.fourier.frames)),
        ("the longest slice of the checks", lambda c: c.table.checks),
        ("the same with a key", lambda c: c.keyed.checks),
        ("the longest call that renders a table of Fourier words", lambda c: c.fourier.checks),
        ("all checks of two tables", lambda c: c.table.all_checks),
        ("all checks of Fourier words, rendered", lambda c: c.fourier.all_checks),
        ("bytes of code, `dac_link*.c`", lambda c: c.code),
        ("bytes of a `dac_link`", lambda c: c.state),
        ("bytes of stack of `dac_link_work`", lambda c: max(c.table.stack, c.keyed.stack, c.fourier.stack)),
    ):
        text += f"| {what} | " + " | ".join(str(value(counts)) for counts in measured.values()) + " |\n"
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    write = parser.parse_args().write
    with tempfile.TemporaryDirectory() as folder:
        text = table({case: measure(*case, Path(folder)) for case in CASES})
    print(text)
    if write:
        page = PAGE.read_text("utf-8")
        pattern = r"(?<=<!-- link measured -->\n).*(?=<!-- /link measured -->)"
        PAGE.write_text(re.sub(pattern, lambda _: text, page, count=1, flags=re.DOTALL), "utf-8")


if __name__ == "__main__":
    main()
