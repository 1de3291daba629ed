"""The constants of a build by name, the same in every language."""

from tablegen.device.schedule import Schedule
from tablegen.emit.content import Content
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import Shaping
from tablegen.fixedpoint.synthesis import FRACTION_BITS

# Constants that may need more than 32 bits: languages that give constants a type give these a wide one in every build.
WIDE = frozenset({"UPDATE_RATE_MILLIHZ", "PHASE_STEP", "OFFSET_WORD"})

LEAST_STORAGE_BITS = 16  # of words in memory of the C, which a runtime has by default
LEAST_INDEX_BITS = 2  # of a sequencer in Verilog
DEGREES = {"direct": 0, "interpolated": 1, "cubic": 3}  # value of INTERPOLATED: the degree between words


def scan_constants(content: Content) -> dict[str, int]:
    """Return all numbers of a build by their names without the scan's: those of the schedule, then X_... and Y_..."""
    constants = sequence_constants(content.schedule)
    for axis in content.axes:
        own = axis_constants(axis.program, axis.harmonics)
        constants |= {f"{axis.axis.upper()}_{key}": value for key, value in own.items()}
    return constants | shaping_constants(content)


def shaping_constants(content: Content) -> dict[str, int]:
    """Return the highest order of shaping, which a device must have; nothing where neither axis shapes."""
    highest = max(axis.program.output.shaping.order for axis in content.axes)
    return {"SHAPING": highest} if highest else {}


def pixel_constants(schedule: Schedule) -> dict[str, int]:
    """Return the address bits of the memory of a table of pixels in Verilog; 0 where pixels are equal."""
    return {"PIXEL_INDEX_BITS": pixel_index_bits(0 if schedule.pixel_table is None else schedule.pixels)}


def pixel_index_bits(pixels: int) -> int:
    """Return the address bits of a memory of the ticks of so many pixels a sweep; 0 for none."""
    return max((2 * pixels - 1).bit_length(), LEAST_INDEX_BITS) if pixels else 0


def verilog_constants(content: Content) -> dict[str, int]:
    """Return all numbers of a build as Verilog takes them: ``SHAPING`` and those of axes are there where it is off."""
    constants = sequence_constants(content.schedule) | {"SHAPING": 0} | shaping_constants(content)
    constants |= pixel_constants(content.schedule)
    for axis in content.axes:
        own = verilog_axis_constants(axis.program, axis.harmonics)
        constants |= {f"{axis.axis.upper()}_{key}": value for key, value in own.items()}
    return constants


def verilog_axis_constants(program: Program, harmonics: int) -> dict[str, int]:
    """Return ``axis_constants`` with the order and zero of an unshaped axis, and the index bits of a direct table."""
    own = {"SHAPING_ORDER": 0, "SHAPING_ZERO": 0}
    return (
        axis_constants(program, harmonics)
        | own
        | _own_shaping(program.output.shaping)
        | {"INDEX_BITS": memory_index_bits(program)}
    )


def memory_index_bits(program: Program) -> int:
    """Return the address bits of a table's memory in a sequencer; a direct table need not fill its memory."""
    if program.mode != "direct":
        return program.index_bits
    return max((len(program.words) - 1).bit_length(), LEAST_INDEX_BITS)


def sequence_constants(schedule: Schedule) -> dict[str, int]:
    """Return the constants of the scan: ticks, lines and pixels."""
    return {
        "UPDATE_RATE_MILLIHZ": schedule.update_rate_millihz,
        "LINE_TICKS": schedule.ticks,
        "FRAME_LINES": schedule.lines,
        "PIXELS": schedule.pixels,
        "SETTLE_LINES": schedule.settle_lines,
        "TURN_TICK": schedule.turn_tick,
        "FORWARD_FIRST_TICK": schedule.forward.first,
        "FORWARD_TICKS": schedule.forward.count,
        "BACKWARD_FIRST_TICK": schedule.backward.first,
        "BACKWARD_TICKS": schedule.backward.count,
        "TURN_LINE": schedule.turn_line,
        "UP_FIRST_LINE": schedule.up.first,
        "UP_LINES": schedule.up.count,
        "DOWN_FIRST_LINE": schedule.down.first,
        "DOWN_LINES": schedule.down.count,
    }


def axis_constants(program: Program, harmonics: int) -> dict[str, int]:
    """Return the constants of an axis, whose table comes from so many harmonics."""
    output = program.output
    return {
        "TABLE_LENGTH": len(program.words),
        "TABLE_BITS": program.bits,
        "INDEX_BITS": program.index_bits,
        "INTERPOLATED": DEGREES[program.mode],
        "GUARD_BITS": program.guard,
        "HARMONICS": harmonics,
        "FOURIER_LENGTH": 2 * harmonics + 1,
        "FOURIER_FRACTION_BITS": FRACTION_BITS,
        "HOLD_TICKS": program.hold,
        "PHASE_PERIOD": program.phase.ticks,
        "PHASE_STEP": program.phase.step,
        "PHASE_REMAINDER": program.phase.remainder,
        "GAIN_WORD": output.gain_word,
        "GAIN_Q": output.gain_q,
        "OFFSET_WORD": output.offset_word,
        "OFFSET_CODE": output.offset_code,
        "CODE_MIN": output.code_min,
        "CODE_MAX": output.code_max,
        "MAX_STEP": output.max_step,
        "PARK_CODE": output.park_code,
        "DAC_BITS": output.dac_bits,
        "DAC_WORD_BITS": output.word_bits,
        "DAC_TWOS_COMPLEMENT": int(output.coding == "twos-complement"),
        "DAC_LEFT_ALIGNED": int(output.align == "left"),
        **({"DAC_OUTPUT": "AB".index(output.channel)} if output.channel else {}),
        **_own_shaping(output.shaping),
    }


def _own_shaping(shaping: Shaping) -> dict[str, int]:
    return {"SHAPING_ORDER": shaping.order, "SHAPING_ZERO": shaping.zero} if shaping.order else {}


def is_wide(name: str) -> bool:
    """Return True if a constant of this name, with X_ or Y_ before it or not, has 64 bits; all others fit 32."""
    return name.removeprefix("X_").removeprefix("Y_") in WIDE


def storage_bits(bits: int) -> int:
    """Return the bits in which the C holds table words, or converter words, of so many bits."""
    return LEAST_STORAGE_BITS if bits <= LEAST_STORAGE_BITS else 32
