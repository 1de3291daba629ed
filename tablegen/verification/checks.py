"""What was stored against the integer model, the float waveform, and the limits of the program."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from tablegen.manifest.read import ManifestAxis, StoredBuild
from tablegen.numerics.arrays import Bools, Floats, Ints
from tablegen.verification.stream import FLAGS, Sample, Words

_UNDEFINED = np.uint64((1 << 64) - 1)  # how a capture is read where the simulator has an unknown bit
_MASK = {"x": (0, 0xFFFFFF), "y": (24, 0xFFFFFF), "markers": (48, 0xFF), "faults": (56, 0xFF)}
_FAULTS = ("slew", "clamp", "overrun", "underrun")
_FLOAT_TOLERANCE_LSB = 1e-9  # the last bits of two ways to evaluate the float waveform


@dataclass(frozen=True)
class Check:
    """A row of the table: what was held against what, how much of it, the worst of it, its limit, and why it fails."""

    subject: str
    against: str
    compared: str
    worst: str = ""
    limit: str = ""
    failure: str | None = None


@dataclass(frozen=True, eq=False)
class Capture:
    """The words that left the device, those of the model, and where in its program the model was.

    ``place`` is the tick of the frame, -1 where nothing plays; ``steady`` says where the output had caught up with the
    program of the build. From tick ``own`` on a variation of it plays.
    """

    got: Words
    wanted: Words
    place: Ints
    steady: Bools
    own: int
    lost: int  # ticks that the model has and the capture has not, or the other way round


def _part(subject: str, words: Words) -> Ints:
    """A field of stored words."""
    shift, mask = _MASK[subject]
    return (words >> np.uint64(shift) & np.uint64(mask)).astype(np.int64)


def make_capture(stored: StoredBuild, expected: list[int], got: Words, own: int | None = None) -> Capture:
    """Line capture and model up; ``own`` ticks are of the program of the build, all if not given."""
    wanted = np.array(expected, dtype=np.uint64)
    flags = {name: (wanted >> np.uint64(48 + i) & np.uint64(1)).astype(np.bool_) for i, name in enumerate(FLAGS)}
    index = np.arange(len(wanted))
    frames = np.maximum.accumulate(np.where(flags["frame"], index, -1))
    place = np.where(flags["playing"], index - frames, -1)
    # A program begins where a frame does and the tick before was not the last of one.
    frame_ticks = stored.program.schedule.frame_ticks
    begins = flags["frame"] & (np.concatenate([[-1], place[:-1]]) != frame_ticks - 1)
    reached = place >= 0
    for axis, program in (("x", stored.program.x), ("y", stored.program.y)):
        reached[reached] = program.codes(place[reached] % program.ticks) == _part(axis, wanted)[reached]
    begun = np.maximum.accumulate(np.where(begins, index, 0))
    # Caught up is for good: one right tick since the program began, this one included, is enough.
    steady = (place >= 0) & (np.maximum.accumulate(np.where(reached, index, -1)) >= begun)
    own = len(wanted) if own is None else own
    steady[own:] = False
    length = min(len(wanted), len(got))
    return Capture(got[:length], wanted[:length], place[:length], steady[:length], own, abs(len(wanted) - len(got)))


def first_difference(capture: Capture, stored: StoredBuild) -> str | None:
    """The first tick at which anything differs, with all that was expected and got."""
    differs = np.flatnonzero(capture.got != capture.wanted)
    if not len(differs):
        return f"{capture.lost} ticks are missing or too many at the end of the capture" if capture.lost else None
    at = int(differs[0])
    wanted, got = _sample(capture.wanted[at]), _sample(capture.got[at])
    return f"{_where(capture, stored, at)}\n  expected  {wanted}\n  got       {got}"


def check_codes(capture: Capture, stored: StoredBuild, sent: Mapping[str, Ints] | None = None) -> list[Check]:
    """Codes against model, waveform and limits, converter words that were ``sent``, and markers against the model."""
    checks = []
    for axis, content in stored.axes:
        checks += [_model(capture, stored, axis), _float(capture, stored, axis, content)]
        checks += _bounds(capture, axis, content)
        if sent is not None:
            checks.append(_converter(capture, stored, axis, content, sent[axis]))
    return [*checks, _model(capture, stored, "markers")]


def _model(capture: Capture, stored: StoredBuild, subject: str) -> Check:
    got, wanted = _part(subject, capture.got), _part(subject, capture.wanted)
    differs = np.flatnonzero(got != wanted)
    failure = None
    worst = "0"
    if len(differs):
        at = int(differs[0])
        undefined = capture.got[at] == _UNDEFINED
        if subject == "markers":
            expected, found = _markers(int(wanted[at])), _markers(int(got[at]))
            worst = f"{len(differs)} differ"
        else:
            expected, found = str(wanted[at]), str(got[at])
            known = capture.got != _UNDEFINED
            worst = str(int(np.max(np.abs(got - wanted)[known], initial=0)))
        failure = (
            f"{subject}: {len(differs)} of {len(got)} ticks differ from the model, the first at "
            f"{_where(capture, stored, at)}: expected {expected}, got {'undefined' if undefined else found}"
        )
    elif capture.lost:
        failure = f"{subject}: {capture.lost} ticks are missing or too many at the end of the capture"
    unit = "ticks" if subject == "markers" else "codes"
    return Check(subject, "integer model", f"{len(got)} {unit}", worst, "0", failure)


def _float(capture: Capture, stored: StoredBuild, axis: Literal["x", "y"], content: ManifestAxis) -> Check:
    at = np.flatnonzero(capture.steady & (capture.got != _UNDEFINED))
    period, limit = content.line.ticks, content.certificate.max_error_lsb
    k = capture.place[at] % period
    covered = len(np.unique(k)) / period
    name = "line" if axis == "x" else "frame"
    # Rounded down: a frame of which a tick was not played is not whole.
    compared = f"{len(at)} codes, {int(covered * 1000) / 10:g} % of the {name}"
    if not len(at):
        why = f"{axis}: the output did not reach the waveform within {len(capture.got)} ticks; play more --ticks"
        return Check(axis, "float waveform", "no code", "", f"{limit:.3f} LSB", why)
    error: Floats = _part(axis, capture.got)[at] - content.asked(k)
    largest = int(np.argmax(np.abs(error)))
    worst = float(np.abs(error[largest]))
    failure = None
    if worst > limit + _FLOAT_TOLERANCE_LSB:
        failure = (
            f"{axis}: {worst:.3f} LSB from the float waveform, the certificate promises {limit:.3f}; "
            f"at {_where(capture, stored, int(at[largest]))}"
        )
    return Check(axis, "float waveform", compared, f"{worst:.3f} LSB", f"{limit:.3f} LSB", failure)


def _bounds(capture: Capture, axis: str, content: ManifestAxis) -> list[Check]:
    """Slew guard and clamp on every tick, whatever the state."""
    output = content.output
    codes = _part(axis, capture.got)[capture.got != _UNDEFINED]
    step = int(np.max(np.abs(np.diff(codes)), initial=0))
    low, high = int(np.min(codes, initial=output.code_max)), int(np.max(codes, initial=output.code_min))
    inside = output.code_min <= low and high <= output.code_max
    return [
        Check(
            axis,
            "slew guard",
            f"{max(len(codes) - 1, 0)} steps",
            str(step),
            str(output.max_step),
            None if step <= output.max_step else f"{axis}: steps by {step} codes a tick, above {output.max_step}",
        ),
        Check(
            axis,
            "clamp",
            f"{len(codes)} codes",
            f"{low}..{high}",
            f"{output.code_min}..{output.code_max}",
            None if inside else f"{axis}: codes {low}..{high} leave {output.code_min}..{output.code_max}",
        ),
    ]


def check_no_faults(capture: Capture, stored: StoredBuild) -> Check:
    """The program of the build raises no fault."""
    flags = _part("faults", capture.got)[: capture.own]
    wrong = np.flatnonzero(flags)
    failure = None
    if len(wrong):
        at = int(wrong[0])
        failure = f"faults: {_raised(int(flags[at]))}, at {_where(capture, stored, at)}"
    return Check("faults", "none to occur", f"{len(flags)} ticks", str(len(wrong)), "0", failure)


def check_faults(capture: Capture, stored: StoredBuild, counted: list[int], counts: list[int]) -> Check:
    """Faults of a variation equal the model's, tick for tick, and so do their ``counted`` numbers."""
    got, wanted = _part("faults", capture.got), _part("faults", capture.wanted)
    wrong = np.flatnonzero(got != wanted)
    failure = None
    if len(wrong):
        at = int(wrong[0])
        failure = (
            f"faults: {len(wrong)} of {len(got)} ticks differ from the model, the first at "
            f"{_where(capture, stored, at)}: expected {_raised(int(wanted[at]))}, got {_raised(int(got[at]))}"
        )
    elif counted != counts:
        failure = f"faults: expected are {_counts(counts)}; counted are {_counts(counted)}"
    return Check("faults", "integer model", f"{len(got)} ticks", f"{len(wrong)} differ", "0", failure)


def check_nothing_counted(
    capture: Capture, stored: StoredBuild, counted: list[int], counts: list[int], refused: bool
) -> Check:
    """No fault is to be seen, none to be counted, by device or model, no write to be refused."""
    failure = check_no_faults(capture, stored).failure
    if failure is None and (any(counted) or any(counts) or refused):
        failure = f"faults: counted are {_counts(counted)}; writes were {'' if refused else 'not '}refused"
    return Check("faults", "none to occur", f"{len(capture.got)} ticks", str(sum(counted)), "0", failure)


def _converter(capture: Capture, stored: StoredBuild, axis: str, content: ManifestAxis, words: Ints) -> Check:
    """What the converter is sent: coding and alignment of the model's codes."""
    output = content.program.output
    codes, which = np.unique(_part(axis, capture.wanted), return_inverse=True)
    wanted = np.array([output.word(code) for code in codes.tolist()], dtype=np.int64)[which.reshape(-1)]
    words = words[: len(wanted)]
    differs = np.flatnonzero(words != wanted)
    failure = None
    if len(differs):
        at = int(differs[0])
        failure = (
            f"{axis}: {len(differs)} of {len(words)} converter words differ from the model's, the first at "
            f"{_where(capture, stored, at)}: expected 0x{wanted[at]:x}, got 0x{words[at]:x}"
        )
    return Check(axis, "converter", f"{len(words)} words", f"{len(differs)} differ", "0", failure)


def check_filled(capture: Capture, stored: StoredBuild, counted: list[int], counts: list[int]) -> Check:
    """The same session played many ticks at a time: codes and markers; of faults only how many there were."""
    mask = ~np.uint64(_MASK["faults"][1] << _MASK["faults"][0])
    got, wanted = capture.got & mask, capture.wanted & mask
    differs = np.flatnonzero(got != wanted)
    failure = None
    if len(differs):
        at = int(differs[0])
        failure = (
            f"fill: {len(differs)} of {len(got)} ticks differ from the model, the first at "
            f"{_where(capture, stored, at)}:\n  expected  {_sample(wanted[at])}\n  got       {_sample(got[at])}"
        )
    elif capture.lost:
        failure = f"fill: {capture.lost} ticks are missing or too many at the end of the capture"
    elif counted != counts:
        failure = f"fill: faults expected are {_counts(counts)}; counted are {_counts(counted)}"
    return Check("fill", "integer model", f"{len(got)} ticks", f"{len(differs)} differ", "0", failure)


def _raised(flags: int) -> str:
    return " ".join(name for i, name in enumerate(_FAULTS) if flags >> i & 1) or "none"


def _counts(counted: list[int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in zip(_FAULTS, counted, strict=True))


def check_timing(capture: Capture, status: dict[str, Any]) -> Check:
    """A strobe for every tick, always as many clocks after it."""
    jitter, ticks, strobes = (int(status[key]) for key in ("jitter", "ticks", "strobes"))
    failure = None
    if jitter or ticks != strobes or capture.lost:
        failure = (
            f"timing: {ticks} ticks made {strobes} samples, {jitter} of them not {status['latency']} clocks after "
            f"their tick"
        )
    compared = f"{strobes} samples, {status['latency']} clocks late"
    return Check("timing", "constant delay", compared, f"{jitter} differ", "0", failure)


def _where(capture: Capture, stored: StoredBuild, at: int) -> str:
    place, ticks = int(capture.place[at]), stored.program.schedule.ticks
    where = f"line {place // ticks}, tick {place % ticks} of it" if place >= 0 else "while no line plays"
    return f"tick {at} ({where})"


def _markers(flags: int) -> str:
    return " ".join(name for i, name in enumerate(FLAGS) if flags >> i & 1) or "none"


def _sample(word: np.uint64) -> str:
    if word == _UNDEFINED:
        return "undefined"
    sample = Sample.of(int(word))
    return f"x {sample.x}, y {sample.y}, markers {' '.join(sample.flags) or 'none'}, faults {sample.faults:04b}"
