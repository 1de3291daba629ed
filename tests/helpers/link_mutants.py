"""Faults put into the C link, each of which the tests have to find; run as a program it lists them.

A mutant is a file with one piece of text replaced. It is compiled into a device and tried with dialogues against the
model, with programs against their specification, and with what ``test_c_link_parts`` asks, until one fails.
"""

import faulthandler
import signal
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import link_trials
from building import run_clean
from c_library import PROBE
from limits import ENDED, limit
from link_device import HERE, LINES

from tablegen.base.resources import c_link, c_runtime

TRY_S = 120  # of CPU time; what does not hang takes ten
_FORK = get_context("fork")  # nothing is imported again
_OPTIONS = [
    "-std=c99", "-O0", "-fPIC", "-DDAC_TABLE_STORAGE_BITS=16", "-DDAC_OUTPUT_STORAGE_BITS=16", "-DDAC_STRIDE=2",
]  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """What is put in place of what in a file, and what that breaks."""

    breaks: str
    file: str
    old: str
    new: str

    @property
    def source(self) -> str:
        """The text of the file with the fault in it."""
        text = next(path for path in (*c_runtime(), *c_link()) if path.name == self.file).read_text("utf-8")
        if text.count(self.old) != 1:
            raise ValueError(f"{self.file} has {text.count(self.old)} times: {self.old}")
        return text.replace(self.old, self.new)


def _sources(folder: Path) -> list[Path]:
    return [folder / path.name for path in (*c_runtime(), *c_link()) if path.suffix == ".c"]


def _compile(folder: Path, names: list[Path]) -> None:
    run_clean(["gcc", *_OPTIONS, f"-I{folder}", f"-I{LINES}", f"-I{HERE}", "-c", *names], folder)


class Workshop:
    """The device, compiled once; of a mutant only its own file is compiled again, of a header all."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        for path in (*c_runtime(), *c_link()):
            (folder / path.name).write_bytes(path.read_bytes())
        _compile(folder, [*_sources(folder), PROBE, HERE / "link_device.c"])
        self._objects = {path: path.read_bytes() for path in folder.glob("*.o")}

    def library(self, mutant: Mutant | None) -> Path:
        """A device with a mutant in it or with none."""
        path = self.folder / (mutant.file if mutant else "none")
        before = path.read_bytes() if mutant else b""
        if mutant:
            path.write_text(mutant.source, "utf-8")
            whole = [*_sources(self.folder), PROBE, HERE / "link_device.c"]
            _compile(self.folder, whole if path.suffix == ".h" else [path])
        library = self.folder / "device.so"
        library.unlink(missing_ok=True)
        run_clean(["gcc", "-shared", *self._objects, "-o", library])
        if mutant:
            path.write_bytes(before)
            for each, content in self._objects.items():
                each.write_bytes(content)
        return library

    def judge(self, mutant: Mutant | None) -> str:
        """How a mutant was found; empty if it was not."""
        told, tell = _FORK.Pipe(duplex=False)
        process = _FORK.Process(target=_try, args=(self.library(mutant), tell))
        process.start()
        tell.close()
        process.join()
        if process.exitcode == ENDED:
            return "hangs"
        if told.poll():
            try:
                return str(told.recv())
            except EOFError:
                pass
        return f"ends with {process.exitcode}"


def _try(library: Path, tell) -> None:  # type: ignore[no-untyped-def]
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    limit(TRY_S)
    faulthandler.disable()  # some mutants crash, and that is all there is to know
    tell.send(link_trials.failure(library))


def judge_all(folder: Path, mutants: list[Mutant]) -> Iterator[tuple[Mutant, str]]:
    """Every mutant and how it was found."""
    workshop = Workshop(folder)
    for mutant in mutants:
        yield mutant, workshop.judge(mutant)


FRAME, IMAGE, CHECK, LINK = "dac_link_frame.c", "dac_link_image.c", "dac_link_check.c", "dac_link.c"
UPLOAD, REQUESTS, MAC, PARTS = "dac_link_upload.c", "dac_link_requests.c", "dac_link_mac.c", "dac_link_parts.h"
KEY = "dac_link_key.c"
MUTANTS = [
    Mutant("the CRC of a frame is not checked", FRAME, " && r->crc == WHOLE;", ";"),
    Mutant("a distance may lead past the end", FRAME, "r->left == 0 && r->length", "r->length"),
    Mutant("a frame may be too long", FRAME, "if (r->length == DAC_LINK_FRAME)", "if (r->length == 255)"),
    Mutant("DATA without bytes", LINK, "good = length > 4;", "good = length >= 4;"),
    Mutant("every upload goes into the same tables", UPLOAD, "(uint8_t)dac_sequencer_idle(l->sequencer)", "0"),
    Mutant("a frame may be too short", FRAME, "r->length >= DAC_LINK_SHORTEST", "r->length >= 4"),
    Mutant("nothing is counted as a frame", FRAME, "    if (empty)\n        return DAC_LINK_MORE;\n", ""),
    Mutant("a wrong frame spoils the next", FRAME, "        r->wrong = false;\n", ""),
    Mutant("zeros are not put back", FRAME, "        add(r, 0);\n", ""),
    Mutant("the CRC of an answer is wrong", FRAME, "wire + length + 1, ~crc", "wire + length + 1, crc"),
    Mutant("the highest byte comes first", FRAME, "value >> 8 * i", "value >> (24 - 8 * i)"),
    Mutant("bad frames are not counted", LINK, "            l->bad_frames++;\n", "            ;\n"),
    Mutant(
        "the ring overflows",
        LINK,
        "(uint8_t)(head / BLOCK - l->freed) >= 128",
        "(uint8_t)(head / BLOCK - l->freed) > 200",
    ),
    Mutant("lost bytes are not counted", LINK, "        l->lost = l->lost + 1;\n", ""),
    Mutant(
        "an answer is written over", LINK, "    } else if (!l->sending) {\n        for", "    } else {\n        for"
    ),
    Mutant("a request of another session is heard", LINK, "|| dac_link_get(frame + 2) != l->session", "|| false"),
    Mutant("a request before any session is heard", LINK, "(!l->opened || ", "("),
    Mutant("an unknown request is heard", LINK, "|| request > KNOWN\n", "|| request > 200\n"),
    Mutant("a challenge without a key", LINK, "l->config->key_bytes == 0))\n", "false))\n"),
    Mutant(
        "an echo is answered", LINK, "    if ((request & DAC_LINK_ANSWER) != 0)\n        return; /* an echo */\n", ""
    ),
    Mutant("the version is not looked at", LINK, "length != 0 && payload[0] != VERSION", "false"),
    Mutant("a payload may have any length", LINK, "return good ? dac_link_fine()", "return true ? dac_link_fine()"),
    Mutant("READBACK of nothing", LINK, "payload[4] >= 1 && ", ""),
    Mutant("frames without bound", LINK, "good = dac_link_get(payload) <= MOST_FRAMES;", "good = true;"),
    Mutant(
        "a repeated request acts again", LINK, "*again = behind == 0 && request == l->last.request;", "*again = false;"
    ),
    Mutant("the sequence is ignored", LINK, "    if (l->last.known) {\n", "    if (false) {\n"),
    Mutant("an old number acts", LINK, "        if (behind < 128)\n", "        if (behind < 1)\n"),
    Mutant("a number half way round is old", LINK, "behind < 128", "behind < 129"),
    Mutant(
        "a number with another type is told again", LINK, "behind == 0 && request == l->last.request", "behind == 0"
    ),
    Mutant("the answer is not kept", LINK, "        if (acts && a.type != DAC_LINK_SILENT)\n", "        if (false)\n"),
    Mutant("a nonce is used again", LINK, "    l->challenged = false;\n    return challenged", "    return challenged"),
    Mutant("a nonce is not asked for", LINK, "return challenged && DAC_LINK_HEADER", "return DAC_LINK_HEADER"),
    Mutant(
        "half a tag is enough",
        PARTS,
        "for (unsigned i = 0; i < count; i++)\n        differ",
        "for (unsigned i = 0; i < count / 2; i++)\n        differ",
    ),
    Mutant(
        "a bit of a tag does not count",
        PARTS,
        "differ |= (unsigned)(a[i] ^ b[i]);",
        "differ |= (unsigned)(a[i] ^ b[i]) & 0x7Fu;",
    ),
    Mutant("a tag is not looked at", KEY, "return dac_link_same(right, tag, DAC_LINK_TAG);", "return true;"),
    Mutant("the tag does not cover the nonce", KEY, "    dac_link_mac_add(&m, nonce, sizeof l->nonce);\n", ""),
    Mutant(
        "the tag does not cover the image",
        KEY,
        "    if (digest != NULL)\n        dac_link_mac_add",
        "    if (false)\n        dac_link_mac_add",
    ),
    Mutant("a COMMIT needs no tag", CHECK, "return good_tag(l) ? check_program(l)", "return true ? check_program(l)"),
    Mutant("a COMMIT needs no challenge", CHECK, "return l->commit_challenged && ", "return "),
    Mutant("a COMMIT leaves the nonce", UPLOAD, "    l->challenged = false;\n", ""),
    Mutant("a number refused by key is used", UPLOAD, "        l->last = l->before_commit;\n", ""),
    Mutant("the same challenge each time", KEY, "++l->challenges", "l->challenges"),
    Mutant("challenges have no identity", KEY, "    dac_link_mac_add(&m, c->identity, c->identity_bytes);\n", ""),
    Mutant("random numbers are not used", KEY, "        c->random(some);\n", "        (void)some;\n"),
    Mutant("challenges last for ever", LINK, "    dac_link_expire(l);\n", ""),
    Mutant("a challenge lasts a millisecond longer", KEY, ">= DAC_LINK_CHALLENGE_MS", "> DAC_LINK_CHALLENGE_MS"),
    Mutant("a challenge's age is that of the clock", KEY, "milliseconds() - l->challenged_at", "milliseconds()"),
    Mutant("a key of any length", KEY, "c->key_bytes < 16 || c->key_bytes > 32 || ", ""),
    Mutant("a key that is not there", KEY, " || c->key == NULL", ""),
    Mutant(
        "a key without an identity", KEY, "        return DAC_LINK_NO_IDENTITY;\n", "        return DAC_LINK_STARTED;\n"
    ),
    Mutant("a key without random numbers", KEY, "if (c->random == NULL && !c->boot_persists)", "if (false)"),
    Mutant("a key with a boot count, or with random numbers", KEY, "random == NULL && !c", "random == NULL || !c"),
    Mutant("a key without a clock", KEY, "c->milliseconds == NULL ? DAC_LINK_NO_CLOCK : ", ""),
    Mutant("limits in the wrong order", LINK, " && limits->code_min <= limits->code_max", ""),
    Mutant("limits beyond the converter", LINK, "limits->code_max < UINT32_C(1) << axis->converter.bits", "true"),
    Mutant("a limit of no step", LINK, " && limits->max_step != 0", ""),
    Mutant("tables without room", LINK, " && axis->room >= DAC_TABLE_ROOM(axis->index_bits)", ""),
    Mutant("one table for both", LINK, " && axis->table[0] != axis->table[1]", ""),
    Mutant("a table is missing", LINK, "axis->table[0] != NULL && axis->table[1] != NULL && ", ""),
    Mutant("words that their storage does not hold", LINK, " && axis->word_bits <= DAC_TABLE_STORAGE_BITS", ""),
    Mutant("converters of any width", LINK, "dac_axis_serves(&axis->converter) && ", ""),
    Mutant("a link that was not started works", LINK, "    if (l->config == NULL)\n        return false;\n", ""),
    Mutant(
        "a table from the link has no word behind its last",
        CHECK,
        "            table[part->words + i] = table[i];",
        "            ;",
    ),
    Mutant("the same challenges after each start", KEY, "dac_link_put(count, l->boot)", "dac_link_put(count, 0)"),
    Mutant("BLAKE2s does not know its last block", MAC, "compress(m, UINT32_MAX);", "compress(m, 0);"),
    Mutant("BLAKE2s does not count", MAC, "    v[12] ^= m->count;", "    v[12] ^= 0;"),
    Mutant(
        "BLAKE2s compresses full blocks at once",
        MAC,
        "    m->block[m->used++] = byte;\n}",
        "    m->block[m->used++] = byte;\n"
        "    if (m->used == 64)\n        m->count += m->used, compress(m, 0), m->used = 0;\n}",
    ),
    Mutant("BLAKE2s has nine rounds", MAC, "round < 10", "round < 9"),
    Mutant(
        "the CRC of the image is not checked",
        CHECK,
        "const bool wrong = *done && ~c->crc !=",
        "const bool wrong = false && ~c->crc !=",
    ),
    Mutant(
        "the CRC is that of what came, not of memory",
        CHECK,
        "const uint8_t byte = dac_link_load_byte(l, &c->place);",
        "const uint8_t byte = dac_link_load_byte(l, &c->place);\n"
        "        c->crc = ~dac_link_get(l->image[l->idle].info + DAC_LINK_IMAGE_CRC);\n"
        "        if (c->place.part == 3)\n            break;",
    ),
    Mutant("schedules are not checked", CHECK, "    if (!good_schedule(image))\n", "    if (false)\n"),
    Mutant("a line may be too long", CHECK, "ticks <= UINT32_C(1) << 24 && ", ""),
    Mutant(
        "a window may lie outside",
        CHECK,
        "return first <= length && count <= length - first;",
        "return first <= length;",
    ),
    Mutant(
        "the turn is not checked",
        CHECK,
        "        && dac_link_program_word(image, 0, DAC_LINK_TURN_TICK) <= ticks\n",
        "",
    ),
    Mutant("pixels of the trace are not checked", CHECK, "has_pixels(image, DAC_LINK_FORWARD) && ", ""),
    Mutant("pixels of the retrace are not checked", CHECK, " && has_pixels(image, DAC_LINK_BACKWARD)\n", "\n"),
    Mutant("a window without ticks has no pixels", CHECK, "count == 0 || ", ""),
    Mutant("steps are not checked", CHECK, "\n        && dac_link_program_word(image, 0, DAC_LINK_Y_STEPS) <= 1;", ";"),
    Mutant("periods are not checked", CHECK, "        if (!good_period(l, image, axis))\n", "        if (false)\n"),
    Mutant(
        "the phase step is not checked",
        CHECK,
        "    return dac_link_program_word(image, axis + 1, word) == step\n",
        "    return true\n",
    ),
    Mutant(
        "the remainder is not checked",
        CHECK,
        "\n        && dac_link_program_word(image, axis + 1, word + 1) == remainder;",
        ";",
    ),
    Mutant("outputs are not checked", CHECK, "        if (!good_output(l, image, axis))\n", "        if (false)\n"),
    Mutant(
        "the gain is not checked",
        CHECK,
        "p->gain_word >= -(INT32_C(1) << 17) && p->gain_word < INT32_C(1) << 17\n        && ",
        "",
    ),
    Mutant("the offset is not checked", CHECK, "p->offset_word > -reach && p->offset_word < reach\n", "true\n"),
    Mutant("the park code is not checked", CHECK, "code_min <= park_code && park_code <= code_max && ", ""),
    Mutant("code limits of the device are not checked", CHECK, "return finding(DAC_LINK_CODES, axis, 0);", "continue;"),
    Mutant("code_min is not checked", CHECK, "DAC_LINK_CODE_MIN) < limits->code_min\n", "DAC_LINK_CODE_MIN) < 0\n"),
    Mutant(
        "code_max is one too much",
        CHECK,
        "DAC_LINK_CODE_MAX) > limits->code_max)",
        "DAC_LINK_CODE_MAX) > limits->code_max + 1)",
    ),
    Mutant("the step is not checked", CHECK, "return finding(DAC_LINK_STEP, axis, 0);", "continue;"),
    Mutant("sums of Fourier words are not checked", CHECK, "*done && c->sum >= UINT64_C(1) << 32 ?", "false ?"),
    Mutant("tables are not rendered", CHECK, "        render(l, axis);\n", ""),
    Mutant(
        "the words of a table are not checked",
        CHECK,
        "            return finding(DAC_LINK_WORD, axis, c->at);\n",
        "            continue;\n",
    ),
    Mutant(
        "ranges are not checked",
        CHECK,
        "            return finding(DAC_LINK_RANGE, axis, c->at);\n",
        "            continue;\n",
    ),
    Mutant("nothing may lie a code outside", CHECK, "#define OUTSIDE 1", "#define OUTSIDE 0"),
    Mutant(
        "slew of advances is not checked",
        CHECK,
        "        else if (distance(now, c->before) + excess > max_step)\n",
        "        else if (false)\n",
    ),
    Mutant(
        "slew from the end to the beginning is not checked",
        CHECK,
        "*done && distance(c->first, c->before) + excess > max_step ?",
        "false ?",
    ),
    Mutant("slew of segments is not checked", CHECK, "<= advances * (max_step + slack)\n", "<= UINT64_MAX\n"),
    Mutant("slew has no slack", CHECK, "(max_step + slack)", "(max_step)"),
    Mutant(
        "the last segment is not looked at",
        CHECK,
        "c->at + 1 == o.length ? 0 : c->at + 1",
        "c->at + 1 == o.length ? c->at : c->at + 1",
    ),
    Mutant(
        "jumps are not checked",
        CHECK,
        "return jump[0] > l->x_limits.max_jump ?",
        "return false ? dac_link_fine() : jump[0] > UINT32_MAX - 1 ?",
    ),
    Mutant("jumps of y are not checked", CHECK, "jump[1] > l->y_limits.max_jump ?", "false ?"),
    Mutant(
        "the jump of y is from its first word",
        CHECK,
        "c->lowest = c->at == 0 || word < c->lowest ? word",
        "c->lowest = c->at == 0 ? word",
    ),
    Mutant(
        "the jump is from the park code",
        CHECK,
        "if ((dac_sequencer_status(s).markers & DAC_PLAYING) == 0)",
        "if (true)",
    ),
    Mutant(
        "an axis is checked only", CHECK, "if (c->axis == 0 && BY_AXIS(c->stage))", "if (false && BY_AXIS(c->stage))"
    ),
    Mutant("the offset of DATA is ignored", UPLOAD, "dac_link_get(payload) == l->received && ", ""),
    Mutant("DATA beyond the image", UPLOAD, " && count <= bytes - l->received)", ")"),
    Mutant("BEGIN while a program waits", UPLOAD, "l->upload > DAC_LINK_RECEIVING || ", ""),
    Mutant("BEGIN before a bank is free", UPLOAD, " || !dac_sequencer_writable(l->sequencer))", ")"),
    Mutant("BEGIN of any length", UPLOAD, "bytes < DAC_LINK_PROGRAM || bytes > most", "false"),
    Mutant(
        "BEGIN of any shape",
        UPLOAD,
        "            return dac_link_because(DAC_LINK_SHAPE, axis);\n",
        "            continue;\n",
    ),
    Mutant(
        "BEGIN of the same image begins again",
        UPLOAD,
        "l->upload == DAC_LINK_NONE || !dac_link_same(",
        "true || !dac_link_same(",
    ),
    Mutant(
        "BEGIN looks at the CRC only",
        UPLOAD,
        "!dac_link_same(info, l->image[l->idle].info, sizeof l->image[0].info)",
        "!dac_link_same(info + 32, l->image[l->idle].info + 32, 8)",
    ),
    Mutant("harmonics are not checked", IMAGE, "        if (harmonics > most)\n", "        if (false)\n"),
    Mutant(
        "the length of direct tables is not checked",
        IMAGE,
        "if (dac_link_table_words(image, axis) > UINT32_C(1) << dac_link_axis_of(l, axis)->index_bits)",
        "if (false)",
    ),
    Mutant(
        "the length of an image is not checked",
        IMAGE,
        "return bytes == dac_link_get(",
        "return true || bytes == dac_link_get(",
    ),
    Mutant("READBACK tells of harmonics", IMAGE, "at.word % 64 / 4 == DAC_LINK_ORDER", "false"),
    Mutant(
        "READBACK of a boot program",
        UPLOAD,
        "    if (!l->uploaded)\n        return dac_link_because(DAC_LINK_READBACK",
        "    if (false)\n        return dac_link_because(DAC_LINK_READBACK",
    ),
    Mutant(
        "COMMIT of another image",
        UPLOAD,
        "    if (dac_link_get(l->image[l->idle].info + DAC_LINK_IMAGE_CRC) != crc)\n",
        "    if (false)\n",
    ),
    Mutant(
        "COMMIT of half an image",
        UPLOAD,
        "    if (l->received != dac_link_get(",
        "    if (false && l->received != dac_link_get(",
    ),
    Mutant(
        "the interlock is ignored",
        UPLOAD,
        "    if (!dac_link_permits(l))\n        return",
        "    if (false)\n        return",
    ),
    Mutant(
        "a COMMIT is answered before it is in force",
        UPLOAD,
        "            l->upload = DAC_LINK_WAITING;\n",
        "            l->upload = DAC_LINK_WAITING, l->swaps--;\n",
    ),
    Mutant("a COMMIT done is refused", UPLOAD, "if (!l->uploaded || dac_link_get(", "if (true || dac_link_get("),
    Mutant("the line is that of the new program", UPLOAD, "l->taken_line = l->line;", "l->taken_line = status.line;"),
    Mutant("ABORT leaves the program waiting", UPLOAD, "!dac_sequencer_withdraw(l->sequencer))", "false)"),
    Mutant(
        "ABORT leaves the upload",
        UPLOAD,
        "    l->upload = DAC_LINK_NONE;\n    a->length = 4;\n",
        "    a->length = 4;\n",
    ),
    Mutant("a refused upload stays", UPLOAD, "stays ? DAC_LINK_RECEIVING : DAC_LINK_NONE", "DAC_LINK_RECEIVING"),
    Mutant("an upload refused by the interlock is forgotten", UPLOAD, "why.reason == DAC_LINK_INTERLOCK || ", ""),
    Mutant("limits are not narrowed", REQUESTS, "    if (length != 0) {\n", "    if (false) {\n"),
    Mutant("limits are widened", REQUESTS, "code_min > most->code_min ? code_min : most->code_min", "code_min"),
    Mutant(
        "limits are widened upwards",
        REQUESTS,
        "least(dac_link_get(asked + 4), most->code_max)",
        "dac_link_get(asked + 4)",
    ),
    Mutant("HELLO begins a session again", REQUESTS, "if (!l->opened || session != l->session)", "if (true)"),
    Mutant("a new session keeps the last number", REQUESTS, "        l->last.known = false;\n", ""),
    Mutant(
        "the hash is that of the boot program",
        REQUESTS,
        "const bool uploaded = swapped || l->uploaded;",
        "const bool uploaded = false;",
    ),
    Mutant("a swap in mid-line", "dac_sequencer.c", "(s->running && s->tick != 0)", "false"),
]


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        alive = 0
        for mutant, found in judge_all(Path(folder), MUTANTS):
            alive += not found
            print(f"{'found' if found else 'ALIVE'}  {mutant.file}: {mutant.breaks}  {found[:100]}", flush=True)
    print(f"{len(MUTANTS)} mutants, {alive} not found")


if __name__ == "__main__":
    main()
