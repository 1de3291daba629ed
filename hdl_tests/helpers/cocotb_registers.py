"""Accesses to bus_bench.v by a master of its bus, each answer held against ``bus_model``."""

import os
from collections.abc import Iterable
from pathlib import Path
from random import Random
from typing import Any

import cocotb
import numpy as np
from bus_masters import Axi, Master, Wishbone, interrupted
from bus_model import ADDRESSES, CAN_KEEP, MAP, PART_BITS, SEQUENCER, SHAPE, BusModel, upload
from cocotb.simtime import get_sim_time
from cocotb.triggers import ClockCycles, RisingEdge
from cocotbext.axi import AxiLiteBus, AxiLiteMaster
from cocotbext.axi.axil_channels import AxiLiteARTransaction, AxiLiteAWTransaction, AxiLiteWTransaction
from pixel_scripts import with_table
from programs import random_dual, random_fourier, random_program, rendered
from replacing import replace
from slow_scripts import least_ticks, random_scan, slow_pace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.device.registers import program_words
from tablegen.device.sequencer import can_keep
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.synthesis import FourierWords

CLOCK_NS = 10
NOWHERE = 0x40
RUNNING = 1 << 4  # of the status
AMOUNT = float(os.environ.get("BUS_AMOUNT", "1"))


class Rig:
    """A bench, its master and the model of what is behind it."""

    def __init__(self, dut: Any, master: Master) -> None:
        self.dut, self.master, self.random, self.model = dut, master, Random(1), BusModel(SHAPE)
        self.programs = np.random.default_rng(1)

    async def start(self) -> None:
        self.dut.reset.value = 1
        await ClockCycles(self.dut.clock, 4)
        self.dut.reset.value = 0
        await ClockCycles(self.dut.clock, 4)

    async def read(self, address: int) -> None:
        value, expected = await self.master.access(False, address), self.model.read(address)
        known = self.model.known(address)
        same = value == expected if value is None or expected is None else value & known == expected & known
        assert same, f"read of {address:#x}: {value}, not {expected}"

    async def write(self, address: int, data: int, strobes: int = 15) -> None:
        answer = await self.master.access(True, address, data, strobes)
        expected = self.model.write(address, data, strobes)
        assert (answer is not None) == expected, f"write of {data:#x} to {address:#x}, {strobes:04b}: {answer}"

    async def read_all(self) -> None:
        for register in MAP.registers:
            await self.read(register.address)
        assert int(self.dut.irq.value) == self.model.interrupt

    async def tick(self) -> None:
        self.dut.tick.value = 1
        await RisingEdge(self.dut.clock)
        self.dut.tick.value = 0
        await RisingEdge(self.dut.strobe)
        await ClockCycles(self.dut.clock, 3)
        self.model.tick()

    async def underrun(self) -> None:
        self.dut.underrun.value = 1
        await RisingEdge(self.dut.clock)
        self.dut.underrun.value = 0
        await ClockCycles(self.dut.clock, 3)
        self.model.underrun()

    async def reset(self, clocks: int) -> None:
        self.dut.reset.value = 1
        await ClockCycles(self.dut.clock, clocks)
        self.master.drop()
        self.dut.reset.value = 0
        self.model.reset()

    async def upload(self) -> None:
        """A whole program in any order, behind a withdrawal of what was there."""
        await self.write(ADDRESSES["command"], 2)
        program = random_dual(self.programs, SEQUENCER, kind=self.random.choice(("wild", "smooth", "held")))
        words = upload(program)
        self.random.shuffle(words)
        for address, word in words:
            await self.write(address, word)
        self.model.ready = program

    def happened(self) -> None:
        """All that the host port and the converters have seen, so far."""
        assert Path("host.txt").read_text("ascii").splitlines() == self.model.host
        assert Path("ticks.txt").read_text("ascii").splitlines() == self.model.ticks
        assert Path("rules.txt").read_text("ascii") == ""


def edges() -> list[int]:
    """Addresses around everything that the map has, and such that a cut would make of them."""
    ends = [one.address for one in MAP.registers] if AMOUNT == 1 else [ADDRESSES["interrupt_enable"]]
    for memory in MAP.memories:
        ends += [memory.address, memory.address + 4 * SHAPE.lengths[memory.name], memory.address + 4 * memory.words]
    near = {end + step for end in ends for step in (-4, -1, 0, 1, 2, 3, 4)} - {-4, -1}
    far = {end | 1 << bit for end in ends for bit in (18, 19, 20, 21, 25, 31)}
    return sorted(near | far | set(range(0, 0x60) if AMOUNT == 1 else ()))


async def sweep(rig: Rig) -> None:
    """Every address of them is read, and written with words that a register takes and that it does not."""
    for address in edges():
        if address % 4 and not rig.master.unaligned:
            continue
        await rig.read(address)
        await rig.write(address, rig.random.choice((0, rig.random.getrandbits(32))), 15)
        await rig.write(address, rig.random.getrandbits(10) & 0b1100011110, rig.random.randrange(16))
    await rig.read_all()


async def traffic(rig: Rig, count: int) -> None:
    """Random accesses, ticks and missed samples in any order."""
    names = list(ADDRESSES)
    for _ in range(count):
        kind, model = rig.random.random(), rig.model
        if kind < 0.30:
            await rig.tick()
        elif kind < 0.34:
            await rig.underrun()
        elif kind < 0.38:
            await rig.upload()
        elif kind < 0.52:
            command = 1 if rig.random.random() < 0.5 else rig.random.getrandbits(5)
            command |= rig.random.choice((0, 0, 1, 1, 2, 3)) << 8
            if not command & 1 or model.may_commit:
                await rig.write(ADDRESSES["command"], command)
                await rig.read(ADDRESSES["status"])
        elif kind < 0.62:
            await rig.write(ADDRESSES["arm"], rig.random.choice((0, 1, 2, 1 << 16, 65535)))
            await rig.write(ADDRESSES["command"], rig.random.choice((0, 4)))
        elif kind < 0.72:
            name = rig.random.choice(("interrupt_pending", "interrupt_enable"))
            await rig.write(ADDRESSES[name], rig.random.getrandbits(rig.random.choice((5, 5, 6))))
        elif kind < 0.80:
            address = ADDRESSES[rig.random.choice(names)] + 4 * rig.random.randrange(40)
            strobes = rig.random.choice((15, 15, rig.random.getrandbits(4)))
            if address != ADDRESSES["command"]:
                await rig.write(address, rig.random.getrandbits(32), strobes)
        else:
            await rig.read(ADDRESSES[rig.random.choice(names)])
        assert int(rig.dut.irq.value) == model.interrupt
        if rig.random.random() < 0.05:
            await rig.read_all()
    await rig.read_all()


async def late(rig: Rig) -> None:
    """While a program waits to be taken, a word and another commit fail, and no other bit of that command acts."""
    await rig.upload()
    await rig.write(ADDRESSES["command"], 1)
    for name, data in (("command", 1), ("command", 0b11011), ("program", 0), ("y_table", 0), ("pixel_ticks", 1)):
        await rig.write(ADDRESSES[name], data)
        await rig.read(ADDRESSES["status"])
    await rig.write(ADDRESSES["command"], 2)


async def burst(rig: Rig) -> None:
    """AXI: more accesses at once than are kept, each channel at its own pace; every answer is that of its access."""
    master = rig.master
    assert isinstance(master, Axi)
    await rig.write(ADDRESSES["command"], 2)
    writes, reads = [], []
    for at in range(round(150 * AMOUNT)):
        writes.append((ADDRESSES["program"] + 4 * rig.random.randrange(60), rig.random.getrandbits(32), at))
        reads.append(rig.random.choice((0, 4, 8, 12, 16, 1, 0x400, NOWHERE)))
    for address, data, _ in writes:
        master.aw.send_nowait(AxiLiteAWTransaction(awaddr=address, awprot=0))
        master.w.send_nowait(AxiLiteWTransaction(wdata=data, wstrb=15))
    for address in reads:
        master.ar.send_nowait(AxiLiteARTransaction(araddr=address, arprot=0))
    for address, data, _ in writes:
        assert (await master.write_response() is not None) == rig.model.write(address, data)
    for address in reads:
        assert await master.read_response() == rig.model.read(address)
    await rig.read_all()


async def pace(rig: Rig) -> None:
    """Without pauses a cycle of Wishbone takes 3 clocks, a write of AXI 4; docs/registers.md says so."""
    clock, master, count = rig.dut.clock, rig.master, 10
    address = ADDRESSES["interrupt_enable"]
    master.pause(0)
    await ClockCycles(clock, 4)
    if isinstance(master, Axi):
        for _ in range(count + 1):
            master.aw.send_nowait(AxiLiteAWTransaction(awaddr=address, awprot=0))
            master.w.send_nowait(AxiLiteWTransaction(wdata=0, wstrb=15))
        await master.write_response()
    else:
        await master.access(True, address, 0)
    start = get_sim_time("ns")
    for _ in range(count):
        if isinstance(master, Axi):
            assert await master.write_response() == 0
        else:
            assert await master.access(True, address, 0) == 0
    assert (get_sim_time("ns") - start) / CLOCK_NS == count * (4 if isinstance(master, Axi) else 3)
    rig.model.enabled = 0


async def directions(rig: Rig) -> None:
    """AXI: a response that waits does not hold the other direction."""
    master = rig.master
    assert isinstance(master, Axi)
    master.pause(0)
    await rig.write(ADDRESSES["interrupt_enable"], 0)
    for held, write in ((master.r, True), (master.b, False)):
        held.pause = True
        await ClockCycles(rig.dut.clock, 2)
        waiting = cocotb.start_soon(master.access(not write, ADDRESSES["interrupt_enable"], 0))
        await ClockCycles(rig.dut.clock, 10)
        for _ in range(3):
            assert await master.access(write, ADDRESSES["interrupt_enable"], 0) == 0
        assert not waiting.done()
        held.pause = False
        assert await waiting == 0
    master.pause(0.3)


async def ended(rig: Rig, *, reset: bool) -> None:
    """An access that is ended on each of its clocks: it has happened, or it has not, and the next one is answered."""
    word = ADDRESSES["program"] + 4 * 47
    rig.master.pause(0)
    await rig.write(ADDRESSES["command"], 2)
    begun = ((False, ADDRESSES["identity"]), (False, NOWHERE), (True, word), (True, ADDRESSES["arm"]))
    for clocks in range(1, 12) if AMOUNT == 1 else (1, 2, 3, 4, 5):
        for write, address in begun:
            await rig.write(ADDRESSES["interrupt_enable"], 3)
            await interrupted(rig.master, clocks, write, address, clocks)
            if reset:
                await rig.reset(rig.random.choice((1, 2, 3)))
            else:
                rig.master.drop()
                await ClockCycles(rig.dut.clock, rig.random.choice((1, 1, 2, 12)))
            await rig.read(ADDRESSES["version"])
            await ClockCycles(rig.dut.clock, 12)
            if len(Path("host.txt").read_text("ascii").splitlines()) > len(rig.model.host):
                assert rig.model.write(address, clocks)
            for name in ("status", "interrupt_enable", "interrupt_pending"):
                await rig.read(ADDRESSES[name])
    rig.happened()
    rig.master.pause(0.3)


async def same_clock(rig: Rig) -> None:
    """Wishbone: an event on the clock that clears it is kept, one on the clock before is not."""
    rig.master.pause(0)
    await rig.write(ADDRESSES["command"], 0b10010)
    for early in (1, 0):
        await rig.tick()
        await rig.write(ADDRESSES["interrupt_pending"], 0b11111)
        rig.dut.underrun.value = 1
        if early:
            await RisingEdge(rig.dut.clock)
            rig.dut.underrun.value = 0
        access = cocotb.start_soon(rig.master.access(True, ADDRESSES["interrupt_pending"], 0b11111))
        await RisingEdge(rig.dut.clock)
        rig.dut.underrun.value = 0
        assert await access == 0
        rig.model.underrun()
        if early:
            rig.model.pending = 0
        await rig.read_all()
        await rig.write(ADDRESSES["command"], 0b10000)


@cocotb.test(timeout_time=3, timeout_unit="ms")
async def accesses(dut: Any) -> None:
    """All kinds of accesses, one after the other, on the same device."""
    kind = Wishbone if os.environ["BUS"] == "wishbone" else Axi
    rig = Rig(dut, kind(dut, 2, 0.3))
    await rig.start()
    await rig.read_all()
    await sweep(rig)
    if isinstance(rig.master, Axi):
        await burst(rig)
        await directions(rig)
    else:
        await ended(rig, reset=False)
        await same_clock(rig)
    await pace(rig)
    await ended(rig, reset=True)
    await late(rig)
    await traffic(rig, round(300 * AMOUNT))
    rig.master.pause(0)
    await traffic(rig, round(100 * AMOUNT))
    rig.happened()


class Host:
    """What a driver does with words, by the master of cocotbext-axi or by that of Wishbone."""

    def __init__(self, dut: Any) -> None:
        self.axi = None
        if os.environ["BUS"] != "wishbone":
            self.axi = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axi"), dut.clock, dut.reset)
        self.wishbone = Wishbone(dut, 2, 0)

    async def write(self, name: str, words: Iterable[int], first: int = 0) -> None:
        data, address = [int(word) & 0xFFFFFFFF for word in words], ADDRESSES[name] + 4 * first
        if self.axi is not None:
            answer = await self.axi.write(address, b"".join(word.to_bytes(4, "little") for word in data))
            assert int(answer.resp) == 0
            return
        for at, word in enumerate(data):
            assert await self.wishbone.access(True, address + 4 * at, word) == 0

    async def status(self) -> int:
        if self.axi is not None:
            return int.from_bytes((await self.axi.read(ADDRESSES["status"], 4)).data, "little")
        value = await self.wishbone.access(False, ADDRESSES["status"])
        assert value is not None
        return value

    async def upload(
        self,
        program: ScanProgram,
        words: tuple[FourierWords, FourierWords] | None = None,
        mode: CommitMode = CommitMode.LINE,
        waits: bool = True,
    ) -> None:
        """Write a program with its tables, or its Fourier words, and wait until it is committed, or not."""
        harmonics = (0, 0)
        if isinstance(program.x, FrameProgram):
            await self._write_parts(program)
        elif words is None:
            await self.write("x_table", program.x.words)
            await self.write("y_table", program.y.words)
        else:
            harmonics = words[0].harmonics, words[1].harmonics
            for name, own in zip(("x_fourier", "y_fourier"), words, strict=True):
                await self.write(name, [own.a0, *own.a, *own.b])
        if program.schedule.pixel_table is not None:
            await self.write("pixel_ticks", [ticks for window in program.schedule.pixel_table for ticks in window])
        await self.write("program", program_words(program.schedule, program.x, program.y, harmonics))
        await self.write("command", [1 | mode << 8])
        for _ in range(10_000 if waits else 0):
            status = await self.status()
            assert not status & 4, "the commit was refused"
            if status & 2:
                return
        assert not waits, "the program was never committed"

    async def _write_parts(self, program: ScanProgram) -> None:
        """Write the tables and the slow parts of a program."""
        for name, axis in (("x", program.x), ("y", program.y)):
            assert isinstance(axis, FrameProgram)
            await self.write(f"{name}_table", axis.fast.words)
            for part, words in enumerate((axis.second, axis.slow.words, axis.gains.words, axis.ratios.words)):
                await self.write(f"{name}_slow", words, part << PART_BITS)


@cocotb.test(timeout_time=3, timeout_unit="ms")
async def uploads(dut: Any) -> None:
    """A program plays while the next one is uploaded: as tables, as Fourier words, and as tables again."""
    host = Host(dut)
    rig = Rig(dut, host.wishbone)
    await rig.start()
    sequencer = rig.model.sequencer
    for number, fourier in enumerate((False, True, False)):
        program, words = random_dual(rig.programs, SEQUENCER, kind="smooth"), None
        if fourier:
            words = random_fourier(rig.programs, SHAPE.harmonics), random_fourier(rig.programs, SHAPE.harmonics - 1)
            program = replace(program, x=rendered(program.x, words[0]), y=rendered(program.y, words[1]))
        await host.upload(program, words)
        sequencer.commit(program)
        await rig.tick()
        if number == 0:
            await host.write("arm", [0])
            sequencer.arm(0)
            await host.write("command", [4])
            assert sequencer.trigger()
        while sequencer.idle is not None:
            await rig.tick()
        for _ in range(2 * program.schedule.ticks):
            await rig.tick()
    ticks = Path("ticks.txt").read_text("ascii").splitlines()
    assert ticks == rig.model.ticks
    markers = [line.split()[2] for line in ticks]
    assert sum(marks[5] == "1" for marks in markers) == 3, "every program was taken"
    assert sum(marks[0] == "1" for marks in markers) >= 6, "two lines of each"
    assert Path("rules.txt").read_text("ascii") == ""


async def start_scan(host: Host, rig: Rig, program: ScanProgram) -> None:
    """Upload the first program, and start the scan."""
    await host.upload(program)
    rig.model.sequencer.commit(program)
    await rig.tick()
    await host.write("arm", [0])
    rig.model.sequencer.arm(0)
    await host.write("command", [4])
    assert rig.model.sequencer.trigger()
    while not await host.status() & RUNNING:  # a trigger waits for the first line of a slow part
        pass


def happened_in_order() -> list[str]:
    """The markers of every tick; no rule of the bus was broken."""
    assert Path("rules.txt").read_text("ascii") == ""
    return [line.split()[2] for line in Path("ticks.txt").read_text("ascii").splitlines()]


@cocotb.test(timeout_time=6, timeout_unit="ms")
async def moves(dut: Any) -> None:
    """A commit takes its mode over the bus: the frame goes on, or begins again, or the program waits for the next."""
    host = Host(dut)
    rig = Rig(dut, host.wishbone)
    await rig.start()
    sequencer = rig.model.sequencer
    program = random_dual(rig.programs, SEQUENCER, (12, 20), kind="smooth", lines=(4, 5))
    await start_scan(host, rig, program)
    schedules = 0
    for mode in (CommitMode.KEEP, CommitMode.LINE, CommitMode.FRAME, CommitMode.KEEP, CommitMode.KEEP):
        schedule = with_table(rig.programs, program.schedule)
        schedules += schedule.pixel_table is not None
        other = random_program(rig.programs, SEQUENCER, "x", program.schedule, "smooth")
        program = replace(program, x=other, schedule=schedule)
        for _ in range(rig.random.randrange(1, 2 * program.schedule.ticks)):
            await rig.tick()
        await host.upload(program, mode=mode)
        sequencer.commit(program, mode)
        assert sequencer.playing is not None
        assert bool(await host.status() & CAN_KEEP) == can_keep(sequencer.playing, program)
        while sequencer.idle is not None:
            await rig.tick()
    for _ in range(2 * program.schedule.frame_ticks):
        await rig.tick()
    assert Path("ticks.txt").read_text("ascii").splitlines() == rig.model.ticks
    markers = happened_in_order()
    swaps = [at for at, marks in enumerate(markers) if marks[5] == "1"]
    begins = [markers[at][1] == "1" for at in swaps[1:]]
    assert begins[0] is False, "the frame went on"
    assert begins[1:3] == [True, True]
    assert schedules >= 2, "pixels with tables were among them"


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def slow_parts(dut: Any) -> None:
    """Programs with a slow part on both axes, shaped in any order, are uploaded while one of them plays.

    A commit keeps the frame, or not.
    """
    host = Host(dut)
    rig = Rig(dut, host.wishbone)
    await rig.start()
    sequencer, random = rig.model.sequencer, rig.programs
    ticks = least_ticks(SEQUENCER, slow_pace(SEQUENCER)) + 4

    async def play(count: int) -> None:
        for _ in range(count):
            while int(dut.busy.value):
                await RisingEdge(dut.clock)
            await rig.tick()

    program = random_scan(random, SEQUENCER, ticks, 3, "smooth", shaping=3)
    await start_scan(host, rig, program)
    await play(ticks // 2)
    for mode in (CommitMode.KEEP, CommitMode.LINE):
        program = random_scan(random, SEQUENCER, ticks, 3, "smooth", shaping=3)
        await play(rig.random.randrange(1, ticks))
        await host.upload(program, mode=mode, waits=False)
        # The line after the next one is its first.
        await play((ticks - sequencer.tick) % ticks + 1)
        sequencer.commit(program, mode)
        while sequencer.idle is not None:
            await play(1)
    await play(2 * ticks)
    assert Path("ticks.txt").read_text("ascii").splitlines() == rig.model.ticks
    markers = happened_in_order()
    swaps = [at for at, marks in enumerate(markers) if marks[5] == "1"]
    assert [markers[at][1] == "1" for at in swaps[1:]] == [False, True]
