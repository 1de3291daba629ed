"""``examples/verilog/linked_scanner.v`` elaborates as its header says, and tells over its line which scan it boots."""

import subprocess
from pathlib import Path

import pytest
from building import BENCHES, REPOSITORY, VARIANTS, build, run_clean
from limits import PATIENCE_S
from link_talk import Talk

from tablegen.link.messages import DeviceInfo, DeviceStatus, Feature, Request

pytestmark = pytest.mark.common

EXAMPLE = REPOSITORY / "examples" / "verilog" / "linked_scanner.v"
BENCH = BENCHES / "linked_scanner_bench.v"


def test_it_says_what_it_is(tmp_path: Path) -> None:
    built = build(tmp_path / "build", VARIANTS["example"])
    talk, program = Talk(), tmp_path / "bench.vvp"
    request = talk.hello()
    run_clean(
        [
            *("iverilog", "-g2005", f"-I{built.folder}", "-s", "linked_scanner_bench", "-o", program),
            *(BENCH, EXAMPLE, *sorted(built.folder.glob("dac_*.v")), built.folder / "program_loader.v"),
        ]
    )
    done = subprocess.run(
        ["vvp", "-n", program, f"+request={request.hex()}", f"+bytes={len(request)}"],
        cwd=built.folder,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    )
    wire = bytes.fromhex("".join(line for line in done.stdout.split() if len(line) == 2))
    assert wire, done.stdout
    (answer,) = talk.answers(wire)
    assert answer.type == Request.HELLO | 0x80
    info, status = DeviceInfo.unpack(answer.payload), DeviceStatus.unpack(answer.payload[56:])
    plan = built.plan
    assert info.features == (
        Feature.TABLES | Feature.FOURIER | Feature.READBACK | Feature.INTERLOCK | Feature.COMMIT_MODES
    )
    assert info.update_rate_hz == 500_000
    for told, limits, line in ((info.x, info.x_limits, plan.x), (info.y, info.y_limits, plan.y)):
        program_of_axis = line.program
        output = program_of_axis.output
        assert (told.index_bits, told.word_bits) == (program_of_axis.index_bits, program_of_axis.bits)
        assert (told.dac_bits, told.converter) == (output.dac_bits, output.word_bits)
        assert (limits.code_min, limits.code_max, limits.max_step) == (
            output.code_min,
            output.code_max,
            output.max_step,
        )
    assert status.hash.hex() == built.manifest["hash"]
