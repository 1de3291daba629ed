"""Explanations of refusals, each with what to do: docs/protocol.md, "Reasons"."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from tablegen.device.commit_mode import CommitMode
from tablegen.link.errors import Refused
from tablegen.link.messages import OF_Z, VERSION, AxisLimits, DeviceInfo, Feature, More, Reason, Request

if TYPE_CHECKING:
    from tablegen.link.program_image import Contents

_AXES = "xy"
Limits = tuple[AxisLimits, AxisLimits]
_ORDERS = {0: "no shaping", 1: "'first'", 2: "'first' and 'second'", 3: "all orders"}

# For these, `detail` is an axis, plus 2 times the index of a word where there is one.
_AXIS_REASONS = {
    Reason.SHAPE: "its table is too long for the device, or of another mode or width of words than the device has, or "
    "has too many pixels; an FPGA plays one mode and length; build for this device",
    Reason.PERIOD: "its period, phase step and remainder do not match; build it again",
    Reason.OUTPUT: "gain, offset, code limits or max_step are out of range or order; build it again",
    Reason.SLOW_PART: "it has a slow part, whose gain and offset are not those of a table; upload the new scan instead",
    Reason.FOURIER: "its Fourier words sum to 4.0 or more, too much for the device; upload --as table",
}
_MESSAGES = {
    Reason.TYPE: "the device does not know this request; its firmware is older, or was built without it",
    Reason.PAYLOAD: "the device reports a wrong length or value; do the versions of tablegen and firmware match?",
    Reason.SESSION: "the device was reset, or another program uses it; try again",
    Reason.OLD: "a later request has replaced it; try again",
    Reason.BUSY: "a program is being checked or waits for a line start; try again when it is active",
    Reason.UPLOAD: "the device has no upload of this image in progress; upload again",
    Reason.INTERLOCK: "the interlock input is open; close it and try again",
    Reason.IMAGE: "the memory of the device does not contain what was sent; upload again. If it happens again, the "
    "memory may be faulty",
    Reason.SCHEDULE: "line_ticks, frame_lines or a window of the schedule are out of range; build it again",
    Reason.KEEP: "the frame cannot go on: the active scan has other ticks of a line, lines or steps of y; use "
    "--swap line or --swap frame",
    Reason.WITHDRAWN: "it was withdrawn, by an ABORT or a reset of the sequencer; upload again",
    Reason.READBACK: "there is nothing to read or keep: the scan came with the firmware, or a later upload uses its "
    "memory",
    Reason.TICKS: "no samples are requested from the sequencer; does the timer of the device run?",
    Reason.PLAYING: "it cannot write its flash while a scan plays; `tablegen park --wait` first",
    Reason.TRIAL: "no trial plays since the last start: `tablegen select SLOT --trial`, restart the device, and "
    "confirm; `tablegen slots` shows where it stands",
    Reason.FLASH: "its flash was not written as it should be, and it goes on with what it kept before; try again. "
    "If it happens again, the flash may be worn out",
}


_Z_BEGINS = (
    "one of the old scan and the new one has the output z, which begins and ends to play only where no scan plays; "
    "`tablegen park --wait` first, then the same upload, which is short, and `tablegen trigger`"
)


def refused(
    request: int,
    reason: int,
    detail: int,
    info: DeviceInfo | None = None,
    contents: "Contents | None" = None,
    limits: Limits | None = None,
) -> Refused:
    """Return the error for a refusal; what is known of the device and of the scan makes it more precise."""
    names = [known.name for known in Request if known == request]
    request_name = names[0] if names else f"request {request}"
    sentence = explain(reason, detail, info, contents, limits)
    if (request, reason) == (Request.COMMIT, Reason.PLAYING):
        sentence = _Z_BEGINS
    name = Reason(reason).name.lower() if reason in list(Reason) else str(reason)
    return Refused(request, reason, detail, f"the device refused {request_name} ({name}): {sentence}")


def lacks_mode(info: DeviceInfo, swap: CommitMode) -> str | None:
    """Return why a device cannot swap a scan in as asked; None if it can."""
    if swap is CommitMode.LINE or Feature.COMMIT_MODES in info.features:
        return None
    return (
        f"--swap {swap.name.lower()}: the device starts a new scan at the next line, from line 0; build its firmware "
        "with DAC_COMMIT_MODES=1, its FPGA with COMMIT_MODES=1, or use --swap line"
    )


def lacks_move(info: DeviceInfo, of_slow_parts: bool = False) -> str | None:
    """Return why a device does not take MOVE, or one of a program with slow parts; None if it does."""
    if More.MOVE not in info.more:
        return "the device takes no MOVE: build its firmware with DAC_MOVE=1 and DAC_COMMIT_MODES=1; FPGAs take none"
    if of_slow_parts and More.SLOW_MOVE not in info.more:
        return "the device moves no slow parts: give its link moved_gains of both axes"
    return None


def lacks_play(info: DeviceInfo) -> str | None:
    """Return why a device plays no programs by number; None if it does."""
    if More.PLAY in info.more:
        return None
    return (
        "the device plays no programs by number: build its firmware with DAC_LIBRARY=2, and with compiled programs or "
        "slots; FPGAs play none"
    )


def lacks_z(info: DeviceInfo) -> str | None:
    """Return why a device does not play the output z; None if it does."""
    if info.z is not None:
        return None
    return (
        "the scan has the output z, and the device has none: build its firmware with DAC_LINK_Z=1 and a second "
        "sequencer for z, or leave [z] out of the scan (FPGAs have none over their link)"
    )


def about_z(why: str) -> str:
    """Return what is said of the axes x and y as what it means of the second sequencer, whose x is z."""
    for name, of_z in (("x: ", "z: "), ("y: ", "the axis beside z: ")):
        if why.startswith(name):
            return of_z + why.removeprefix(name)
    return f"z: {why}"


def keyless(request: Request) -> Refused:
    """Return the error where a device has a key and the host has none; nothing was sent."""
    why = f"the device has a key, and refuses {request.name} without it; give the key of this device (--key-file FILE)"
    return Refused(request, Reason.KEY, 0, why)


def explain(
    reason: int,
    detail: int,
    info: DeviceInfo | None = None,
    contents: "Contents | None" = None,
    limits: Limits | None = None,
) -> str:
    """Explain what a refusal means, and what to do.

    ``info``, the active ``limits`` of x and y, and the ``contents`` of what was uploaded are used where they are given.
    A refusal of z (``OF_Z``) has its own limits, and no contents.
    """
    if detail & OF_Z:
        of_z = None if info is None or info.z is None else info.of_z
        of_build = None if of_z is None else (of_z.x_limits, of_z.y_limits)
        if reason == Reason.SCHEDULE:
            return "z: its lines, windows and pixels are not those of x and y, or out of range; build it again"
        return about_z(explain(reason, detail & ~OF_Z, of_z, None, of_build))
    if reason not in list(Reason):
        return f"reason {reason}, detail {detail}: this version of tablegen does not know it; update it"
    known = Reason(reason)
    if known in _MESSAGES:
        return _MESSAGES[known]
    axis, index = _AXES[detail & 1], detail >> 1
    if known in _AXIS_REASONS:
        return f"{axis}: {_AXIS_REASONS[known]}"
    if known in _SENTENCES:
        return _SENTENCES[known](detail, info)
    page = 1 + (detail & 1)
    allowed = limits[detail & 1] if limits is not None else None
    return f"{axis}: " + _CHECKS[known](page, index, contents, allowed)


def _key(detail: int, info: DeviceInfo | None) -> str:
    return "the tag is missing, wrong or too late; give the key of this device (--key-file FILE)"


def _version(detail: int, info: DeviceInfo | None) -> str:
    return f"the device speaks version {detail} of the protocol, this tablegen version {VERSION}; update the older one"


def _length(detail: int, info: DeviceInfo | None) -> str:
    most = info.image_bytes if info is not None else None
    if detail == most:
        return f"the device accepts images of at most {detail} bytes; upload --as fourier, or make the tables shorter"
    return f"the length of the image is wrong: it should have {detail} bytes, or at most that; build it again"


def _harmonics(detail: int, info: DeviceInfo | None) -> str:
    if not detail:
        return "the device does not support Fourier words; upload --as table"
    return f"the device supports at most {detail} harmonics; lower band_limit.harmonics, or upload --as table"


def _incomplete(detail: int, info: DeviceInfo | None) -> str:
    return f"the device has received {detail} bytes only; repeat the upload to continue"


def _slot(detail: int, info: DeviceInfo | None) -> str:
    return f"there is no such slot, or no program in it; the device has slots 0 to {detail - 1} (`tablegen slots`)"


def _number(detail: int, info: DeviceInfo | None) -> str:
    return f"there is no program of this number; the device has numbers 0 to {detail - 1} (`tablegen slots`)"


def _room(detail: int, info: DeviceInfo | None) -> str:
    return f"a slot has room for {detail} bytes, its tables included; make the tables shorter, or its slots larger"


def _generation(detail: int, info: DeviceInfo | None) -> str:
    return f"another scan became active meanwhile (generation {detail}); did another program upload?"


def _shaping(detail: int, info: DeviceInfo | None) -> str:
    has = "" if info is None else f" It has {_ORDERS.get(info.shaping, f'order {info.shaping}')}."
    return (
        f"{_AXES[detail & 1]}: the device cannot shape its output as this scan asks.{has} Build the device with the "
        "SHAPING of the scan, or set dac.shaping to what the device has"
    )


# Of dac_loaded in dac_sequencer.h; those that only the sequencer knows.
_SEQUENCER_REASONS = {
    3: "a line, a frame or the settling is shorter or longer than it plays (3)",
    4: "its table has another length than that of the device (4)",
    9: "the sequencer plays either scans at an angle alone, or none of them, as that which it was built for (9)",
}


def _other(detail: int, info: DeviceInfo | None) -> str:
    why = _SEQUENCER_REASONS.get(detail, f"for an internal reason ({detail})")
    return f"its sequencer refused the program: {why}; build for this device"


_SENTENCES: dict[Reason, Callable[[int, DeviceInfo | None], str]] = {
    Reason.KEY: _key,
    Reason.VERSION: _version,
    Reason.LENGTH: _length,
    Reason.HARMONICS: _harmonics,
    Reason.INCOMPLETE: _incomplete,
    Reason.REFUSED: _other,
    Reason.SHAPING: _shaping,
    Reason.SLOT: _slot,
    Reason.NUMBER: _number,
    Reason.ROOM: _room,
    Reason.GENERATION: _generation,
}


def _codes(page: int, index: int, contents: "Contents | None", limits: AxisLimits | None) -> str:
    codes = "" if contents is None else f" {contents.axis(page, 'code_min')}..{contents.axis(page, 'code_max')}"
    limit = "the limit" if limits is None else f"{limits.code_min}..{limits.code_max}"
    return f"its codes{codes} go beyond {limit} of the device; lower scanner and scan, or raise the limit in its build"


def _step(page: int, index: int, contents: "Contents | None", limits: AxisLimits | None) -> str:
    step = "" if contents is None else f" of {contents.axis(page, 'max_step')} codes a tick"
    limit = "the limit" if limits is None else str(limits.max_step)
    return f"its max_step{step} is beyond {limit} of the device; lower max_slew_v_per_s, or raise the limit"


def _word(page: int, index: int, contents: "Contents | None", limits: AxisLimits | None) -> str:
    value = _value(page, index, contents)
    if contents is not None and index >= len(contents.table(page)):
        return f"word {index} of its words, which is one of its slow part, is out of range; build it again"
    bits = "the table's width" if contents is None else f"{contents.shape(page).word_bits} bits"
    return f"word {index} of its table{value} does not fit {bits}; build it again"


def _pixel_ticks(page: int, index: int, contents: "Contents | None", limits: AxisLimits | None) -> str:
    way = "trace" if page == 1 else "retrace"
    return f"pixel {index} of the {way} has no tick, or the pixels do not fill their window; build it again"


def _range(page: int, index: int, contents: "Contents | None", limits: AxisLimits | None) -> str:
    ends = "code_min..code_max"
    if contents is not None:
        ends = f"codes {contents.axis(page, 'code_min')}..{contents.axis(page, 'code_max')}"
    return f"{_place(page, index, contents)}{_value(page, index, contents)} leads outside {ends}; build it again"


def _slew(page: int, index: int, contents: "Contents | None", limits: AxisLimits | None) -> str:
    step = "its max_step" if contents is None else f"its max_step of {contents.axis(page, 'max_step')} codes a tick"
    place = _place(page, index, contents)
    return f"at {place} it moves faster than {step}; scan slower or smaller, or raise max_slew_v_per_s"


def _place(page: int, index: int, contents: "Contents | None") -> str:
    """Name what a check of the table is about: a word, or with a slow part a line."""
    if contents is not None and contents.slow(page):
        return f"line {index} of its frame"
    return f"word {index} of its table"


def _jump(page: int, index: int, contents: "Contents | None", limits: AxisLimits | None) -> str:
    limit = "the limit" if limits is None else f"{limits.max_jump} codes"
    return (
        f"it begins further than {limit} of the device from where the playing scan may be; `tablegen park --wait` "
        "first, or raise the limit"
    )


_CHECKS: dict[Reason, Callable[[int, int, "Contents | None", AxisLimits | None], str]] = {
    Reason.CODES: _codes,
    Reason.STEP: _step,
    Reason.WORD: _word,
    Reason.PIXEL_TICKS: _pixel_ticks,
    Reason.RANGE: _range,
    Reason.SLEW: _slew,
    Reason.JUMP: _jump,
}


def _value(page: int, index: int, contents: "Contents | None") -> str:
    """Return the word itself, where it was sent as it is."""
    if contents is None or contents.axis(page, "harmonics") or contents.slow(page):
        return ""
    words = contents.table(page)
    return f" ({int(words[index])})" if index < len(words) else ""
