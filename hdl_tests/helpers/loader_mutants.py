"""Faults put into the program of the loader's processor, each of which the tests have to find.

A mutant is the program with one piece of its text replaced; text that is found no more, or found twice, is an error.
"""

from dataclasses import dataclass

from loader_bridge import assembler

_CHECKS, _FRAMES, _REQUESTS, _UPLOAD = "checks.s", "frames.s", "requests.s", "upload.s"
_NOTHING = "setregion"  # that matters: a region is set before each use


@dataclass(frozen=True)
class Mutant:
    """What is put in place of what in a source, and what that breaks; ``by`` finds it."""

    breaks: str
    source: str
    old: str
    new: str
    by: str
    also: tuple[str, str] | None = None  # the same in another place

    def words(self) -> list[int]:
        """The program with the fault in it."""
        sources = {name: (assembler.HERE / name).read_text("ascii") for name in assembler.SOURCES}
        text = _lines(sources[self.source])
        for old, new in ((self.old, self.new), *([self.also] if self.also else [])):
            if text.count(_lines(old)) != 1:
                raise ValueError(f"{self.source} has {text.count(_lines(old))} times: {old}")
            text = text.replace(_lines(old), _lines(new))
        sources[self.source] = text
        return assembler.read(sources).words()


def _lines(text: str) -> str:
    """An instruction or a label a line, without comments; `` / `` separates those of a mutant."""
    bare = "\n".join(line.partition(";")[0] for line in text.replace(" / ", "\n").splitlines())
    return "".join(f"{line.strip()}\n" for line in bare.replace(":", ":\n").splitlines() if line.strip())


TABLE, SEQUENCE = "A table, with everything that can go wrong on the way", "Sequence numbers"
BEGIN, INTERLOCK = "BEGIN that is refused", "The interlock"

MUTANTS = (
    Mutant("the CRC of a frame is not checked", _FRAMES, "cmp4 [p] / jz good", "cmp4 [p] / jmp good", "random"),
    Mutant("the CRC of the image is not checked", _UPLOAD, "cmp4 info_crc / jz schedule", "jmp schedule", "uploads"),
    Mutant("the offset is ignored", _UPLOAD, "cmp4 received / jnz begun", f"cmp4 received / {_NOTHING}", TABLE),
    Mutant(
        "the interlock is ignored",
        _UPLOAD,
        "complete: / ld1 IN_PERMIT / jz not_permitted",
        "complete:",
        INTERLOCK,
        ("ld1 IN_PERMIT / jz not_permitted / ld1 IN_NO_KEEP", "ld1 IN_NO_KEEP"),
    ),
    Mutant(
        "a request that comes again acts again",
        _REQUESTS,
        "and #0xff / jz same",
        f"and #0xff / {_NOTHING}",
        SEQUENCE,
    ),
    Mutant("a request that was overtaken acts", _REQUESTS, "cmp #129 / jc overtaken", "cmp #129", SEQUENCE),
    Mutant(
        "code_min may be one less",
        _CHECKS,
        "ld4 t0 / cmp4 [p] / jnc no_codes",
        "ld4 t0 / add #1 / cmp4 [p] / jnc no_codes",
        "limits",
    ),
    Mutant(
        "code_max may be one more",
        _CHECKS,
        "ld4 [p] / cmp4 t1 / jnc no_codes",
        "ld4 [p] / add #1 / cmp4 t1 / jnc no_codes",
        "limits",
    ),
    Mutant("max_step may be one more", _CHECKS, "cmp4 t2 / jnc no_step", "add #1 / cmp4 t2 / jnc no_step", "limits"),
    Mutant(
        "a program that waits is given up",
        _FRAMES,
        "ld1 IN_WRITABLE / jz receive",
        "ld1 IN_WRITABLE / jnz receive",
        "random",
    ),
    Mutant("any session will do", _REQUESTS, "cmp4 session / jnz no_session", "cmp4 session", "First words"),
    Mutant(
        "another image goes on where the last one was",
        _UPLOAD,
        "ld #0 / st4 received / st4 done_bytes",
        "ld #0 / st4 done_bytes",
        TABLE,
    ),
    Mutant(
        "memory that a later upload uses is read back",
        _UPLOAD,
        "st4 received / st4 done_bytes",
        "st4 received",
        "random",
    ),
    Mutant("a shape of y is not looked at", _UPLOAD, "cmp4 y_shape / jnz no_shape", "cmp4 y_shape", BEGIN),
    Mutant("an image may be too long", _UPLOAD, "jz in_room / jc no_length", "jz in_room", BEGIN),
    Mutant(
        "the length is not that of the program",
        _UPLOAD,
        "cmp4 info_bytes / jz begun / call forget",
        "cmp4 info_bytes / jmp begun / call forget",
        "uploads",
    ),
    Mutant("frames without end are taken", _FRAMES, "ld1 too_long / jnz bad", "ld1 too_long", "frames"),
    Mutant("frames of no length are taken", _FRAMES, "sub #11 / jnc bad", "sub #11", "frames"),
    Mutant("a distance past the end is not seen", _FRAMES, "ld1 left / jnz bad", "ld1 left", "frames"),
    Mutant("a remainder is not looked at", _CHECKS, "add #1 / jnz no_period", "add #1", "uploads"),
    Mutant(
        "products beyond 32 bits are cut",
        _CHECKS,
        "call multiply / ld1 rest / jnz no_period",
        "call multiply",
        "uploads",
    ),
    Mutant("a window may end outside", _CHECKS, "ld4 t1 / at_least:", "ld4 t1 / ret / at_least:", "uploads"),
    Mutant(
        "pixels of the trace are not checked",
        _CHECKS,
        "ldp FORWARD_COUNT / call ticks_of_pixels",
        "",
        "pixels",
    ),
    Mutant("pixels of the retrace are not checked", _CHECKS, "ldp BACKWARD_COUNT / call ticks_of_pixels", "", "pixels"),
    Mutant(
        "a window without ticks has no pixels", _CHECKS, "ld4 [p] / jnz at_least", "ld4 [p] / jmp at_least", "pixels"
    ),
    Mutant("a period of y is that of its steps", _CHECKS, "ld4 [p] / jz of_frame", f"ld4 [p] / {_NOTHING}", "uploads"),
    Mutant("steps of y are lost", _CHECKS, "ld4 t3 / st4 answer+4", "ld4 t3", "uploads"),
    Mutant("a word may have more bits", _CHECKS, "cmp4 t3 / jc wide_word", "cmp4 t3", "uploads"),
    Mutant("a park code may lie outside", _CHECKS, "cmp4 t2 / jnc no_output / jmp checked", "jmp checked", "uploads"),
    Mutant("settle_lines may be 256", _CHECKS, "ld #255 / cmp4 [p]", "ld #255 / add #1 / cmp4 [p]", "settle lines"),
    Mutant("a program that does not fit stays", _CHECKS, "ld #WITHDRAW / request", "ld #0 / request", "refused"),
    Mutant("the sequencer's refusal is not told", _UPLOAD, "ld1 IN_GONE", "ld #25", "refused"),
    Mutant("an ABORT is told as a refusal", _UPLOAD, "ld1 aborting / jnz by_abort", "ld1 aborting", "refused"),
    Mutant("an ABORT does not withdraw", _UPLOAD, "ld #WITHDRAW / request", "ld #0 / request", "uploads"),
    Mutant(
        "a late answer goes to the wrong session",
        _UPLOAD,
        "ld4 pending_asker / st4 asker",
        "ld4 session / st4 asker",
        "uploads",
    ),
)
