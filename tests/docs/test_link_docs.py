"""docs/upload.md says what is so: its example runs, its statuses and figures are those of the program."""

import re
from pathlib import Path

import pytest
from building import EXAMPLE, REPOSITORY, Variant, build
from client_line import VirtualLine
from client_rig import client, info_for, model
from editing import run

from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.config.load import load
from tablegen.link.messages import Request
from tablegen.link.prepare import PreparedScan
from tablegen.link.transport import Transport
from tablegen.planning.line_plan import make_plan

PAGE = (REPOSITORY / "docs" / "upload.md").read_text("utf-8")
TEXT = " ".join(PAGE.split())


def test_the_example_of_the_class_runs(tmp_path: Path, capsys: pytest.MonkeyPatch) -> None:
    found = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert found
    folder = build(tmp_path, Variant({"timing.lines": 40})).folder
    device = model(info_for(PreparedScan.of_build(folder)))
    line = VirtualLine(device, tick_hz=500_000)

    def port() -> Transport:
        return line.open()

    exec(compile(found[1], "docs/upload.md", "exec"), {"folder": folder, "port": port})
    generation, seconds, same = capsys.readouterr().out.split()  # type: ignore[attr-defined]
    assert (generation, same) == ("2", "True")
    assert 0.0 < float(seconds) < 1.0
    line.sleep(0.01)
    assert device.player.state.name == "PLAYING"


def test_its_statuses_are_those_of_the_program() -> None:
    rows = [int(number) for number in re.findall(r"^\| (\d+) \|", PAGE, re.M)]
    assert rows == [0, 2, 5, 6, 7, 8, 9, 10, 12, 130]
    others = {
        ExitStatus.STALE,
        ExitStatus.BROKEN_LIMIT,
        ExitStatus.CANNOT_WRITE,
        ExitStatus.PARTIAL,
        ExitStatus.UNEXPECTED,
    }
    assert set(rows) == set(ExitStatus) - others


def test_its_commands_are_there() -> None:
    for command in set(re.findall(r"tablegen ([a-z]+)", PAGE)):
        assert run(command, "--help").status == 0, command


def test_its_speeds_are_measured() -> None:
    scan = PreparedScan.of_plan(make_plan(load(EXAMPLE)))
    table, fourier = scan.image("table"), scan.image("fourier")
    assert f"the example ({len(table.data)} bytes)" in TEXT
    assert f"As Fourier words the same scan has {len(fourier.data)} bytes" in TEXT
    assert 8 * len(fourier.data) <= len(table.data)

    def upload(window: int, **options: float) -> tuple[float, float, float]:
        device = model(info_for(scan, window=window))
        line = VirtualLine(device, tick_hz=500_000, **options)  # type: ignore[arg-type]
        with client(line) as host:
            result = host.upload(table)
        byte_s = 10 / options["baud"]
        return result.seconds, result.wire_bytes * byte_s / result.seconds, result.bytes * byte_s / result.seconds

    seconds, wire, payload = upload(8, baud=115200)
    said = re.search(r"take ([\d.]+) s from BEGIN .*?: (\d+) % .*?, (\d+) % as payload", TEXT)
    assert said
    assert said.groups() == (f"{seconds:.2f}", str(int(100 * wire)), str(int(100 * payload)))
    _, wire, _ = upload(8, baud=460800, back_s=0.016)
    assert f"At 460800 with 16 ms from device to host it is {int(100 * wire)} %" in TEXT
    assert upload(1, baud=460800, back_s=0.016)[1] < 0.5 * wire


def test_every_request_of_the_protocol_has_a_method_or_is_part_of_one() -> None:
    methods = set(re.findall(r"`([a-z_]+)\(", PAGE))
    inside = {Request.HELLO, Request.BEGIN, Request.DATA, Request.COMMIT, Request.CHALLENGE, Request.SLOT}
    inside |= {Request.LIST}
    for request in set(Request) - inside:
        assert request.name.lower() in methods
