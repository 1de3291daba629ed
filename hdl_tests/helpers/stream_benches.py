"""Benches of the whole sequencer: what every script of the stream tests is held to, and the sine of a renderer."""

from pathlib import Path

from stream_laws import steps_are_limited

from tablegen.emit.memory import memory_file
from tablegen.fixedpoint.synthesis import sine_quarter
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script
from tablegen.verification.verilog.sequencer_bench import BenchRun, SequencerBench

HARMONICS = 5


def with_sine(folder: Path, shape: SequencerShape, harmonics: int = HARMONICS) -> dict[str, int | str]:
    """The parameters of a sequencer that renders, its sine written to a file."""
    sine = folder / "sine.mem"
    index_bits = [bits for axis in "xy" if (bits := getattr(shape, f"{axis}_index_bits"))]
    sine.write_bytes(memory_file(sine_quarter(max(index_bits)), 32))
    return {"FOURIER": 1, "HARMONICS": harmonics, "SINE_FILE": str(sine)}


def equal(bench: SequencerBench, script: Script) -> BenchRun:
    """Play a script; all has to be as the model has it, and every step inside the limit of the program that plays."""
    played = bench.play(script)
    assert played.equal, played
    steps_are_limited(played.capture, script.swapped_programs)
    return played
