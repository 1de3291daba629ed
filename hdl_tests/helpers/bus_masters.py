"""Masters of both buses for cocotb, with the same interface: one access at a time, its answer, and its end before that.

AXI4-Lite is driven by the channels of cocotbext-axi, each with pauses of its own; Wishbone by a model of ours.
"""

import random
from collections.abc import Iterator
from typing import Any

import cocotb
from cocotb.triggers import ClockCycles, RisingEdge, with_timeout
from cocotbext.axi import AxiLiteBus
from cocotbext.axi.axil_channels import (
    AxiLiteARSource,
    AxiLiteARTransaction,
    AxiLiteAWSource,
    AxiLiteAWTransaction,
    AxiLiteBSink,
    AxiLiteRSink,
    AxiLiteWSource,
    AxiLiteWTransaction,
)

PATIENCE = 400  # clocks
PATIENCE_NS = 20_000  # channels that pause may take longer


def pauses(seed: int, probability: float) -> Iterator[bool]:
    """Runs of pauses and of readiness, of random lengths."""
    generator = random.Random(seed)
    while True:
        paused = generator.random() < probability
        for _ in range(generator.choice((1, 1, 2, 3, 9))):
            yield paused


class Axi:
    """A master of AXI4-Lite; ``access`` returns what was read, 0 of a write, and None after SLVERR."""

    unaligned = True

    def __init__(self, dut: Any, seed: int, probability: float) -> None:
        bus = AxiLiteBus.from_prefix(dut, "s_axi")
        self.dut, self.random = dut, random.Random(seed)
        self.aw = AxiLiteAWSource(bus.write.aw, dut.clock, dut.reset)
        self.w = AxiLiteWSource(bus.write.w, dut.clock, dut.reset)
        self.b = AxiLiteBSink(bus.write.b, dut.clock, dut.reset)
        self.ar = AxiLiteARSource(bus.read.ar, dut.clock, dut.reset)
        self.r = AxiLiteRSink(bus.read.r, dut.clock, dut.reset)
        self.pause(probability)

    def pause(self, probability: float) -> None:
        for at, channel in enumerate((self.aw, self.w, self.b, self.ar, self.r)):
            channel.set_pause_generator(pauses(at, probability) if probability else None)
            channel.pause = False

    async def access(self, write: bool, address: int, data: int = 0, strobes: int = 15) -> int | None:
        if not write:
            await self.ar.send(AxiLiteARTransaction(araddr=address, arprot=self.random.randrange(8)))
            return await self.read_response()
        beats = [
            self.aw.send(AxiLiteAWTransaction(awaddr=address, awprot=self.random.randrange(8))),
            self.w.send(AxiLiteWTransaction(wdata=data, wstrb=strobes)),
        ]
        if self.random.random() < 0.5:
            beats.reverse()
        await beats[0]
        if gap := self.random.choice((0, 0, 1, 2, 5)):
            await ClockCycles(self.dut.clock, gap)
        await beats[1]
        return await self.write_response()

    async def read_response(self) -> int | None:
        beat = await with_timeout(self.r.recv(), PATIENCE_NS, "ns")
        assert int(beat.rresp) in (0, 2)
        return int(beat.rdata) if int(beat.rresp) == 0 else None

    async def write_response(self) -> int | None:
        beat = await with_timeout(self.b.recv(), PATIENCE_NS, "ns")
        assert int(beat.bresp) in (0, 2)
        return 0 if int(beat.bresp) == 0 else None

    def drop(self) -> None:
        """Forget all that is under way, in a reset."""
        for channel in (self.aw, self.w, self.b, self.ar, self.r):
            channel.clear()


class Wishbone:
    """A master of classic Wishbone cycles; ``access`` is as that of ``Axi``, None after err."""

    unaligned = False

    def __init__(self, dut: Any, seed: int, probability: float) -> None:
        self.dut, self.random, self.probability = dut, random.Random(seed), probability

    def pause(self, probability: float) -> None:
        self.probability = probability

    async def access(self, write: bool, address: int, data: int = 0, strobes: int = 15) -> int | None:
        dut = self.dut
        if self.random.random() < self.probability:
            # A cycle whose strobe is low, or none.
            dut.wb_stb_i.value = 0
            dut.wb_cyc_i.value = self.random.randrange(2)
            await ClockCycles(dut.clock, self.random.choice((1, 1, 2, 5)))
        dut.wb_cyc_i.value = dut.wb_stb_i.value = 1
        dut.wb_we_i.value = int(write)
        dut.wb_adr_i.value = address >> 2
        dut.wb_sel_i.value = strobes if write else self.random.randrange(16)
        dut.wb_dat_i.value = data if write else self.random.getrandbits(32)
        for _ in range(PATIENCE):
            await RisingEdge(dut.clock)
            if int(dut.wb_ack_o.value) or int(dut.wb_err_o.value):
                break
        else:
            raise AssertionError("the cycle was not terminated")
        failed, value = int(dut.wb_err_o.value), int(dut.wb_dat_o.value)
        self.drop()  # but for the access of the same clock, if there is one
        return None if failed else 0 if write else value

    def drop(self) -> None:
        """End the cycle."""
        self.dut.wb_cyc_i.value = self.dut.wb_stb_i.value = 0


Master = Axi | Wishbone


async def interrupted(master: Master, clocks: int, *access: Any) -> None:
    """Begin an access, and stop it after so many clocks, whether it was answered or not."""
    task = cocotb.start_soon(master.access(*access))
    await ClockCycles(master.dut.clock, clocks)
    task.cancel()
