"""The C sequencer of a build on this machine or on an emulated Cortex-M: what a user would compile.

The bench is compiled with the emitted header and arrays and with the ``dac_*.c`` of the directory. A session is played
twice, a tick a call (``dac_sequencer_step``) and many ticks a call (``dac_sequencer_fill``).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from tablegen.emit.stored import stored_content
from tablegen.manifest.read import NotABuild, StoredBuild
from tablegen.verification.build_report import Outcome, PlayJob, differing_check
from tablegen.verification.c.bench import CRecord, require_compiler, script_words
from tablegen.verification.c.emulated import EMULATED, EmulatedPlayer
from tablegen.verification.c.frame_play import frame_checks
from tablegen.verification.c.host import HostPlayer, host_compiler
from tablegen.verification.c.program import c_program, header_constants
from tablegen.verification.checks.directory import some
from tablegen.verification.checks.played_checks import (
    Check,
    check_codes,
    check_faults,
    check_filled,
    check_no_faults,
    check_states,
    check_waveform,
    first_difference,
)
from tablegen.verification.coverage import unplayed_c
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.capture import make_capture, with_capture
from tablegen.verification.play.converter_words import pack_captures
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import SCRIPT, SequencerShape
from tablegen.verification.play.session import make_session
from tablegen.verification.play.stream import OUTPUTS, Script, read_states

_UNTOLD = ("armed", "running", OUTPUTS)  # flags that the status of the C sequencer does not have
_FRAMES_OF_Z = 2
_MAX_TABLE_WORDS = 1 << 17  # words of a direct table that dac_sequencer_load() accepts


@dataclass(frozen=True)
class CTarget:
    """The machine on which the C sequencer plays; with ``fourier`` it renders its tables from Fourier words."""

    machine: Literal["c", "cortex-m"]
    fourier: bool = False
    format_name: str = "c"

    def require(self) -> None:
        """Check that a compiler is installed, and the machine that runs its output."""
        if self.machine == "cortex-m":
            from tablegen.verification.c.emulate import require_emulator

            require_emulator()
        else:
            require_compiler(host_compiler())

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """Check that the runtime can play the tables; direct ones may be longer than it takes, and are not rendered.

        Raises
        ------
        NotABuild
            If a table is too long, Fourier words are to be rendered and both tables are direct, or an emulator would
            have to play the output z.
        """
        if stored.z is not None and self.machine == "cortex-m":
            raise NotABuild(f"{folder}: has the output z, which no emulator plays; verify it with --target c")
        for name, axis in stored.axes:
            if axis.table.mode == "direct" and len(axis.table.words) > _MAX_TABLE_WORDS:
                raise NotABuild(
                    f"{folder}: the table of {name} has {len(axis.table.words)} words, the C sequencer plays at most "
                    f"{_MAX_TABLE_WORDS}; mode = 'interpolated' needs fewer"
                )
        if self.fourier and not any(axis.table.mode != "direct" for _, axis in stored.axes):
            raise NotABuild(
                f"{folder}: both tables are direct, and no device renders those; verify it without --fourier"
            )

    def play(self, job: PlayJob) -> Outcome:
        """Play a session a tick a call, and the same session many ticks a call."""
        stored, work, progress = job.stored, job.work, job.progress
        program, absent = c_program(job.folder, work, stored, self.fourier)
        if absent:
            return Outcome([Check("program", self._name, "nothing", failure="program: " + some(absent))])

        progress("playing the integer model")
        session = make_session(stored.program, None, job.most_ticks, job.seed, Placement())
        script = session.script
        shape = SequencerShape.of((stored.program.x, stored.program.y))
        text = script_words(script, shape)  # which ends the script
        (work / SCRIPT).write_text(text, "ascii")
        ticks = len(script.expected)
        player = (
            EmulatedPlayer(work, program, shape)
            if self.machine == "cortex-m"
            else HostPlayer(work, program, text, ticks)
        )
        try:
            progress(f"compiling and playing {ticks} ticks, one a call")
            step = player.played(fills=False)
        except (SimulationFailed, OSError, ValueError) as error:
            return Outcome([Check("program", self._name, f"{ticks} ticks", failure=f"program: {error}")])
        capture = make_capture(stored, script, pack_captures(step.capture, stored))
        sent = {"x": step.capture[::2] & np.uint64(0xFFFFFFFF), "y": step.capture[::2] >> np.uint64(32)}
        checks = [
            self._header(stored, step),
            *check_codes(capture, stored, {axis: part.astype(np.int64) for axis, part in sent.items()}),
            *check_waveform(capture, stored, job.limits),
            check_no_faults(capture),
            check_faults(capture, step.counts, script.all_counts),
            _states(script, step),
        ]
        try:
            progress(f"compiling and playing {ticks} ticks, many a call")
            fill = player.played(fills=True)
            codes = pack_captures(fill.capture, stored)
            filled = with_capture(capture, codes) or make_capture(stored, script, codes)
            checks.append(check_filled(filled, _states(script, fill), fill.counts, script.all_counts))
        except (SimulationFailed, OSError, ValueError) as error:
            checks.append(Check("fill", "integer model", f"{ticks} ticks", failure=f"fill: {error}"))
        difference = first_difference(capture)
        if stored.program_of_z is not None:
            progress("compiling and playing the output z")
            files = [path for path in program.runtime if not path.name.startswith(("dac_link", "dac_store"))]
            ticks = min(_FRAMES_OF_Z * stored.program.schedule.frame_ticks, job.most_ticks)
            name = f"{stored.manifest.name}_z"
            sources = [*program.of_z, *files]
            of_z, differs = frame_checks("c, z", name, stored.program_of_z, sources, program.choices, work, ticks)
            checks += of_z
            difference = difference or differs
        unplayed = unplayed_c(stored.runtime(".c"), self.fourier)
        return Outcome(checks, session, difference, unplayed=unplayed)

    @property
    def _name(self) -> str:
        """The name of the machine in the table of checks."""
        return host_compiler() if self.machine == "c" else EMULATED

    @staticmethod
    def _header(stored: StoredBuild, step: CRecord) -> Check:
        """Check the constants of the header as the compiler reads them."""
        content = stored_content(stored)
        constants = header_constants(content)
        wrong = [
            f"{content.name}.h: {name} is {value} to the compiler, it is {right} in the manifest"
            for (name, right), value in zip(constants.items(), step.constants, strict=True)
            if value != right
        ]
        return differing_check("c header", "manifest, by the compiler", f"{len(constants)} constants", wrong)


def _states(script: Script, played: CRecord) -> Check:
    return check_states(script.states, read_states(played.states), (1 << 32) - 1, _UNTOLD)
