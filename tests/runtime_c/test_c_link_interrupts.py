"""Interrupts on every instruction of the C link's main loop, emulated: no byte and no answer is lost or torn."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from building import REPOSITORY
from link_images import random_image
from link_talk import Talk
from sets import long

from tablegen.base.resources import c_link, c_runtime
from tablegen.link.frames import Frame
from tablegen.link.messages import ANSWER, REFUSAL, DeviceInfo, DeviceStatus, Request
from tablegen.link.program_image import ProgramImage
from tablegen.verification.c.emulate import TRAP, Processor, compile_bare
from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.rest

SHAPE = SequencerShape(16, 1, 5, 16, 1, 4, 16)
RING = 512
MEMORY = REPOSITORY / "examples" / "firmware" / "memory.c"


def conversation(images: Sequence[ProgramImage]) -> tuple[bytes, int]:
    """Uploads, each with noise in front, and what reads them back; and how many bytes are answered at least."""
    talk = Talk()
    wires, answered = [talk.hello()], 2 + 10 + DeviceInfo.LAYOUT.size + DeviceStatus.LAYOUT.size
    for image in images:
        parts = [*talk.upload(image, 37)]
        wires += [b"\x05\x01\0\0\0", *parts, talk.commit(image)]
        answered += 16 * len(parts) + 20
        # The commit takes a tick: what cannot be told before it is asked many frames later.
        wires += [talk.request(Request.LIMITS) for _ in range(12)]
        answered += 12 * 44
        for at in range(0, len(image.data), 101):
            wires.append(talk.request(Request.READBACK, struct.pack("<IB", at, 101)))
            answered += 16 + min(101, len(image.data) - at)
    return b"".join(wires), answered


class Landings:
    """The link's main loop, interrupted on every instruction that it executes, once each, and at random."""

    def __init__(self, folder: Path, script: bytes, answered: int, changes: dict[str, tuple[str, str]]) -> None:
        folder.mkdir(exist_ok=True)
        (folder / "setup.h").write_text(f"enum {{ SCRIPT = {len(script)}, ANSWERED = {answered} }};\n")
        sources = [folder / path.name for path in (*c_runtime(), *c_link())]
        for path in (*c_runtime(), *c_link()):
            text = path.read_text("utf-8")
            if path.name in changes:
                old, new = changes[path.name]
                assert text.count(old) == 1
                text = text.replace(old, new)
            (folder / path.name).write_text(text, "utf-8")
        bench = folder / "link_landings.c"
        bench.write_text((REPOSITORY / "tests" / "helpers" / "link_landings.c").read_text("utf-8"), "utf-8")
        self.processor = Processor(
            compile_bare(folder / "landings.elf", [*sources, bench, MEMORY], macro_values={"DAC_LINK_RING": RING})
        )
        self.script = script
        self.landed: set[int] = set()
        self.landings = 0

    def play(self, seed: int, share: float) -> bytes:
        """Run the main loop until all is answered; returns what it has sent."""
        import unicorn
        from unicorn import arm_const

        uc, processor = self.processor.uc, self.processor
        processor.call("power_up")
        processor.write("script", self.script)
        rng = np.random.default_rng(seed)
        state: dict[str, Any] = {"main": True, "resumed": -1}

        def code(_uc: object, address: int, size: int, data: object) -> None:
            again, state["resumed"] = address == state["resumed"], -1
            if state["main"] and not again and (address not in self.landed or rng.random() < share):
                self.landed.add(address)
                processor.uc.emu_stop()

        uc.reg_write(arm_const.UC_ARM_REG_SP, processor.stack_top)
        pc, end = processor.symbol("main_loop"), processor.symbol("landing_end")
        hook = uc.hook_add(unicorn.UC_HOOK_CODE, code)
        most = self.landings + 60 * len(self.script)
        while pc != end and self.landings < most:
            uc.emu_start(pc | 1, end)
            pc = uc.reg_read(arm_const.UC_ARM_REG_PC)
            if pc == end:
                break
            state["main"] = False
            self.landings += 1
            before = uc.context_save()
            uc.reg_write(arm_const.UC_ARM_REG_XPSR, 0x01000000)
            uc.reg_write(arm_const.UC_ARM_REG_SP, (uc.reg_read(arm_const.UC_ARM_REG_SP) - 32) & ~7)
            uc.reg_write(arm_const.UC_ARM_REG_LR, TRAP | 1)
            processor.run(processor.symbol("interrupt"), TRAP)
            uc.context_restore(before)
            state |= {"main": True, "resumed": pc}
        uc.hook_del(hook)
        return processor.read("sent", processor.word("sent_bytes"))


def images() -> list[ProgramImage]:
    rng = np.random.default_rng(4)
    return [random_image(rng, SHAPE)[0] for _ in range(2)]


def hold(sent: bytes) -> None:
    """Every request was answered, in order, and read back is what was sent."""
    talk = Talk()
    answers: list[Frame] = talk.answers(sent)
    assert talk.reader.bad_frames == 0
    assert [frame for frame in answers if frame.type == REFUSAL] == []
    commits = [struct.unpack("<II", each.payload)[0] for each in answers if each.type == Request.COMMIT | ANSWER]
    assert commits == [1, 2]
    read = b"".join(frame.payload[4:] for frame in answers if frame.type == Request.READBACK | ANSWER)
    assert read == b"".join(image.data for image in images())


@pytest.mark.parametrize("seeds", long([1], [1, 3]))
def test_an_interrupt_may_land_on_any_instruction(seeds: int, tmp_path: Path) -> None:
    landings = Landings(tmp_path, *conversation(images()), {})
    for seed in range(seeds):
        hold(landings.play(seed, 0.01))
    executable = landings.processor.executable
    assert landings.landings > 4000
    for name in ("dac_link_work", "dac_link_store", "dac_link_read_byte", "dac_link_settle"):
        first, size = executable.symbols[name] & ~1, executable.sizes[name]
        assert sum(first <= each < first + size for each in landings.landed) > size // 8, name


def test_an_answer_that_leaves_before_it_is_sealed_is_found(tmp_path: Path) -> None:
    """A negative control."""
    old = "    l->out[1] = a->type;\n"
    new = "    l->out_length = (uint16_t)(a->length + 12);\n    l->out_at = 0;\n    l->sending = 1;\n" + old
    landings = Landings(tmp_path, *conversation(images()), {"dac_link_answer.c": (old, new)})
    with pytest.raises(AssertionError):
        hold(landings.play(0, 0.01))
