"""The bench of dac_spi: a stimulus in, a capture of the wires out, and what was to arrive.

``spi_monitor`` decodes the capture as the converters would; a short model of the mailbox, from its description in
dac_spi.v, says which samples have to arrive and on which clock. Words come from ``Output.word``.
"""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from building import BENCHES, REPOSITORY
from replacing import replace
from spi_monitor import Converter, Wires, quiet, receive, two_channels, updates

from tablegen.fixedpoint.output import Output
from tablegen.numerics.arrays import Ints
from tablegen.verification.verilog.simulate import Design, compile_design

MODULES = REPOSITORY / "firmware_templates" / "verilog"
CODING, SPI, STREAM = (MODULES / f"{name}.v" for name in ("dac_coding", "dac_spi", "dac_axi_stream"))
STROBE, RESET, END = 1, 2, 8
PARALLEL, TWO_CHANNELS, TWO_SELECTS, CHAIN = range(4)
CAPTURED = ("sclk", "mosi_x", "mosi_y", "cs_x_n", "cs_y_n", "ldac_n", "missed", "busy", "strobe", "reset")


class Difference(Exception):
    """What arrived is not what was to arrive."""


@dataclass(frozen=True)
class Spi:
    """The parameters of one bench, under their names in Verilog."""

    bits: int = 16
    twos_complement: int = 0
    left_aligned: int = 0
    word_bits: int = 16
    frame_bits: int = 16
    data_lsb: int = 0
    x_prefix: int = 0
    y_prefix: int = 0
    topology: int = PARALLEL
    y_first: int = 0
    cpol: int = 0
    cpha: int = 0
    half_period: int = 1
    gap: int = 4
    ldac_clocks: int = 4
    ldac_delay: int = 2
    ldac_held: int = 0

    @property
    def two_frames(self) -> bool:
        return self.topology in (TWO_CHANNELS, TWO_SELECTS)

    @property
    def frame(self) -> int:
        """Clocks of a select; this and ``tick`` are the formulas of the documentation."""
        bits = 2 * self.frame_bits if self.topology == CHAIN else self.frame_bits
        return (2 * bits + 1) * self.half_period

    @property
    def tick(self) -> int:
        """Clocks from one strobe to the next that need not wait."""
        rest = max(self.gap, self.ldac_delay + self.ldac_clocks + 1) if self.ldac_clocks else self.gap
        return (2 * self.frame + self.gap if self.two_frames else self.frame) + rest

    def word(self, code: int) -> int:
        coding = "twos-complement" if self.twos_complement else "offset-binary"
        align = "left" if self.left_aligned else "right"
        return Output(0, 16, 0, 0, 0, 1, 0, self.bits, coding, align, self.word_bits).word(code)

    @property
    def converter(self) -> Converter:
        ldac = "pulse" if self.ldac_clocks else "high" if self.ldac_held else "low"
        half = self.half_period
        return Converter(
            self.frame_bits, self.cpol, self.cpha, 2 if self.topology == CHAIN else 1, ldac, half, half, half, half,
            half, half, self.gap, max(self.ldac_clocks, 1), self.ldac_delay,
        )  # fmt: skip


# As in the table of converters of the documentation.
AD5541A = Spi()
AD5791 = Spi(bits=20, word_bits=20, frame_bits=24, x_prefix=0x100000, y_prefix=0x100000, cpha=1)
AD5781 = replace(AD5791, bits=18, left_aligned=1)
AD5761 = Spi(bits=16, frame_bits=24, x_prefix=0x010000, y_prefix=0x010000, cpha=1)
DAC8562 = Spi(
    frame_bits=24, x_prefix=0x000000, y_prefix=0x110000, topology=TWO_CHANNELS, cpha=1, ldac_clocks=0, ldac_held=1
)

SETUPS: dict[str, Spi] = {
    **{
        f"mode_{cpol}{cpha}_half_{half}": Spi(cpol=cpol, cpha=cpha, half_period=half)
        for cpol in (0, 1)
        for cpha in (0, 1)
        for half in (1, 2, 5)
    },
    "ad5541a": AD5541A,
    "ad5541a_ldac_low": replace(AD5541A, ldac_clocks=0, gap=1),
    "ad5791": AD5791,
    "ad5781": AD5781,
    "ad5781_twos_complement": replace(AD5781, twos_complement=1, half_period=2),
    "ad5761": AD5761,
    "dac8562": DAC8562,
    "dac8562_y_first": replace(DAC8562, y_first=1, x_prefix=0x100000, y_prefix=0x010000, half_period=2),
    "dac8562_ldac_low": replace(DAC8562, ldac_held=0, gap=9),
    "dac8562_ldac_pulse": replace(DAC8562, y_prefix=0x010000, ldac_clocks=3),
    "dac8562_cpha_0": replace(DAC8562, cpha=0, cpol=1),
    "word_24": Spi(bits=24, word_bits=24, frame_bits=24, cpol=1, half_period=2),
    "word_12_left": Spi(bits=12, left_aligned=1, twos_complement=1),
    "word_8_in_the_middle": Spi(bits=8, word_bits=8, frame_bits=17, data_lsb=4, x_prefix=0x1A00F, y_prefix=0x0500A),
    "two_selects": Spi(topology=TWO_SELECTS, gap=3),
    "two_selects_y_first": Spi(topology=TWO_SELECTS, y_first=1, cpha=1, half_period=2, gap=1),
    "two_selects_ldac_low": replace(AD5791, topology=TWO_SELECTS, ldac_clocks=0),
    "chain": Spi(topology=CHAIN),
    "chain_y_first": replace(AD5791, topology=CHAIN, y_first=1, half_period=2),
    "chain_cpol_1": replace(AD5791, topology=CHAIN, cpol=1, cpha=0, half_period=5, y_prefix=0x200000),
    "chain_ldac_low": replace(AD5761, topology=CHAIN, cpol=1, cpha=1, ldac_clocks=0),
    "ldac_1_after_1": Spi(ldac_clocks=1, ldac_delay=1, gap=1),
    "ldac_long": Spi(ldac_clocks=11, ldac_delay=7, gap=2),
    "gap_long": Spi(gap=40, topology=TWO_SELECTS),
}


@dataclass
class Stimulus:
    """Entries of a bench: clocks to wait, what to do, codes of x and y."""

    entries: list[tuple[int, int, int, int]] = field(default_factory=list)

    def add(self, gap: int, do: int, x: int = 0, y: int = 0) -> None:
        while gap > 4095:  # the field has 12 bits; an entry that does nothing takes a clock itself
            self.entries.append((4094, 0, 0, 0))
            gap -= 4095
        self.entries.append((gap, do, x, y))

    def text(self) -> str:
        return "".join(f"{do:x}{gap:03x}{x:06x}{y:06x}\n" for gap, do, x, y in self.entries)

    def strobes(self) -> list[tuple[int, int]]:
        return [(x, y) for _, do, x, y in self.entries if do & STROBE]


def stimulus(setup: Spi, samples: int, seed: int) -> Stimulus:
    """Strobes that just do not wait, at random distances, in bursts; resets at random and at each clock of a tick."""
    generator, result, tick = random.Random(seed), Stimulus(), setup.tick
    edges = (0, 1, 2 ** (setup.bits - 1), 2 ** (setup.bits - 1) - 1, 2**setup.bits - 1, 2**setup.bits // 3)

    def code() -> int:
        return generator.choice(edges) if generator.random() < 0.2 else generator.randrange(2**setup.bits)

    def strobe(gap: int, also: int = 0) -> None:
        result.add(gap, STROBE | also, code(), code())

    for _ in range(samples // 4):
        strobe(tick - 1)
    for _ in range(samples // 2):
        strobe(generator.choice((0, 1, tick - 2, tick - 1, tick, 2 * tick, generator.randrange(2 * tick))))
        if generator.random() < 0.1:
            result.add(generator.randrange(tick), RESET)
            if generator.random() < 0.5:
                strobe(0, RESET)
    for _ in range(samples // 4):
        strobe(0)
    result.add(3 * tick, 0)
    if setup.half_period == 1:
        for after in range(tick + 3):
            strobe(2 * tick)
            boxed = after > 0 and generator.random() < 0.5
            if boxed:  # one in the mailbox
                strobe(after // 2)
            result.add(after - after // 2 - 1 if boxed else after, RESET)
    result.add(4 * tick, END)
    return result


@dataclass(frozen=True)
class Played:
    """A setup, what was asked of it, and its wires."""

    setup: Spi
    strobes: Sequence[tuple[int, int]]
    wires: Mapping[str, Ints]


def play(
    simulator: str, folder: Path, setups: Mapping[str, Spi], samples: int, mutations: Mapping[str, "Mutant"]
) -> dict[str, Played]:
    """Plays every setup in one simulation. Those with a mutation get a module of their own."""
    folder.mkdir(parents=True, exist_ok=True)
    sources, instances, stimuli = [CODING, SPI, BENCHES / "outputs_bench.v"], [], {}
    for index, (name, setup) in enumerate(setups.items()):
        stimuli[name] = stimulus(setup, samples, index)
        (folder / f"{name}.hex").write_text(stimuli[name].text(), "ascii")
        module = "outputs_bench"
        if name in mutations:
            module += f"_{name}"
            for source, text in ((SPI, mutations[name].text()), (sources[2], sources[2].read_text("utf-8"))):
                path = folder / f"{source.stem}_{name}.v"
                path.write_text(text.replace("dac_spi", f"dac_spi_{name}").replace("outputs_bench", module), "utf-8")
                sources.append(path)
        values = {key.upper(): value for key, value in parameters(setup).items()}
        values["DEPTH"] = len(stimuli[name].entries)
        given = "".join(f", .{key}({value})" for key, value in values.items())
        instances.append(
            f'    {module} #(.STIMULUS("{name}.hex"), .CAPTURE("{name}.txt"){given})\n'
            f"        bench_{index} (.clock(clock), .done(done[{index}]));\n"
        )
    top = folder / "outputs_top.v"
    top.write_text(
        "`timescale 1ns / 1ps\nmodule outputs_top;\n    reg clock = 0;\n    always #5 clock = !clock;\n"
        f"    wire [{len(instances) - 1}:0] done;\n    wire all_done = &done;\n{''.join(instances)}endmodule\n",
        "ascii",
    )
    compiled = compile_design(simulator, Design([top, *sources], "outputs_top"), folder / "build")
    for name in setups:  # a simulation runs in the folder it was compiled into
        (folder / f"{name}.hex").rename(folder / "build" / f"{name}.hex")
    assert compiled.run("cocotb_outputs") == (1, 0)
    return {
        name: Played(setup, stimuli[name].strobes(), capture(folder / "build" / f"{name}.txt"))
        for name, setup in setups.items()
    }


def parameters(setup: Spi) -> dict[str, int]:
    return {name: getattr(setup, name) for name in setup.__dataclass_fields__}


def capture(path: Path) -> dict[str, Ints]:
    """Levels by name, from three hexadecimal digits a clock; 2 on the wires of a digit that is none (an x)."""
    digits = np.frombuffer(path.read_bytes(), np.uint8)
    assert len(digits) % 3 == 0
    assert len(digits) > 0
    value = np.full(256, -1, np.int64)
    for digit in range(16):
        value[ord(f"{digit:x}")] = digit
    nibbles = value[digits].reshape(-1, 3)
    levels = {}
    for bit, name in enumerate(CAPTURED):
        nibble = nibbles[:, 2 - bit // 4]
        levels[name] = np.where(nibble < 0, 2, nibble >> bit % 4 & 1)
    return levels


@dataclass
class Expected:
    """Samples that are sent, by the clock of the strobe or of the end of the wait; clocks on which missed is high."""

    sent: list[tuple[int, tuple[int, int]]]
    missed: list[int]


def expected(played: Played) -> Expected:
    """The mailbox as dac_spi.v describes it, from one event to the next."""
    wires, tick = played.wires, played.setup.tick
    codes = iter(played.strobes)
    result, free_at, waiting = Expected([], []), 0, None
    for clock in np.flatnonzero((wires["strobe"] == 1) | (wires["reset"] == 1)).tolist():
        if waiting is not None and free_at < clock:
            result.sent.append((free_at, waiting))
            free_at, waiting = free_at + tick, None
        sample = next(codes) if wires["strobe"][clock] else None
        if wires["reset"][clock]:
            waiting = None
        elif sample is not None:
            if waiting is not None:
                result.missed.append(clock + 1)
            if free_at <= clock:
                result.sent.append((clock, sample))
                free_at, waiting = clock + tick, None
            else:
                waiting = sample
    if waiting is not None:
        result.sent.append((free_at, waiting))
    assert next(codes, None) is None, "the bench is meant to give every strobe"
    return result


def equal(what: str, got: Sequence[object], want: Sequence[object]) -> None:
    for index, (left, right) in enumerate(zip(got, want, strict=False)):
        if left != right:
            raise Difference(f"{what} {index}: {left}, not {right}")
    if len(got) != len(want):
        raise Difference(f"{what}: {len(got)}, not {len(want)}")


def check(played: Played) -> Expected:
    """Decodes the wires as the converters would; every sample has to arrive on its clock, in no faulty frame."""
    setup, wires, want = played.setup, played.wires, expected(played)
    quiet(wires["sclk"], [wires["cs_x_n"], wires["cs_y_n"]], setup.cpol)
    words = [(clock, tuple(setup.word(code) for code in codes)) for clock, codes in want.sent]
    (decode_channels if setup.topology == TWO_CHANNELS else decode_chips)(played, words)
    busy = np.zeros(len(wires["busy"]), np.int64)
    for clock, _ in want.sent:
        busy[clock + 1 : clock + 1 + setup.tick] = 1
    equal("missed", np.flatnonzero(wires["missed"]).tolist(), want.missed)
    equal("busy", wires["busy"].tolist(), busy.tolist())
    return want


def decode_chips(played: Played, words: list[tuple[int, tuple[int, ...]]]) -> None:
    """One converter an axis, in parallel, on selects of their own, or in a chain."""
    setup, wires, converter = played.setup, played.wires, played.setup.converter
    first = [clock + 1 for clock, _ in words]
    later = [clock + setup.frame + setup.gap for clock in first]
    starts = (first, first) if not setup.two_frames else (later, first) if setup.y_first else (first, later)
    for axis, name in enumerate("xy"):
        chain = setup.topology == CHAIN
        pins = Wires(
            wires["sclk"],
            wires["cs_x_n" if chain else f"cs_{name}_n"],
            wires[f"mosi_{name}" if setup.topology == PARALLEL else "mosi_x"],
            wires["ldac_n"],
        )
        frames = receive(pins, converter)
        equal(f"start of a frame of {name}", frames.start.tolist(), starts[axis])
        clocks, indices = updates(pins, converter, frames)
        far = chain and axis == setup.y_first  # what is sent first is at the far end, in column 1
        received = frames.values[indices, 1 if far else 0]

        second = setup.two_frames and axis != setup.y_first
        end = 1 + setup.frame + (setup.gap + setup.frame if second else 0)
        if setup.ldac_clocks:
            end = setup.tick + 1 - max(setup.gap, setup.ldac_delay + setup.ldac_clocks + 1) + setup.ldac_delay
        prefix = (setup.x_prefix, setup.y_prefix)[axis]
        want = [(clock + end, prefix | word[axis] << setup.data_lsb) for clock, word in words]
        equal(f"frame of {name}", list(zip(clocks.tolist(), received.tolist(), strict=True)), want)
        if chain or setup.topology == PARALLEL:
            equal("selects", np.flatnonzero(wires["cs_y_n"] != (1 if chain else wires["cs_x_n"])).tolist(), [])


def decode_channels(played: Played, words: list[tuple[int, tuple[int, ...]]]) -> None:
    """One converter of two channels, that knows commands: both outputs change at once, and only then."""
    setup, wires = played.setup, played.wires
    pins = Wires(wires["sclk"], wires["cs_x_n"], wires["mosi_x"], wires["ldac_n"])
    changes = two_channels(pins, setup.converter, receive(pins, setup.converter))
    end = 1 + 2 * setup.frame + setup.gap + (setup.ldac_delay if setup.ldac_clocks else 0)
    equal("change", changes, [(clock + end, word) for clock, word in words])
    equal("selects", np.flatnonzero(wires["cs_y_n"] != 1).tolist(), [])


@dataclass(frozen=True)
class Mutant:
    """A module with one fault: what is replaced by what, in which setup it is played, and what finds it."""

    setup: Spi
    old: str
    new: str
    found: str
    source: Path = SPI

    def text(self) -> str:
        text = self.source.read_text("utf-8")
        assert text.count(self.old) == 1, self.old
        assert self.new != self.old
        return text.replace(self.old, self.new)
