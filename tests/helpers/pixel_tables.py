"""Images of programs that have a table of pixels."""

from link_images import digest, resealed
from numpy.random import Generator
from programs import random_schedule, with_table
from replacing import replace

from tablegen.device.dual_program import ScanProgram
from tablegen.device.registers import PIXEL_TABLE_WORD, SCAN_WORDS
from tablegen.device.schedule import Schedule
from tablegen.link.program_image import PIXEL_BYTES, ProgramImage, make_image

PIXELS = SCAN_WORDS.index("pixels")


def long_windows(rng: Generator, ticks: int, lines: int) -> Schedule:
    """A schedule whose windows both have ticks; a line has two at least."""
    while True:
        schedule = random_schedule(rng, ticks, lines)
        if min(schedule.forward.count, schedule.backward.count):
            return schedule


def table_image(rng: Generator, program: ScanProgram) -> ProgramImage:
    """The image of a program with a table of pixels, where its windows have room for one."""
    return make_image(replace(program, schedule=with_table(rng, program.schedule)), digest(rng))


def damaged_table(rng: Generator, image: ProgramImage) -> ProgramImage:
    """The image with other ticks of one or two pixels, which may still fill their windows; of the same length."""
    data = bytearray(image.data)
    pixels = int.from_bytes(data[4 * PIXELS : 4 * PIXELS + 4], "little")
    if not data[4 * PIXEL_TABLE_WORD]:
        return image
    first = len(data) - 2 * PIXEL_BYTES * pixels + PIXEL_BYTES * pixels * int(rng.integers(0, 2))
    one, other = (first + PIXEL_BYTES * int(at) for at in rng.integers(0, pixels, 2))
    moved = int(rng.choice([1, 1, 2, 255, 65535]))
    for at, by in ((one, -moved), (other, moved))[int(rng.integers(0, 2)) :]:
        ticks = int.from_bytes(data[at : at + PIXEL_BYTES], "little") + by
        data[at : at + PIXEL_BYTES] = (ticks & 0xFFFF).to_bytes(PIXEL_BYTES, "little")
    return resealed(image, bytes(data))
