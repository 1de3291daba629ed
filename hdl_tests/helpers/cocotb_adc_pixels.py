"""Receives the words of pixels with the sink of cocotbext-axi, which pauses at random: frames into received.json."""

import json
import logging
import os
from pathlib import Path

import cocotb
from cocotb.triggers import ClockCycles, RisingEdge
from cocotb_outputs_axi import pauses
from cocotbext.axi import AxiStreamBus, AxiStreamSink


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def receive(dut):
    """Receive until the bench has played its stimulus."""
    sink = AxiStreamSink(AxiStreamBus.from_prefix(dut, "m_axis"), dut.clock)
    sink.log.setLevel(logging.WARNING)  # it has a line for every frame
    sink.set_pause_generator(pauses(float(os.environ["PAUSES"])))
    await RisingEdge(dut.done)
    await ClockCycles(dut.clock, 2)
    frames = []
    while not sink.empty():
        frame = sink.recv_nowait()
        frames.append(list(frame.tdata))
    Path("received.json").write_text(json.dumps(frames), "ascii")
