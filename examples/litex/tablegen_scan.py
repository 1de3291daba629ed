"""A scan of ``tablegen build -f verilog`` as a LiteX module: its registers on the SoC's Wishbone bus.

In the target of a board::

    from tablegen_scan import TablegenScan

    self.scan = TablegenScan(platform, "build", sys_clk_freq)
    self.bus.add_slave("scan", self.scan.bus, SoCRegion(origin=0x9000_0000, size=TablegenScan.SIZE, cached=False))
    self.irq.add("scan")
    pads = platform.request("dac")
    self.comb += [pads.x.eq(self.scan.x_word), pads.y.eq(self.scan.y_word)]

The registers are those of docs/registers.md, with the constants of dac_registers.h. The scan of the build is there
after power-up, if the memory files of the build (``*.mem``) are where synthesis runs; ``arm`` and ``trigger`` start it.
``line_number`` and ``swaps`` are CSRs of the SoC beside them, for firmware that takes uploads as
examples/firmware/soft_core does.
"""

from fractions import Fraction
from pathlib import Path
from typing import Any

from litex.gen import LiteXModule
from litex.soc.interconnect import wishbone
from litex.soc.interconnect.csr import CSRStatus
from litex.soc.interconnect.csr_eventmanager import EventManager, EventSourceLevel
from migen import ClockSignal, If, Instance, ResetSignal, Signal

import tablegen
from tablegen.base.resources import resource_folder
from tablegen.emit.constants import pixel_constants

_DEGREES = {"direct": 0, "interpolated": 1, "cubic": 3}
_MOST_HARMONICS = 127  # of the Fourier words that a host may send
_COUNT_BITS = 16
_STATES = ("writable", "refused", "committed", "can_keep", "booting", "missing", "armed", "running", "busy")
_MARKERS = ("line", "frame", "pixel", "backward", "valid", "swapped")


class TablegenScan(LiteXModule):
    """The sequencer of a build, behind ``bus``, with an interrupt (``ev``).

    ``x_word`` and ``y_word`` are what the converters take, new with ``strobe``; ``line``, ``frame``, ``pixel``,
    ``backward``, ``valid`` and ``swapped`` are the markers of docs/sequencer.md, ``playing`` and ``parked`` the state.
    """

    SIZE = 1 << 20  # bytes of the region

    def __init__(self, platform: Any, folder: str | Path, sys_clk_freq: float) -> None:
        """Add the sources of a build to a platform, and connect the sequencer to a bus.

        Parameters
        ----------
        platform
            Platform of LiteX.
        folder
            Directory that ``tablegen build -f verilog`` wrote.
        sys_clk_freq
            Clock of the SoC in Hz, a whole multiple of the scan's update rate.

        Raises
        ------
        ValueError
            If it is none.
        """
        build = tablegen.read_build(Path(folder))
        name, program = build.manifest.name, build.program
        clocks = Fraction(sys_clk_freq) / program.schedule.update_rate_hz
        if clocks.denominator != 1:
            rate_hz = float(program.schedule.update_rate_hz)
            raise ValueError(
                f"{sys_clk_freq:g} Hz is no multiple of the update rate, {rate_hz:g} Hz; change one of both"
            )
        self._add_sources(platform, Path(folder), name)

        self.bus = wishbone.Interface(data_width=32, address_width=32, addressing="word")
        self.ev = EventManager()
        self.ev.scan = EventSourceLevel(description="A scan was taken, refused, parked, or has a fault.")
        self.ev.finalize()
        self.x_word, self.y_word = (Signal(axis.output.word_bits) for axis in (program.x, program.y))
        self.strobe, self.playing, self.parked = Signal(), Signal(), Signal()
        for marker in _MARKERS:
            setattr(self, marker, Signal())

        fourier = int(f"{name}_sine.mem" in build.manifest.files)
        longest = max(len(axis.words) for axis in (program.x, program.y))
        harmonics = {"p_HARMONICS": min(_MOST_HARMONICS, longest // 2 - 1)} if fourier else {}
        pixels = pixel_constants(program.schedule)["PIXEL_INDEX_BITS"]
        widths = {}
        for letter, axis in (("X", program.x), ("Y", program.y)):
            degree = _DEGREES[axis.mode]
            widths[f"p_{letter}_INTERPOLATED"] = degree
            widths[f"p_{letter}_INDEX_BITS"] = axis.index_bits if degree else (len(axis.words) - 1).bit_length()
            widths[f"p_{letter}_WORD_BITS"] = axis.bits
        self._count()
        host = self._host_port()
        self.specials += Instance(
            "dac_wishbone",
            p_ADDRESS_BITS=20,
            p_DAC_BITS=program.x.output.dac_bits,
            p_COUNT_BITS=_COUNT_BITS,
            p_FOURIER=fourier,
            p_COMMIT_MODES=1,
            p_PIXEL_INDEX_BITS=pixels,
            **widths,
            **harmonics,
            i_clock=ClockSignal(),
            i_reset=ResetSignal(),
            i_wb_cyc_i=self.bus.cyc,
            i_wb_stb_i=self.bus.stb,
            i_wb_we_i=self.bus.we,
            i_wb_adr_i=self.bus.adr[:18],
            i_wb_sel_i=self.bus.sel,
            i_wb_dat_i=self.bus.dat_w,
            o_wb_dat_o=self.bus.dat_r,
            o_wb_ack_o=self.bus.ack,
            o_wb_err_o=self.bus.err,
            o_irq=self.ev.scan.trigger,
            **{f"{'o' if out else 'i'}_{port}": signal for port, (out, signal) in host.items()},
        )
        self.specials += Instance(
            f"{name}_top",
            p_CLOCKS_PER_TICK=int(clocks),
            p_COUNT_BITS=_COUNT_BITS,
            p_COMMIT_MODES=1,
            **harmonics,
            i_clock=ClockSignal(),
            i_reset=ResetSignal(),
            i_tick=self._tick(int(clocks)),
            i_underrun=0,
            o_strobe=self.strobe,
            o_x_word=self.x_word,
            o_y_word=self.y_word,
            **{f"o_{marker}_marker": getattr(self, marker) for marker in _MARKERS},
            **{f"{'i' if out else 'o'}_{port}": signal for port, (out, signal) in host.items()},
        )

    def _host_port(self) -> dict[str, tuple[bool, Signal]]:
        """Return the signals of the host port; True are those that the bus drives."""
        driven = {"write": 1, "write_region": 3, "write_address": 16, "write_data": 32, "commit": 1, "withdraw": 1}
        driven["commit_mode"] = 2
        driven |= {"arm": 1, "arm_frames": 16, "trigger": 1, "park": 1, "clear_faults": 1}
        read = dict.fromkeys(_STATES, 1)
        read |= {"faults": 4, "fault_counts": 4 * _COUNT_BITS}
        host = {
            port: (out, Signal(bits)) for out, ports in ((True, driven), (False, read)) for port, bits in ports.items()
        }
        return host | {"playing": (False, self.playing), "parked": (False, self.parked)}

    def _count(self) -> None:
        """Count lines of the frame and programs, which the registers of the sequencer do not have."""
        self.line_number = CSRStatus(16, description="Line of the frame; 0 while no scan plays.")
        self.swaps = CSRStatus(32, description="Programs taken since power-up.")
        line, swaps = self.line_number.status, self.swaps.status
        stopped = ~self.playing
        self.sync += If(
            self.strobe,
            If(self.frame | stopped, line.eq(0)).Elif(self.line, line.eq(line + 1)),
            If(self.swapped, swaps.eq(swaps + 1)),
        )

    def _tick(self, clocks: int) -> Signal:
        """Return a signal that is high for one clock of so many."""
        count, tick = Signal(max=max(clocks, 2)), Signal()
        self.comb += tick.eq(count == clocks - 1)
        self.sync += If(tick, count.eq(0)).Else(count.eq(count + 1))
        return tick

    @staticmethod
    def _add_sources(platform: Any, folder: Path, name: str) -> None:
        """Add the top of the build, the sequencer beside it, and the bus."""
        bus = sorted((resource_folder("firmware_templates") / "verilog" / "bus").glob("dac_*.v"))
        for path in [folder / f"{name}_top.v", *sorted(folder.glob("dac_*.v")), *bus]:
            platform.add_source(str(path))
