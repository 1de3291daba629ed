"""Stimuli of ``adc_pixels``, the bench that plays them, and its comparison with the integer model on every clock."""

import json
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from building import BENCHES
from spi_bench import Difference
from test_lint import ADC

from tablegen.device.adc_pixels import PixelInputs, PixelOutputs, PixelStream
from tablegen.verification.verilog.simulate import Design, compile_design

PIXELS = ADC / "adc_pixels.v"
SAMPLES_BITS = 64
# From the lowest bit up, above the samples.
BITS = ("sample", "reset", "pixel", "line", "frame", "backward", "valid", "playing", "fault", "ready")
BEFORE = PixelInputs(valid=False, playing=False, ready=False)  # on the first clock of the bench


@dataclass(frozen=True)
class Shape:
    """The parameters of an instance."""

    channels: int = 1
    sample_bits: int = 16
    signed: int = 1
    count_bits: int = 16
    depth_bits: int = 4

    @property
    def parameters(self) -> dict[str, int]:
        """The parameters under their names in Verilog."""
        return {
            "CHANNELS": self.channels,
            "SAMPLE_BITS": self.sample_bits,
            "SIGNED": self.signed,
            "COUNT_BITS": self.count_bits,
            "DEPTH_BITS": self.depth_bits,
        }

    def model(self) -> PixelStream:
        """The integer model with these parameters."""
        return PixelStream(self.channels, self.count_bits, self.depth_bits)

    def samples(self, generator: random.Random) -> tuple[int, ...]:
        """Return a sample of each channel, often one at an end of the range."""
        low, high = (-(1 << self.sample_bits - 1), (1 << self.sample_bits - 1) - 1)
        if not self.signed:
            low, high = 0, (1 << self.sample_bits) - 1
        return tuple(
            generator.choice((low, high)) if generator.random() < 0.3 else generator.randint(low, high)
            for _ in range(self.channels)
        )


def scan_clocks(shape: Shape, seed: int, clocks: int) -> list[PixelInputs]:
    """Return clocks of frames as a sequencer marks them: windows, rare faults, parks and resets, gaps of samples."""
    generator, made = random.Random(seed), []
    scan = _scan(shape, generator)
    while len(made) < clocks:
        made.append(next(scan))
    return made


def _scan(shape: Shape, generator: random.Random) -> Iterator[PixelInputs]:
    fault = False
    while True:
        lines, pixels, longest = generator.randint(1, 5), generator.randint(1, 9), generator.choice((1, 2, 4, 20, 60))
        rate, ready = generator.choice((1.0, 1.0, 0.5, 0.1)), generator.choice((1.0, 1.0, 0.3, 0.05, 0.0))
        for line in range(lines):
            for backward in (False, True):
                valid_sweep, turn = generator.random() < 0.8, generator.choice((0, 0, 1, 5))
                parked = generator.random() < 0.03
                for pixel in range(-1, pixels + 1):
                    imaging = 0 <= pixel < pixels
                    for clock in range(generator.randint(1, longest) if imaging else turn):
                        fault = (fault or generator.random() < 0.001) and generator.random() > 0.02
                        begins = clock == 0 and (pixel == 0 if turn == 0 else pixel == -1) and not backward
                        playing = not (parked and generator.random() < 0.1)
                        yield PixelInputs(
                            samples=shape.samples(generator) if generator.random() < rate else None,
                            reset=generator.random() < 0.001,
                            pixel=imaging and clock == 0,
                            line=begins,
                            frame=begins and line == 0,
                            backward=backward,
                            valid=valid_sweep and imaging and not fault and playing,
                            playing=playing,
                            fault=fault,
                            ready=generator.random() < ready,
                        )


def noise_clocks(shape: Shape, seed: int, clocks: int) -> list[PixelInputs]:
    """Return clocks on which everything is random, more or less often so: orders that no sequencer has."""
    generator, made = random.Random(seed), []
    levels = PixelInputs()
    while len(made) < clocks:
        often = [generator.choice((0.0, 0.02, 0.2, 0.7)) for _ in range(4)]
        rate, ready = generator.choice((0.1, 0.5, 1.0)), generator.choice((0.0, 0.2, 0.8, 1.0))
        for _ in range(generator.randint(1, 80)):
            if generator.random() < 0.1:
                name = generator.choice(("backward", "valid", "playing", "fault"))
                likely = generator.random() < (0.8 if name in ("valid", "playing") else 0.2)
                levels = levels._replace(**{name: likely})
            made.append(
                levels._replace(
                    samples=shape.samples(generator) if generator.random() < rate else None,
                    reset=generator.random() < 0.002,
                    pixel=generator.random() < often[0],
                    line=generator.random() < often[1] / 4,
                    frame=generator.random() < often[2] / 8,
                    ready=generator.random() < ready,
                )
            )
    return made[:clocks]


def _line(inputs: PixelInputs, sample_bits: int, clock: int) -> str:
    """Without a sample the lines of the ADC have any values."""
    value = random.Random(clock).getrandbits(SAMPLES_BITS) if inputs.samples is None else 0
    for channel, sample in enumerate(inputs.samples or ()):
        value |= (sample & (1 << sample_bits) - 1) << sample_bits * channel
    flags = {**inputs._asdict(), "sample": inputs.samples is not None}
    for bit, name in enumerate(BITS, SAMPLES_BITS):
        value |= int(flags[name]) << bit
    return f"{value:019x}\n"


@dataclass(frozen=True)
class Seen:
    """What was there at an edge of the clock: the ready signal, and the outputs; None without a beat."""

    ready: bool
    lost_words: int
    beat: tuple[int, int, int] | None  # tlast, tuser, tdata


def play(
    folder: Path,
    simulator: str,
    shape: Shape,
    clocks: Sequence[PixelInputs],
    sink: float | None = None,
    sources: Sequence[Path] | None = None,
) -> tuple[list[Seen], list[list[int]]]:
    """Play a stimulus; return what was there at each edge, and what the sink received.

    ``sink`` is how often the sink of cocotbext-axi pauses; without it the ready signal is that of the stimulus.
    """
    parameters = {**shape.parameters, "CLOCKS": len(clocks), "SINK": int(sink is not None)}
    given = list(sources) if sources is not None else [PIXELS, ADC / "adc_fifo.v"]
    design = Design([BENCHES / "adc_pixels_bench.v", *given], "adc_pixels_bench", parameters)
    compiled = compile_design(simulator, design, folder)
    text = "".join(_line(inputs, shape.sample_bits, clock) for clock, inputs in enumerate(clocks))
    (folder / "stimulus.hex").write_text(text, "ascii")
    if sink is None:
        assert compiled.run("cocotb_outputs") == (1, 0)
    else:
        assert compiled.run("cocotb_adc_pixels", {"PAUSES": str(sink)}) == (1, 0)
    received = [] if sink is None else json.loads((folder / "received.json").read_text("ascii"))
    return [_seen(line.split()) for line in (folder / "capture.txt").read_text("ascii").splitlines()], received


def _seen(words: list[str]) -> Seen:
    beat = (int(words[2]), int(words[3], 16), int(words[4], 16)) if words[0][1] == "1" else None
    return Seen(words[0][0] == "1", int(words[1], 16), beat)


def expected(shape: Shape, clocks: Sequence[PixelInputs], ready: Sequence[bool]) -> list[PixelOutputs]:
    """Return the outputs of the model at each edge, with the ready signal as it was there."""
    model, outputs = shape.model(), [PixelOutputs(None, 0)]
    for inputs, now in zip((BEFORE, *clocks), ready, strict=True):
        outputs.append(model.step(inputs._replace(ready=now)))
    return outputs[:-1]


def beat_of(outputs: PixelOutputs) -> tuple[int, int, int] | None:
    """Return tlast, tuser and tdata of the model's word."""
    word = outputs.word
    return None if word is None else (int(word.last), word.flags, word.data)


def compare(shape: Shape, clocks: Sequence[PixelInputs], seen: Sequence[Seen]) -> list[PixelOutputs]:
    """Compare every clock with the model; return the model's outputs.

    Raises
    ------
    Difference
        If a clock differs.
    """
    wanted = expected(shape, clocks, [one.ready for one in seen])
    for clock, (one, outputs) in enumerate(zip(seen, wanted, strict=True)):
        if (one.lost_words, one.beat) != (outputs.lost_words, beat_of(outputs)):
            raise Difference(f"clock {clock}: {one}, not {outputs}")
    return wanted
