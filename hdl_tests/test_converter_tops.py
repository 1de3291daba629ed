"""``NAME_spi.v`` and ``NAME_axi_stream.v``: no tool warns of them, a clock too slow is refused, a lost word counts.

What they play is compared with the model in ``tests/verification/test_top_play.py``.
"""

import subprocess
from pathlib import Path

import pytest
from building import NAME, REMOVED, Build, Variant, build, run_clean, write_variant
from editing import run
from sets import common
from short_scans import CUBIC, short
from test_lint import lint

from tablegen.verification.verilog.outputs import OUTPUTS

WIDER_Y = {"y.dac": {"word_bits": 20}}
SCANS: dict[str, dict[str, object]] = {"Fourier": {}, "cubic": {"x.table": CUBIC, "y.table": CUBIC}}
TICK = 500_000
LEAST_CLOCKS, USUAL_CLOCKS, TWO_FRAMES = 34, 40, 77  # of words of 16 bits

LATE_BENCH = """\
`timescale 1ns / 1ps
module late;
    `define OTHERS .clock(clock), .reset(1'b0), .write(1'b0), .write_region(3'd0), .write_address(16'd0), \\
        .write_data(32'd0), .commit(1'b0), .commit_mode(2'd0), .withdraw(1'b0), .booting(booting), .arm(start), \\
        .arm_frames(16'd0), .trigger(start), .park(1'b0), .clear_faults(1'b0), .tick(tick), .underrun(1'b0), \\
        .faults(faults)
    parameter PACE = 1;
    reg clock = 0, tick = 0, start = 0, ready = 1;
    wire booting;
    wire [3:0] faults;
    integer clocks = 0, slow = 0;
    MODULE #(.START_CLOCKS(50), .PLAIN_MULTIPLIER(1)) device (`OTHERS READY);
    always begin
        #5 clock = 1;
        #5 clock = 0;
        clocks = booting ? 0 : clocks + 1;
        start = clocks == 5000;
        // ticks far apart take the program, and begin the scan
        slow = clocks < 6000 ? 200 : PACE;
        tick = !booting && clocks % slow == 0;
        ready = clocks < 6000;
        if (clocks == 9000) begin
            $display("%b", faults);
            $finish;
        end
    end
endmodule
"""
UNDERRUN = "1000"  # bit 3 of the faults


def in_both(folder: Path, scan: dict[str, object], scanner: dict[str, object] | None = None) -> Build:
    """The short scan with both outputs."""
    return short(folder, {**scan, "emit.formats": ["verilog", *OUTPUTS]}, scanner)


def sources(folder: Path, output: str) -> list[Path]:
    return [folder / f"{NAME}_{output}.v", folder / f"{NAME}_top.v", *sorted(folder.glob("dac_*.v"))]


@pytest.mark.common
@pytest.mark.parametrize("name", common(("Fourier",), SCANS))
def test_no_tool_warns_of_them(name: str, tmp_path: Path) -> None:
    folder = in_both(tmp_path, SCANS[name], WIDER_Y).folder
    for output in OUTPUTS.values():
        module = f"{NAME}_{output}"
        run_clean(["iverilog", "-g2005", "-Wall", "-t", "null", "-s", module, *sources(folder, output)])
        assert lint(module, {}, folder) == ""


def elaborated(folder: Path, **parameters: int) -> str:
    """What Icarus says of the output to serial converters."""
    module = f"{NAME}_spi"
    given = [f"-P{module}.{key}={value}" for key, value in parameters.items()]
    command = ["iverilog", "-g2005", "-t", "null", "-s", module, *given, *sources(folder, "spi")]
    return subprocess.run(command, capture_output=True, text=True, check=False).stderr


@pytest.mark.common
def test_ticks_that_are_shorter_than_a_frame_stop_the_elaboration(tmp_path: Path) -> None:
    folder = in_both(tmp_path, {}).folder
    why = f"{NAME}_spi_CLOCKS_PER_TICK_is_less_than_a_frame_takes"
    fastest = {"LDAC_CLOCKS": 0, "GAP": 1}
    for least, parameters in ((USUAL_CLOCKS, {}), (LEAST_CLOCKS, fastest), (TWO_FRAMES, {"TOPOLOGY": 1})):
        assert why in elaborated(folder, CLOCKS_PER_TICK=least - 1, **parameters)
        assert elaborated(folder, CLOCKS_PER_TICK=least, **parameters) == ""


@pytest.mark.common
def test_a_clock_that_is_too_slow_for_any_frame_is_refused_by_the_build(tmp_path: Path) -> None:
    formats = {"emit.formats": ["spi"], "limits": REMOVED}
    scan = write_variant(tmp_path, Variant({**formats, "emit.clock_hz": (LEAST_CLOCKS - 1) * TICK}))
    done = run("build", scan, "-o", tmp_path / "out")
    assert done.status == 2
    assert f"{LEAST_CLOCKS - 1} clocks a tick, and the shortest frame of 16 bits takes {LEAST_CLOCKS}; " in done.err
    assert not (tmp_path / "out").exists()
    built = build(tmp_path, Variant({**formats, "emit.clock_hz": LEAST_CLOCKS * TICK}))
    assert f"parameter CLOCKS_PER_TICK = {LEAST_CLOCKS}," in (built.folder / f"{NAME}_spi.v").read_text("ascii")


@pytest.mark.common
@pytest.mark.parametrize("output", OUTPUTS.values())
def test_a_word_that_is_lost_is_an_underrun(output: str, tmp_path: Path) -> None:
    """Ticks come faster than frames, or nothing takes the beats any more."""
    folder = in_both(tmp_path, {"x.table.length": 32}).folder
    ready = "" if output == "spi" else ", .m_axis_tready(ready)"
    text = LATE_BENCH.replace("MODULE", f"{NAME}_{output}").replace("READY", ready)
    (tmp_path / "late.v").write_text(text, "ascii")
    faults = {}
    for pace in (20, 200):
        simulation = tmp_path / f"late_{pace}.vvp"
        own = [tmp_path / "late.v", *sources(folder, output)]
        run_clean(["iverilog", "-g2005", f"-Plate.PACE={pace}", "-s", "late", *own, "-o", simulation])
        faults[pace] = run_clean(["vvp", "-n", simulation], folder).strip()
    assert faults[20] == UNDERRUN
    assert faults[200] == ("0000" if output == "spi" else UNDERRUN)
