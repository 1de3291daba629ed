"""Receives the stream with the sink of cocotbext-axi, which pauses at random, and writes the beats to received.json."""

import json
import logging
import os
import random
from pathlib import Path

import cocotb
from cocotb.triggers import RisingEdge
from cocotbext.axi import AxiStreamBus, AxiStreamSink


def pauses(probability):
    """Runs of pauses and of readiness, of random lengths: short ones, and some that outlast a few strobes."""
    generator = random.Random(1)
    while True:
        paused = generator.random() < probability
        for _ in range(generator.choice((1, 1, 2, 3, 12))):
            yield paused


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def receive(dut):
    sink = AxiStreamSink(AxiStreamBus.from_prefix(dut, "m_axis"), dut.clock)
    sink.log.setLevel(logging.WARNING)  # it has a line for every beat
    probability = float(os.environ["PAUSES"])
    if probability > 0:
        sink.set_pause_generator(pauses(probability))
    await RisingEdge(dut.done)
    beats = []
    while not sink.empty():
        frame = sink.recv_nowait()
        # Without tkeep the sink takes a beat for a frame of bytes, and repeats tuser for each, or gives it once.
        markers = set(frame.tuser) if isinstance(frame.tuser, list) else {frame.tuser}
        beats.append([int.from_bytes(frame.tdata, "little"), *map(int, markers)])
    Path("received.json").write_text(json.dumps(beats), "ascii")
