"""Waits until every bench of the generated top has played its stimulus; they write their captures themselves."""

import cocotb
from cocotb.triggers import RisingEdge


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def play(dut):
    await RisingEdge(dut.all_done)
