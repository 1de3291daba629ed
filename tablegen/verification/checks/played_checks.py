"""The record of a session, compared with the integer model, the float waveform, and the limits of its programs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from tablegen.manifest.fields import ManifestAxis
from tablegen.manifest.read import StoredBuild
from tablegen.numerics.arrays import Floats, Ints, distinct
from tablegen.verification.checks.shaped import shaped_codes
from tablegen.verification.play.capture import UNDEFINED, Capture, differing, part, without_faults
from tablegen.verification.play.stream import FAULTS, FLAGS, STATES, Sample, StoredState

_FLOAT_TOLERANCE_LSB = 1e-6  # the last bits of two ways to evaluate the float waveform


@dataclass(frozen=True)
class Check:
    """A row of the table of checks: what is compared, how much of it, the worst of it, its limit, and the failure.

    A check that was not ``exercised`` means nothing, though it did not fail. ``seconds`` is its part of the time.
    """

    subject: str
    against: str
    compared: str
    worst: str = ""
    limit: str = ""
    failure: str | None = None
    exercised: bool = True
    seconds: float = 0.0

    @property
    def verdict(self) -> str:
        """The text of the last column of the table."""
        return "FAILED" if self.failure is not None else "ok" if self.exercised else "not exercised"


def first_difference(capture: Capture) -> str | None:
    """Describe the first tick at which anything differs, with all that was expected and captured."""
    differs = np.flatnonzero(capture.got != capture.expected)
    if not len(differs):
        return (
            f"{capture.length_error} ticks are missing or too many at the end of the capture"
            if capture.length_error
            else None
        )
    at = int(differs[0])
    expected, got = _sample(capture.expected[at]), _sample(capture.got[at])
    return f"{_where(capture, at)}\n  expected  {expected}\n  got       {got}"


def check_codes(capture: Capture, stored: StoredBuild, sent: Mapping[str, Ints]) -> list[Check]:
    """Compare codes with model and limits, converter words with the codes, and markers with the model.

    Parameters
    ----------
    sent
        Converter words of each axis, coded and aligned, each of shape (ticks,).

    Returns
    -------
    list of Check
        Those of x, of y, and of the markers.
    """
    checks = []
    for axis, content in stored.axes:
        checks += [_model(capture, axis), _slew(capture, axis, content), _clamp(capture, axis)]
        checks.append(_converter(capture, axis, content, sent[axis]))
    return [*checks, _model(capture, "markers")]


def _model(capture: Capture, subject: str) -> Check:
    differs = differing(subject, capture)
    failure = None
    worst = "0"
    if len(differs):
        got, model = part(subject, capture.got), part(subject, capture.expected)
        at = int(differs[0])
        undefined = capture.got[at] == UNDEFINED
        if subject == "markers":
            expected, actual = _markers(int(model[at])), _markers(int(got[at]))
            worst = f"{len(differs)} differ"
        else:
            expected, actual = str(model[at]), str(got[at])
            worst = str(int(np.max(np.abs(got - model)[capture.known], initial=0)))
        failure = (
            f"{subject}: {len(differs)} of {len(capture.got)} ticks differ from the model, the first at "
            f"{_where(capture, at)}: expected {expected}, got {'undefined' if undefined else actual}"
        )
    elif capture.length_error:
        failure = f"{subject}: {capture.length_error} ticks are missing or too many at the end of the capture"
    unit = "ticks" if subject == "markers" else "codes"
    return Check(subject, "integer model", f"{len(capture.got)} {unit}", worst, "0", failure)


def check_waveform(capture: Capture, stored: StoredBuild, limits: Mapping[str, float]) -> list[Check]:
    """Compare the codes of the build's program with the float waveform; ``limits`` of x and y are in LSB."""
    checks = [_float(capture, axis, content, limits[axis]) for axis, content in stored.axes]
    return checks + [_shaped(capture, axis, content) for axis, content in stored.axes if content.output.shaping]


def _shaped(capture: Capture, axis: Literal["x", "y"], content: ManifestAxis) -> Check:
    """Compare the codes of the build's program with shaped ones that were computed in another way than the model's."""
    at = np.flatnonzero(capture.own & capture.steady & capture.known)
    since = capture.since[at]
    expected = shaped_codes(content.program, int(np.max(since, initial=-1)) + 1)[since]
    got = part(axis, capture.got)[at]
    wrong = np.flatnonzero(got != expected)
    failure = None
    if len(wrong):
        first = int(wrong[0])
        failure = (
            f"{axis}: {len(wrong)} of {len(at)} shaped codes are others, the first at "
            f"{_where(capture, int(at[first]))}: expected {expected[first]}, got {got[first]}"
        )
    return Check(axis, "shaped codes", f"{len(at)} codes", f"{len(wrong)} differ", "0", failure, exercised=len(at) > 0)


def _float(capture: Capture, axis: Literal["x", "y"], content: ManifestAxis, limit: float) -> Check:
    at = np.flatnonzero(capture.own & capture.steady & capture.known)
    period = content.line.ticks
    k = capture.place[at] % period
    covered = len(distinct(k, period)) / period
    name = "line" if axis == "x" else "frame"
    # Rounded down: a frame of which a tick was not played is not whole.
    compared = f"{len(at)} codes, {int(covered * 1000) / 10:g} % of the {name}"
    if not len(at):
        why = f"{axis}: the output did not reach the waveform within {len(capture.got)} ticks; play more --ticks"
        return Check(axis, "float waveform", "no code", "", f"{limit:.3f} LSB", why)
    error: Floats = part(axis, capture.got)[at] - content.unrounded_codes(k)
    largest = int(np.argmax(np.abs(error)))
    worst = float(np.abs(error[largest]))
    failure = None
    if worst > limit + _FLOAT_TOLERANCE_LSB:
        failure = (
            f"{axis}: {worst:.3f} LSB from the float waveform, the words of the manifest make at most {limit:.3f}; "
            f"at {_where(capture, int(at[largest]))}"
        )
    return Check(axis, "float waveform", compared, f"{worst:.3f} LSB", f"{limit:.3f} LSB", failure)


def _slew(capture: Capture, axis: str, content: ManifestAxis) -> Check:
    """Check the slew guard on every tick; exercised where the model limited codes, up and down."""
    known = capture.known
    steps, most = np.diff(part(axis, capture.got)), capture.limits(axis, "max_step")[1:]
    beyond = np.flatnonzero((np.abs(steps) > most) & known[1:] & known[:-1])
    # A program of the build takes no step as large as its guard; one that is held back takes nothing else.
    model = np.diff(part(axis, capture.expected))
    up, down = (int(np.sum((model == sign * most) & (most > 0))) for sign in (1, -1))
    failure = None
    if len(beyond):
        at = int(beyond[np.argmax(np.abs(steps[beyond]) - most[beyond])])
        failure = f"{axis}: steps by {abs(int(steps[at]))} codes a tick, above {most[at]}; at {_where(capture, at + 1)}"
    compared = f"{len(steps)} steps, held {up} up, {down} down"
    largest = int(np.max(np.abs(steps)[capture.own[1:] & known[1:] & known[:-1]], initial=0))
    limit = str(content.output.max_step)
    return Check(axis, "slew guard", compared, str(largest), limit, failure, exercised=up > 0 and down > 0)


def _clamp(capture: Capture, axis: str) -> Check:
    """Check that no code leaves the limits of its program; exercised where the model clamps on both sides."""
    codes, model = part(axis, capture.got), part(axis, capture.expected)
    low, high = capture.limits(axis, "code_min"), capture.limits(axis, "code_max")
    steady = capture.steady & capture.known
    outside = np.flatnonzero(((codes < low) | (codes > high)) & steady)
    clamps = part("faults", capture.expected) >> FAULTS.index("clamp") & 1 > 0
    below, above = (int(np.sum((model == limit) & steady & clamps)) for limit in (low, high))
    failure = None
    if len(outside):
        at = int(outside[0])
        failure = f"{axis}: code {codes[at]} leaves {low[at]}..{high[at]}; at {_where(capture, at)}"
    compared = f"{int(np.sum(steady))} codes, {below} at the lower limit, {above} at the upper"
    own = codes[capture.own & steady]
    span = f"{own.min()}..{own.max()}" if len(own) else ""
    limits = capture.own & steady
    allowed = f"{low[limits][0]}..{high[limits][0]}" if len(own) else ""
    return Check(axis, "clamp", compared, span, allowed, failure, exercised=below > 0 and above > 0)


def check_no_faults(capture: Capture) -> Check:
    """Check that the program of the build raises no fault."""
    flags = part("faults", capture.got)
    wrong = np.flatnonzero((flags != 0) & capture.own)
    failure = None
    if len(wrong):
        at = int(wrong[0])
        failure = f"faults: {_raised(int(flags[at]))}, at {_where(capture, at)}"
    count = int(np.sum(capture.own))
    return Check("faults", "none in the build's program", f"{count} ticks", str(len(wrong)), "0", failure)


def check_faults(capture: Capture, counted: list[int], counts: list[int]) -> Check:
    """Check that faults on purpose equal the model's on every tick, and their ``counted`` numbers at the end."""
    expected, wrong = part("faults", capture.expected), differing("faults", capture)
    failure = None
    if len(wrong):
        got, at = part("faults", capture.got), int(wrong[0])
        failure = (
            f"faults: {len(wrong)} of {len(expected)} ticks differ from the model, the first at "
            f"{_where(capture, at)}: expected {_raised(int(expected[at]))}, got {_raised(int(got[at]))}"
        )
    elif counted != counts:
        failure = f"faults: expected are {_counts(counts)}; counted are {_counts(counted)}"
    names = [name for bit, name in enumerate(FAULTS) if np.any(expected & 1 << bit)]
    return Check(
        "faults", "integer model", f"{len(expected)} ticks: {', '.join(names)}", f"{len(wrong)} differ", "0", failure
    )


def check_states(
    model_states: list[tuple[str, StoredState]], got: list[StoredState], most_counted: int, untold: tuple[str, ...] = ()
) -> Check:
    """Check the status that the device reports after each request; fields in ``untold`` are not reported."""
    wrong = []
    for (when, state), state_read in zip(model_states, got, strict=False):
        right, state_read = state.limited(most_counted, untold), state_read.limited(most_counted, untold)
        if right == state_read:
            continue
        expected, actual = (_state_lines(one) for one in (right, state_read))
        different = [(mine, other) for mine, other in zip(expected, actual, strict=True) if mine != other]
        texts = (", ".join(pair[side] for pair in different) for side in (0, 1))
        wrong.append("requests: {}: expected {}; got {}".format(when, *texts))
    if len(got) != len(model_states):
        wrong.append(f"requests: {len(got)} states were stored in place of {len(model_states)}")
    compared = f"{len(model_states)} states"
    return Check("requests", "integer model", compared, f"{len(wrong)} differ", "0", wrong[0] if wrong else None)


def _state_lines(state: StoredState) -> list[str]:
    flags = [name if flag else f"not {name}" for name, flag in zip(STATES, state.flags, strict=True)]
    sample = Sample.of(state.outputs)
    outputs = [f"x {sample.x}", f"y {sample.y}", f"markers {' '.join(sample.flags) or 'none'}"]
    return [*flags, f"faults {_raised(state.faults)}", *_counts(list(state.counts)).split(", "), *outputs]


def _converter(capture: Capture, axis: str, content: ManifestAxis, words: Ints) -> Check:
    """Check the words sent to the converter: coding and alignment of the model's codes."""
    expected = coded(part(axis, capture.expected), content)
    words = words[: len(expected)]
    differs = np.flatnonzero(words != expected[: len(words)])
    failure = None
    if len(differs):
        at = int(differs[0])
        failure = (
            f"{axis}: {len(differs)} of {len(words)} converter words differ from the model's, the first at "
            f"{_where(capture, at)}: expected 0x{expected[at]:x}, got 0x{words[at]:x}"
        )
    elif len(words) < len(expected):
        failure = f"{axis}: {len(words)} converter words came in place of {len(expected)}"
    return Check(axis, "converter word", f"{len(words)} words", f"{len(differs)} differ", "0", failure)


def coded(codes: Ints, content: ManifestAxis) -> Ints:
    """Return the converter words of codes, by the manifest's coding and alignment.

    Parameters
    ----------
    codes
        Codes in LSB, any shape.

    Returns
    -------
    Ints
        Converter words, shape of ``codes``.
    """
    output = content.program.output
    return output.word(codes)


def check_wires(capture: Capture, stored: StoredBuild, sent: Mapping[int, int], least: int) -> Check:
    """Check the words that a serial converter got, by the number of their sample; ``least`` is how many are needed."""
    x, y = (coded(part(axis, capture.expected), content) for axis, content in stored.axes)
    numbers = [number for number in sent if number < len(x)]
    wrong = [number for number in numbers if sent[number] != int(y[number]) << 32 | int(x[number])]
    failure = None
    if wrong:
        at = wrong[0]
        failure = (
            f"serial: {len(wrong)} of {len(numbers)} samples differ on the wires, the first at {_where(capture, at)}: "
            f"expected x 0x{x[at]:x}, y 0x{y[at]:x}, got x 0x{sent[at] & 0xFFFFFFFF:x}, y 0x{sent[at] >> 32:x}"
        )
    elif len(numbers) < max(least, len(sent)):
        failure = f"serial: {len(numbers)} samples came over the wires, {max(least, len(sent))} were sent"
    return Check("serial", "converter word", f"{len(numbers)} samples", f"{len(wrong)} differ", "0", failure)


_BESIDE = {  # modules beside the sequencer: their tests, and what is lost on purpose
    "coding": ("dac_coding", "words", ""),
    "spi": ("dac_spi", "samples, 8 ways to wire two converters", "missed"),
    "axi_stream": ("dac_axi_stream", "beats, 2 widths", "missed"),
    "boot": ("dac_boot", "words, 5 ways to boot", "refused"),
}


def check_outputs(results: Mapping[str, tuple[int, int, int]]) -> list[Check]:
    """Check the results of modules beside the sequencer on random words, each compared with its header's words."""
    checks = []
    for name, (module, unit, lost_name) in _BESIDE.items():
        count, losses, errors = results.get(name, (0, 0, 0))
        failure = None
        if errors:
            failure = f"{module}: wrong on {errors} clocks of the bench of outputs (output_bench.v says how it is used)"
        elif not count or (lost_name and not losses):
            failure = f"{module}: the bench of outputs did not come to its end"
        compared = f"{count} {unit}" + (f", {losses} {lost_name}" if lost_name else "")
        checks.append(Check(module, "its options", compared, f"{errors} clocks", "0", failure))
    return checks


def check_whole(subject: str, capture: Capture, how: str) -> Check:
    """Compare codes, markers and faults of all ticks with the model at once."""
    differs = np.flatnonzero(capture.got != capture.expected)
    failure = None
    if len(differs):
        at = int(differs[0])
        failure = (
            f"{subject}: {len(differs)} of {len(capture.got)} ticks differ from the model, the first at "
            f"{_where(capture, at)}:\n  expected  {_sample(capture.expected[at])}\n  got       "
            f"{_sample(capture.got[at])}"
        )
    elif capture.length_error:
        failure = f"{subject}: {capture.length_error} ticks are missing or too many at the end of the capture"
    compared = f"{len(capture.got)} ticks{how}"
    return Check(subject, "integer model", compared, f"{len(differs)} differ", "0", failure)


def check_filled(capture: Capture, states: Check, counted: list[int], counts: list[int]) -> Check:
    """Check the session played many ticks a call: codes, markers, states, and the number of faults."""
    check = check_whole("fill", _with(capture, without_faults(capture.got), without_faults(capture.expected)), "")
    failure = check.failure
    if failure is None and counted != counts:
        failure = f"fill: faults expected are {_counts(counts)}; counted are {_counts(counted)}"
    if failure is None and states.failure is not None:
        failure = f"fill: {states.failure}"
    return Check(check.subject, check.against, check.compared, check.worst, check.limit, failure)


def _with(capture: Capture, got: Any, expected: Any) -> Capture:
    return replace(capture, got=got, expected=expected)


def _raised(flags: int) -> str:
    return " ".join(name for i, name in enumerate(FAULTS) if flags >> i & 1) or "none"


def _counts(counted: list[int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in zip(FAULTS, counted, strict=True))


def check_timing(capture: Capture, status: Mapping[str, Any]) -> Check:
    """Check that every tick has a strobe, always as many clocks after it."""
    jitter, ticks, strobes = (int(status[key]) for key in ("jitter", "ticks", "strobes"))
    failure = None
    if jitter or ticks != strobes or capture.length_error:
        failure = (
            f"timing: {ticks} ticks made {strobes} samples, {jitter} of them not {status['latency']} clocks after "
            f"their tick"
        )
    compared = f"{strobes} samples, {status['latency']} clocks late"
    return Check("timing", "constant delay", compared, f"{jitter} differ", "0", failure)


def _where(capture: Capture, at: int) -> str:
    place, program = int(capture.place[at]), capture.programs[int(capture.which[at])]
    if place < 0 or program is None:
        return f"tick {at} (while no line plays)"
    of = "" if capture.own[at] else " of a variation"
    ticks = program.schedule.ticks
    return f"tick {at} (line {place // ticks}{of}, tick {place % ticks} of it)"


def _markers(flags: int) -> str:
    return " ".join(name for i, name in enumerate(FLAGS) if flags >> i & 1) or "none"


def _sample(word: np.uint64) -> str:
    if word == UNDEFINED:
        return "undefined"
    sample = Sample.of(int(word))
    return f"x {sample.x}, y {sample.y}, markers {' '.join(sample.flags) or 'none'}, faults {sample.faults:04b}"
