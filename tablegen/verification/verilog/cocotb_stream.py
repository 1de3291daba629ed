"""The cocotb side of ``stream_bench.v``: it waits for the end of the script and passes the bench's counters on."""

import json
import os
from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import RisingEdge, Timer


@cocotb.test(timeout_time=int(os.environ.get("TABLEGEN_TIMEOUT_US", "100000")), timeout_unit="us")  # type: ignore[untyped-decorator]
async def stream(dut: Any) -> None:
    """Play the script to its end; a script that does not end in time fails here."""
    await Timer(1, "ns")  # initial values are there
    if not dut.finished.value:
        await RisingEdge(dut.finished)
    value = dut.fault_counts.value
    counts = int(value) if value.is_resolvable else 0  # unknown bits are in the capture as well
    status = {
        "strobes": int(dut.strobes.value),
        "ticks": int(dut.ticks.value),
        "jitter": int(dut.jitter.value),
        "latency": int(dut.latency.value),
        "refused": int(dut.refused.value),
        "counts": [counts >> 32 * i & 0xFFFFFFFF for i in range(4)],
    }
    Path(os.environ["TABLEGEN_STATUS"]).write_text(json.dumps(status), "ascii")
    assert status["jitter"] == 0, "a strobe came at another distance from its tick than the first one"
    assert status["ticks"] == status["strobes"], "a tick without a strobe, or a strobe without a tick"
