"""The cocotb side of ``loader_bench.v``: does what comes over a socket, or bridges the line to one.

Commands are lines of JSON; ``loader_bridge.py`` sends them. The simulation stands still between two commands, but while
it serves: then it runs freely, and bytes of whoever has connected go onto the line, a few at a time.
"""

import json
import os
import select
import socket
from typing import Any

import cocotb
from cocotb.triggers import Timer
from limits import PATIENCE_S

MOST = 1024  # bytes of a command
POLL_CLOCKS = 2000
AT_ONCE = 10  # bytes onto the line between two polls


@cocotb.test(timeout_time=int(os.environ.get("LOADER_TIMEOUT_MS", "60000")), timeout_unit="ms")
async def serve(dut: Any) -> None:
    """Until the other end closes."""
    await Timer(1, "ns")
    with socket.create_connection(("127.0.0.1", int(os.environ["LOADER_PORT"])), PATIENCE_S) as control:
        control.settimeout(PATIENCE_S)
        with control.makefile("rw", encoding="ascii") as lines:
            for line in lines:
                command = json.loads(line)
                for name, value in command.get("set", {}).items():
                    getattr(dut, name).value = value
                for at, word in enumerate(command.get("program", ())):
                    dut.loader.core.program_memory.words[at].value = word
                for at, byte in command.get("memory", ()):
                    dut.loader.memory.bytes[at].value = byte
                answer: dict[str, object] = {}
                if "clocks" in command:
                    answer["received"] = await _run(dut, command["send"], command["clocks"], command["until_idle"])
                if command.get("serve"):
                    await _bridge(dut, control, lines)
                print(json.dumps(answer), file=lines, flush=True)
    dut.finished.value = 1


async def _run(dut: Any, send: list[int], clocks: int, until_idle: bool) -> str:
    """Send these entries, go on for so many clocks; what came back, hexadecimal."""
    dut.host_data.value = sum(entry << 16 * at for at, entry in enumerate(send))
    dut.host_count.value = len(send)
    dut.run_clocks.value = clocks
    dut.until_idle.value = int(until_idle)
    go = 1 - int(dut.go.value)
    dut.go.value = go
    while int(dut.done.value) != go:
        await dut.done.value_change
    count = int(dut.device_count.value)
    return (int(dut.device_data.value) & ((1 << 8 * count) - 1)).to_bytes(count, "little").hex()


async def _bridge(dut: Any, control: socket.socket, lines: Any) -> None:
    """Be a serial port at a TCP port, until the next command."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        print(json.dumps({"port": server.getsockname()[1]}), file=lines, flush=True)
        client: socket.socket | None = None
        waiting = b""
        while True:
            watched = [control, server] + ([client] if client else [])
            ready = select.select(watched, [], [], 0)[0]
            if control in ready:
                lines.readline()
                break
            if server in ready:
                if client:
                    client.close()
                client, _ = server.accept()
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                waiting = b""
            elif client and client in ready:
                got = _receive(client)
                if got is None:
                    client.close()
                    client = None
                else:
                    waiting += got
            now, waiting = waiting[:AT_ONCE], waiting[AT_ONCE:]
            answer = bytes.fromhex(await _run(dut, list(now), POLL_CLOCKS, until_idle=False))
            if answer and client:
                try:
                    client.sendall(answer)
                except OSError:
                    client.close()
                    client = None
        if client:
            client.close()


def _receive(client: socket.socket) -> bytes | None:
    """What has come; None if the peer is gone."""
    try:
        return client.recv(4096) or None
    except OSError:
        return None
