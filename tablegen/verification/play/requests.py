"""What a host may ask of a device, and what goes wrong: played on short programs, so that all of it is soon over.

Every part ends with what the device says of itself, which the bench stores.
"""

from tablegen.device.dual_program import DualProgram
from tablegen.verification.play.loading import Loader
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.stream import PROGRAM, X_TABLE, Y_TABLE, Script
from tablegen.verification.play.variation import Kind

_NONSENSE = 0x15555555
_LONGEST_RAMP = 2000  # ticks
_RESTING_TICKS = 3
_FAR_REGISTERS = (0, 16, 32)  # pages of the scan, x and y
_LONGER = 6000  # ticks by which a line is longer where that costs nothing
_SWAPS = 14
_IN_TURN: tuple[Kind, ...] = ("clamped", "held", "free", "free", "held")


class Requests:
    """Plays them on a script that has just begun; the variations take turns in both banks."""

    def __init__(
        self, script: Script, loader: Loader, placement: Placement, driver_reports: bool, long_lines: bool = False
    ) -> None:
        """``driver_reports`` where a driver tells of overruns, as in C; ``long_lines`` where ticks cost little."""
        self.script, self.loader, self.placement = script, loader, placement
        self._driver_reports, self._long = driver_reports, long_lines

    def play(self) -> None:
        """All parts, one after the other."""
        self._without_a_program()
        self._starts_and_stops(self._first_program())
        self._refusals()
        self._clamps()
        self._held_back()
        self._swaps()
        if self._long:
            self._long_lines()
        self._faults_of_the_clock()

    def _ticks(self, ticks: int) -> None:
        """Play so many, as fast as they may come."""
        script = self.script
        script.pace(self.placement.tick_clocks, self.placement.tick_clocks)
        script.wait_ticks(ticks)

    def _rest(self, when: str) -> None:
        self.script.state(when)
        self.script.pace(self.placement.tick_clocks, self.placement.tick_clocks)

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
        script.request("arm", "trigger", frames=2)  # the count of this clock
        self._ticks(2 * frame + line)
        self._rest("after two frames that were armed with their trigger")
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
        program = loader.load("clamped")
        script.request("commit", "withdraw", program=program)
        self._ticks(2 * line)
        self._rest("after commit and withdraw at once")

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
        self._ticks(line + 12 * program.schedule.frame_ticks + 5)  # more faults than a counter of the bench holds
        self._rest("with codes that clamp")
        for _ in range(program.schedule.ticks):  # the first tick that clamps after it is every one in turn
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

    def _swaps(self) -> None:
        """One after the other: each register has to change with the first sample of its program, and not before."""
        script = self.script
        script.request("arm", "trigger")
        self._ticks(2)
        for number in range(_SWAPS):
            assert script.model.playing is not None
            line = script.model.playing.schedule.ticks
            kind = _IN_TURN[number % len(_IN_TURN)]
            program = self.loader.load(kind)
            self._mid_line(line)
            self.loader.commit(program)
            if number == _SWAPS // 2 and not self._driver_reports:
                self._write_too_soon(line)
            self._ticks(line + number)
            if kind == "free":  # the one after it has no faults to begin with: its first line may be an image
                script.request("clear_faults")
                self._ticks(1)
        script.request("park")
        script.request("clear_faults")
        self._ramp()
        self._rest("after many swaps")

    def _long_lines(self) -> None:
        """Codes that change slowly, near their limits: a device that plays many ticks at a time does so here."""
        script = self.script
        script.request("arm", "trigger")
        self._ticks(2)
        for kind in ("clamped", "free", "held", "clamped", "free"):
            line = script.model.playing.schedule.ticks if script.model.playing else 1
            program = self.loader.load(kind, _LONGER)
            self.loader.commit(program)
            self._ticks(line + program.schedule.frame_ticks + 10)
        script.request("park")
        script.request("clear_faults")
        self._ramp()
        self._rest("after long lines")

    def _write_too_soon(self, line: int) -> None:
        """While the last samples of the program before are on their way: those registers come late in it."""
        script = self.script
        self._ticks((-script.model.tick) % line)
        for first, words in ((_FAR_REGISTERS[1] + 3, 8), (_FAR_REGISTERS[2] + 3, 8), (_FAR_REGISTERS[1] + 6, 2)):
            script.write_refused(PROGRAM, [_NONSENSE] * words, first)

    def _faults_of_the_clock(self) -> None:
        """Samples that were missed, ticks that came too early: no pixel is valid until they are forgotten."""
        script = self.script
        program = self.loader.load("free")
        self.loader.commit(program)
        self._ramp()
        lines = program.schedule.lines * program.schedule.ticks
        for clears in ("clear_faults", "reset"):
            script.come_to_rest()
            script.request("clear_faults")
            self._ticks(1)
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
            script.pace(self.placement.tick_clocks, self.placement.tick_clocks)
            script.wait_ticks(1)
            script.tick_every(0)
            script.wait(8)
            script.lost_tick(under_way=True)
