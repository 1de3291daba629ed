"""Scans that take a simulator some thousand clocks to render, and what the model plays of them."""

from pathlib import Path

from building import VARIANTS, Build, Variant, build

from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer, Tick

SHORT = {
    **VARIANTS["short_frame"].scan,
    "x.band_limit.harmonics": 5,
    "y.band_limit.harmonics": 5,
    "x.table.length": 32,
    "y.table.length": 32,
    "limits.max_error_lsb": 100,
}
CUBIC = {"mode": "cubic", "length": 16, "bits": 16}
DIRECT = {"mode": "direct", "bits": 16}


def short(folder: Path, changes: dict[str, object], scanner: dict[str, object] | None = None) -> Build:
    """The short scan, with changes in it and in the scanner file."""
    kept = {key: value for key, value in SHORT.items() if key.rpartition(".")[0] not in changes}
    if "y" in changes:
        kept = {key: value for key, value in kept.items() if not key.startswith("y.")}
    return build(folder, Variant({**kept, **changes}, scanner or {}))


def model_ticks(program: DualProgram, count: int, parked: int = 1) -> list[Tick]:
    """What the model plays from its first line on, and the ticks before, of which the first takes the program."""
    model = Sequencer(None)
    model.commit(program)
    before = [model.step() for _ in range(parked)]
    assert before[0].swapped
    model.arm()
    assert model.trigger()
    return before + [model.step() for _ in range(count)]
