"""The scan as a LiteX module: a SoC that LiteX generates, played in Icarus through its bus."""

import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from building import REMOVED, REPOSITORY, Build, Variant, build, tool
from bus_model import BUS
from limits import within
from litex.build.generic_platform import Pins, Subsignal
from litex.build.io import CRG
from litex.build.sim.platform import SimPlatform
from litex.soc.integration.soc import SoCRegion
from litex.soc.integration.soc_core import SoCMini
from litex.soc.interconnect import wishbone

pytestmark = pytest.mark.rest

EXAMPLE = REPOSITORY / "examples" / "litex"
ORIGIN = 0x9000_0000
CLOCK_HZ = 8_000_000  # 16 clocks a tick
TICKS = 700
CATCHING_UP = 30  # ticks in which the guard has certainly reached the line
SCAN: dict[str, Any] = {
    "limits": REMOVED,
    "timing": {"pixels": 50, "lines": 8, "line_rate_hz": 1500.0, "ticks_per_line": 331},
    "x.table.length": 128,
    "y.table.length": 64,
    "x.band_limit.harmonics": 16,
    "y.band_limit.harmonics": 16,
}
BENCH = """
`timescale 1ns/1ps
module bench;
    `include "dac_registers.vh"
    localparam [31:0] ORIGIN = 32'hORIGIN;
    localparam CLOCKS_PER_TICK = 16;
    `include "counters.vh"
    reg clock = 0, cyc = 0, we = 0;
    reg [31:0] address = 0, data = 0;
    wire [31:0] read;
    wire ack, err, strobe, line;
    wire [15:0] x_word, y_word;
    reg playing = 0;
    integer left = TICKS;
    always #1 clock = !clock;
    soc dut (
        .sys_clk(clock), .host_adr(address[31:2]), .host_dat_w(data), .host_dat_r(read), .host_sel(4'hF),
        .host_cyc(cyc), .host_stb(cyc), .host_ack(ack), .host_err(err), .host_we(we), .host_cti(3'd0), .host_bte(2'd0),
        .dac_strobe(strobe), .dac_x(x_word), .dac_y(y_word), .dac_line(line)
    );
    task access(input write, input [31:0] at, input [31:0] value);
        begin
            @(negedge clock);
            cyc = 1; we = write; address = ORIGIN + at; data = value;
            @(posedge clock);
            while (!(ack || err)) @(posedge clock);
            $display("%0s %0d %0d", err ? "error" : write ? "write" : "read", at, write ? value : read);
            @(negedge clock) cyc = 0;
        end
    endtask
    initial begin
        repeat (20) @(posedge clock);
        access(0, DAC_IDENTITY_ADDRESS, 0);
        access(0, DAC_X_SHAPE_ADDRESS, 0);
        access(0, 32'hFFFFC, 0);
        access(1, DAC_IDENTITY_ADDRESS, 0);
        access(0, DAC_STATUS_ADDRESS, 0);
        while (!(read & DAC_STATUS_WRITABLE_MASK)) access(0, DAC_STATUS_ADDRESS, 0);
        access(1, DAC_ARM_ADDRESS, 0);
        access(1, DAC_COMMAND_ADDRESS, DAC_COMMAND_TRIGGER_MASK);
        repeat (500 * CLOCKS_PER_TICK) @(posedge clock);
        access(0, LINE_NUMBER - ORIGIN, 0);
        access(0, SWAPS - ORIGIN, 0);
    end
    always @(posedge clock) if (strobe) begin
        if (line) playing = 1;
        if (playing || line) begin
            $display("tick %0d %0d", x_word, y_word);
            left = left - 1;
            if (left == 0) $finish;
        end
    end
endmodule
"""


@pytest.fixture(scope="module")
def example() -> Any:
    """The module of the example."""
    sys.path.insert(0, str(EXAMPLE))
    try:
        return importlib.import_module("tablegen_scan")
    finally:
        sys.path.remove(str(EXAMPLE))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Build:
    return build(tmp_path_factory.mktemp("litex"), Variant(SCAN))


def generated(example: Any, folder: Path) -> list[str]:
    """Write the SoC beside the build; its sources, the top first."""
    host = [("adr", 30), ("dat_w", 32), ("dat_r", 32), ("sel", 4), ("cti", 3), ("bte", 2)]
    host += [(name, 1) for name in ("cyc", "stb", "ack", "err", "we")]
    dac = ("strobe", 1), ("x", 16), ("y", 16), ("line", 1)
    io = [("sys_clk", 0, Pins(1))]
    io += [
        (name, 0, *(Subsignal(part, Pins(bits)) for part, bits in parts))
        for name, parts in (("host", host), ("dac", dac))
    ]
    platform = SimPlatform("SIM", io, name="soc")
    soc = SoCMini(platform, clk_freq=CLOCK_HZ)
    soc.crg = CRG(platform.request("sys_clk"))
    soc.scan = example.TablegenScan(platform, folder, CLOCK_HZ)
    soc.bus.add_slave("scan", soc.scan.bus, SoCRegion(origin=ORIGIN, size=soc.scan.SIZE, cached=False))
    master, pads, out = (
        wishbone.Interface(data_width=32, address_width=32),
        platform.request("host"),
        platform.request("dac"),
    )
    soc.bus.add_master("host", master=master)
    soc.comb += master.connect_to_pads(pads, mode="slave")
    for pad, signal in ((out.strobe, "strobe"), (out.x, "x_word"), (out.y, "y_word"), (out.line, "line")):
        soc.comb += pad.eq(getattr(soc.scan, signal))
    soc.finalize()
    platform.get_verilog(soc, name="soc").write(str(folder / "soc.v"))
    (folder / "counters.vh").write_text(
        "".join(f"localparam [31:0] {name.upper()} = {csr_address(soc, name)};\n" for name in ("line_number", "swaps")),
        "ascii",
    )
    return [str(folder / "soc.v"), *(source[0] for source in platform.sources)]


def csr_address(soc: SoCMini, name: str) -> int:
    """The address of a CSR of the scan."""
    region = soc.csr.regions["scan"]
    place = [csr.name for csr in region.obj].index(name)
    assert all(csr.size <= region.busword for csr in region.obj)
    return int(region.origin) + 4 * place


def played(example: Any, folder: Path, bench: str = BENCH) -> list[str]:
    """What the bench prints."""
    bench = bench.replace("32'hORIGIN", f"32'h{ORIGIN:08X}").replace("TICKS", str(TICKS), 1)
    (folder / "bench.v").write_text(bench, "ascii")
    sources = generated(example, folder)
    command = [tool("iverilog"), "-g2005", "-s", "bench", f"-I{BUS}", "-o", "soc.vvp", "bench.v", *sources]
    subprocess.run(command, check=True, cwd=folder)
    done = within(600, [tool("vvp"), "-n", "soc.vvp"])
    return subprocess.run(done, check=True, cwd=folder, capture_output=True, text=True).stdout.splitlines()


def test_the_soc_plays_the_scan_of_the_build(example: Any, made: Build) -> None:
    """Through the decoder of LiteX: the identity, errors of what is none, and the samples after the first ramp."""
    said = played(example, made.folder)
    accesses = [line.split() for line in said if not line.startswith("tick")]
    kinds = [(kind, int(at)) for kind, at, _ in accesses[:4]]
    assert kinds == [("read", 0), ("read", 12), ("error", 0xFFFFC), ("error", 0)]
    assert int(accesses[0][2]) == 0x54424C47
    assert [int(value) for _, _, value in accesses[-2:]] == [500 // SCAN["timing"]["ticks_per_line"], 1]
    words = [tuple(map(int, line.split()[1:])) for line in said if line.startswith("tick")]
    axes = made.plan.x, made.plan.y
    expected = list(zip(*(line.program.output.word(line.codes(0, TICKS)).tolist() for line in axes), strict=True))
    assert len(words) == TICKS
    assert words[CATCHING_UP:] == expected[CATCHING_UP:]
    assert words[0] != expected[0]  # the guard ramps from the codes at power-up


def test_a_clock_that_is_no_multiple_of_the_rate_is_refused(example: Any, made: Build) -> None:
    with pytest.raises(ValueError, match="no multiple of the update rate, 500000 Hz"):
        example.TablegenScan(SimPlatform("SIM", [("sys_clk", 0, Pins(1))]), made.folder, 8_100_000)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_another_word_of_the_build_is_heard(example: Any, tmp_path: Path) -> None:
    """A control: with the memory file of another scan the samples are others."""
    made, other = build(tmp_path / "a", Variant(SCAN)), build(tmp_path / "b", Variant({**SCAN, "x.size_nm": 120.0}))
    name = f"{made.plan.name}_x_fourier.mem"
    (made.folder / name).write_bytes((other.folder / name).read_bytes())
    (made.folder / f"{made.plan.name}_program.mem").write_bytes(
        (other.folder / f"{made.plan.name}_program.mem").read_bytes()
    )
    words = [int(line.split()[1]) for line in played(example, made.folder) if line.startswith("tick")]
    expected = made.plan.x.program.output.word(made.plan.x.codes(0, TICKS)).tolist()
    assert words[CATCHING_UP:] != expected[CATCHING_UP:]
    same = other.plan.x.program.output.word(other.plan.x.codes(0, TICKS)).tolist()
    assert words[CATCHING_UP:] == same[CATCHING_UP:]
