"""What a host may ask of a device, and what goes wrong: played on short programs, so that all of it is soon over.

Every part ends with what the device says of itself, which the bench stores.
"""

from tablegen.device.dual_program import DualProgram
from tablegen.verification.loading import Loader
from tablegen.verification.placement import Placement
from tablegen.verification.stream import PROGRAM, X_TABLE, Y_TABLE, Script

_NONSENSE = 0x15555555
_LONGEST_RAMP = 2000  # ticks
_RESTING_TICKS = 3
_FAR_REGISTERS = (0, 16, 32)  # pages of the scan, x and y
_WIRED_SAMPLES = 24


class Requests:
    """Plays them on a script that has just begun; the variations take turns in both banks."""

    def __init__(self, script: Script, loader: Loader, placement: Placement, driver_reports: bool) -> None:
        """``driver_reports`` where a driver tells of overruns, as in C."""
        self.script, self.loader, self.placement = script, loader, placement
        self._driver_reports = driver_reports

    def play(self) -> None:
        """All parts, one after the other."""
        self._without_a_program()
        self._starts_and_stops(self._first_program())
        self._refusals()
        self._clamps()
        self._held_back()
        self._faults_of_the_clock()

    def _ticks(self, ticks: int) -> None:
        """Play so many, as fast as they may come."""
        script = self.script
        script.tick_every(self.placement.tick_clocks)
        script.wait_ticks(ticks)

    def _rest(self, when: str) -> None:
        self.script.state(when)
        self.script.tick_every(self.placement.tick_clocks)

    def _ramp(self) -> None:
        """Until the codes have parked, and a little longer."""
        played = 0
        while not self.script.model.parked and played < _LONGEST_RAMP:
            self._ticks(_RESTING_TICKS)
            played += _RESTING_TICKS
        self._ticks(_RESTING_TICKS)

    def _without_a_program(self) -> None:
        """The codes of power-up hold, and there is nothing to start."""
        self._ticks(_RESTING_TICKS)
        self._rest("at power-up")
        self.script.request("arm", frames=1)
        self._ticks(1)
        self.script.request("trigger")
        self._ticks(_RESTING_TICKS)
        self._rest("after a trigger with nothing to play")
        self.script.request("park")
        self._ticks(1)

    def _first_program(self) -> DualProgram:
        program = self.loader.load("free")
        self.loader.commit(program)
        self._ticks(2)
        self._ramp()
        self._rest("with its first program")
        return program

    def _starts_and_stops(self, program: DualProgram) -> None:
        """Trigger without arm, a counted scan, arming and triggering while it plays, park in mid-line, reset."""
        script, line, frame = self.script, program.schedule.ticks, program.schedule.frame_ticks
        script.request("trigger")
        self._ticks(_RESTING_TICKS)
        self._rest("after a trigger without arm")
        script.request("arm", frames=2)
        self._ticks(_RESTING_TICKS)
        self._rest("armed for two frames")
        script.request("trigger")
        self._ticks(frame // 2)
        script.request("arm", frames=1)  # for the next scan: this one keeps its own count
        script.request("trigger")
        self._ticks(frame)
        self._rest("in its second frame")
        self._ticks(frame - frame // 2)
        self._ramp()
        self._rest("after two frames")
        script.request("trigger")
        self._ticks(frame + line // 2)
        self._rest("after the one frame that it was armed for meanwhile")
        script.request("trigger")  # nobody armed it again
        self._ticks(_RESTING_TICKS)
        script.request("arm")
        script.request("trigger")
        self._ticks(3 * frame + line // 2)  # without end, whatever was counted before
        script.request("arm", frames=1)
        script.request("park")  # in mid-line; disarms
        self._ticks(2)
        self._rest("parking")
        script.request("trigger")
        self._ramp()
        self._rest("parked")
        script.request("arm", "trigger", "park")  # park has the last word
        self._ticks(_RESTING_TICKS)
        self._rest("after arm, trigger and park at once")
        script.request("arm", "trigger")
        self._ticks(line + 5)
        script.request("arm")
        script.request("reset")
        self._ticks(_RESTING_TICKS)
        self._rest("after a reset")
        script.request("trigger")
        self._ticks(_RESTING_TICKS)
        script.request("arm", "trigger")  # not parked yet: the guard holds all the same
        self._ticks(line + 7)

    def _refusals(self) -> None:
        """A program that waits: writes are refused, it is withdrawn, or emptied by a reset."""
        script, loader = self.script, self.loader
        line = script.model.playing.schedule.ticks if script.model.playing else 1
        for empties in ("withdraw", "reset"):
            program = loader.load("clamped")
            self._ticks(1)
            self._mid_line(line)
            loader.commit(program)
            script.wait(2)
            script.state("with a program that waits")
            script.write_refused(X_TABLE, [_NONSENSE] * 4)
            script.write_refused(Y_TABLE, [_NONSENSE] * 4)
            for page in _FAR_REGISTERS:
                script.write_refused(PROGRAM, [_NONSENSE] * 14, first=page)
            self._rest("with refused writes")
            script.request(empties)  # the nonsense would be taken after it
            self._ticks(2 * line)
            self._rest(f"after {'a' if empties == 'reset' else 'the'} {empties}")
            script.request("clear_faults")
            script.request("arm", "trigger")
            self._ticks(line + 3)
        self._rest("playing on")

    def _mid_line(self, line: int) -> None:
        """On to the middle of a line, so that a commit waits for the next one."""
        self._ticks((line // 2 - self.script.model.tick) % line + 1)

    def _clamps(self) -> None:
        """A program that clamps at both limits of both axes; faults are counted, and forgotten on request."""
        script = self.script
        line = script.model.playing.schedule.ticks if script.model.playing else 1
        program = self.loader.load("clamped")
        self._mid_line(line)
        self.loader.commit(program)
        self._ticks(line + 2 * program.schedule.frame_ticks + 5)
        self._rest("with codes that clamp")
        script.request("clear_faults")
        self._ticks(program.schedule.ticks)
        self._rest("with codes that clamp, after faults were cleared")

    def _held_back(self) -> None:
        """A program whose steps are too large, up and down: the guard holds them, and says so."""
        script = self.script
        line = script.model.playing.schedule.ticks if script.model.playing else 1
        program = self.loader.load("held")
        self._mid_line(line)
        self.loader.commit(program)
        self._ticks(line + program.schedule.frame_ticks + program.schedule.ticks + 3)
        self._rest("with steps that are too large")
        script.request("park")
        script.request("clear_faults")
        self._ramp()
        self._rest("with faults cleared")

    def _faults_of_the_clock(self) -> None:
        """Samples that were missed, ticks that came too early: no pixel is valid until they are forgotten."""
        script = self.script
        program = self.loader.load("free")
        self.loader.commit(program)
        self._ramp()
        lines = program.schedule.lines * program.schedule.ticks
        for clears in ("clear_faults", "reset"):
            script.come_to_rest()
            script.request("underrun")
            script.request("underrun")
            self._overrun()
            self._rest("after missed samples")
            script.request("arm", "trigger")
            self._ticks(2 * lines)  # an image, none of which is valid
            script.request(clears)
            self._ticks(_RESTING_TICKS)
            self._rest(f"after missed samples and {clears}")
            script.request("arm", "trigger")
            self._ticks(2 * lines)  # and one that is, after its lines to settle
        script.request("park")
        self._ramp()

    def _overrun(self) -> None:
        script = self.script
        if self._driver_reports:
            script.lost_tick(under_way=False)
        elif self.placement.axis == "serial":
            script.tick_every(self.placement.tick_clocks)
            script.wait_ticks(1)
            script.tick_every(0)
            script.wait(8)
            script.lost_tick(under_way=True)
