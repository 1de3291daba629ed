"""The cocotb side of ``scanner_bench.v``."""

from typing import Any

import cocotb
from cocotb.triggers import RisingEdge


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def scan(dut: Any) -> None:
    """Boot and play; a scan that does not begin in time fails here."""
    await RisingEdge(dut.finished)
    assert not dut.fault.value, "a fault"
