"""The requests of a host and their faults, on short programs, so that all of them are soon played.

Every part ends with what the device says of itself, which the bench stores.
"""

from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import program_words
from tablegen.verification.play.loading import Loader
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.stream import PROGRAM, X_TABLE, Y_FOURIER, Y_TABLE, Script
from tablegen.verification.play.variation import Kind
from tablegen.verification.play.wide_program import WIDE

_NONSENSE = 0x15555555
_LONGEST_RAMP = 2000  # ticks
_RESTING_TICKS = 3
_FAR_REGISTERS = (0, 16, 32)  # pages of the scan, x and y
_MANY_FRAMES = 0x8001  # a counter of fewer bits would count one
_UNUSED_PAGES = (48, 144, 272, 1040, 32784)  # one bit more than a used one, or two bits
_LONGER = 6000  # ticks by which a line is longer where that costs nothing
_SWAPS = 14
_REFUSAL_CLOCKS = 4  # clocks until a refusal is visible, of a commit on the clock of a write
_WIDE_TICKS = 44  # ticks, fewer than the model has in a line, a frame or a window of such a program
_IN_TURN: tuple[Kind, ...] = ("clamped", "held", "free", "free", "held")


class Requests:
    """The requests on a script that has just begun; the variations take turns in both banks."""

    def __init__(
        self, script: Script, loader: Loader, placement: Placement, in_c: bool, long_lines: bool = False
    ) -> None:
        """Prepare for a device: ``in_c`` it has overruns and no registers; ``long_lines`` if ticks cost little."""
        self.script, self.loader, self.placement = script, loader, placement
        self._in_c, self._long = in_c, long_lines

    def play(self) -> None:
        """Play all parts, one after the other."""
        self._without_a_program()
        self._starts_and_stops(self._first_program())
        self._refused_commits()
        self._refusals()
        self._clamps()
        self._slew_limited()
        self._swaps()
        if not self._in_c and self.loader.has_long_tables:
            self._wide_registers()
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
        """Play until the codes have parked, and a little longer."""
        played = 0
        while not self.script.model.parked and played < _LONGEST_RAMP:
            self._ticks(_RESTING_TICKS)
            played += _RESTING_TICKS
        self._ticks(_RESTING_TICKS)

    def _without_a_program(self) -> None:
        """Request a start and a commit while there is no program: the codes of power-up hold."""
        self.script.commit_unfit()
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
        """Load the first program, which starts with the tick that takes it and parks while codes are under way."""
        script = self.script
        program = self.loader.load("free")
        script.come_to_rest()
        script.request("arm")
        self.loader.commit(program)
        self._with_next_tick("trigger")
        self._ticks(3)
        script.request("park")
        self._ramp()
        script.request("clear_faults")
        self._ticks(1)
        self._rest("with its first program")
        return program

    def _with_next_tick(self, *names: str, frames: int = 0) -> None:
        """Put requests on the clock of the first tick after a rest, once a commit came through."""
        script, pace = self.script, self.placement.tick_clocks
        script.wait(script.commit_clocks + 1)
        script.tick_every(pace)
        script.with_tick(*names, frames=frames)

    def _until(self, line: int, tick: int) -> None:
        """Play until this tick of this line of the frame is the next one."""
        model = self.script.model
        assert model.playing is not None
        assert model.running
        schedule = model.playing.schedule
        self._ticks(((line - model.line) * schedule.ticks + tick - model.tick) % schedule.frame_ticks)

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
        script.request("arm", "trigger", frames=1)
        self._until(program.schedule.lines - 1, line - 1)
        script.with_tick("arm", "trigger", frames=1)  # on the last tick: the old scan has ended
        self._ticks(frame)
        self._rest("after a scan that began where the one before it had ended")
        for tick in (line - 2, line - 1):  # a start forgets that the last tick of a line was the next one
            script.request("arm", "trigger")
            self._until(0, tick)
            script.with_tick("park")
            self._ticks(1)
        script.request("arm", "trigger")
        self._ticks(line + 2)
        script.request("park")
        self._ticks(1)
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
        script.request("arm", "trigger", "reset")  # and reset
        self._ticks(_RESTING_TICKS)
        for disarms in ("park", "reset"):
            script.request("arm", disarms)
            script.request("trigger")
            self._ticks(_RESTING_TICKS)
        self._rest("after arm, trigger and reset at once")
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
        """Play with a pending program: writes are refused, it is withdrawn, or emptied by a reset."""
        script, loader = self.script, self.loader
        line = script.model.playing.schedule.ticks if script.model.playing else 1
        for empties in ("withdraw", "reset"):
            program = loader.load("clamped")
            self._ticks(1)
            self._mid_line(line)
            loader.commit(program)
            script.write_refused(PROGRAM, [_NONSENSE], first=_FAR_REGISTERS[1] + 3)  # the bank is locked at once
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
            script.request("arm", "trigger", frames=_MANY_FRAMES)
            self._ticks(line + 3)
        for discards in ("reset", "withdraw"):
            program = loader.load("clamped")
            script.request("commit", discards, program=program)
            self._ticks(2 * line if discards == "withdraw" else _RESTING_TICKS)
            self._rest(f"after commit and {discards} at once")
            if discards == "reset":
                script.request("arm", "trigger", frames=_MANY_FRAMES)
                self._ticks(line)

    def _mid_line(self, line: int) -> None:
        """Play to the middle of a line, so that a commit waits for the next one."""
        self._ticks((line // 2 - self.script.model.tick) % line + 1)

    def _clamps(self) -> None:
        """Play a program that clamps at both limits of both axes; faults are counted, and cleared on request."""
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

    def _slew_limited(self) -> None:
        """Play a program whose steps are too large, up and down: the guard limits them, and reports it."""
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
        """Swap programs: each register has to change with the first sample of its program, and not before."""
        script = self.script
        script.request("arm", "trigger")
        self._ticks(2)
        for number in range(_SWAPS):
            assert script.model.playing is not None
            line = script.model.playing.schedule.ticks
            kind = _IN_TURN[number % len(_IN_TURN)]
            program = self.loader.load(kind)
            if number == _SWAPS // 2 and not self._in_c:
                self._unused_addresses()  # what they would change plays in the next lines
            self._mid_line(line)
            self.loader.commit(program)
            if number == _SWAPS // 2 and not self._in_c:
                self._write_too_soon(line)
            self._ticks(line + number)
            if kind == "free":  # the one after it has no faults to begin with: its first line may be an image
                script.request("clear_faults")
                self._ticks(1)
        script.request("park")
        script.request("clear_faults")
        self._ramp()
        self._rest("after many swaps")

    def _refused_commits(self) -> None:
        """Commit programs with a word that does not fit: each word by itself, and what discards such a program."""
        script, loader = self.script, self.loader
        script.request("park")
        self._ticks(1)
        self._ramp()
        if not self._in_c:
            self._part_of_a_program()
        program = loader.load("free")
        script.come_to_rest()
        words = program_words(program.schedule, program.x, program.y)
        outside, inside = loader.edges(words)
        first = [words[0]]
        for address, word in outside:
            script.write(PROGRAM, first)  # which begins a program
            script.write_unfit(address, word, at_once=not self._in_c)
            script.wait(_REFUSAL_CLOCKS)
            script.state(f"with word {address} of {word:#x}", rests=True)
            script.request("withdraw", "clear_faults")
            script.write(PROGRAM, [words[address]], first=address)
        if not self._in_c:
            self._discards(words, *outside[0])
            self._words_that_just_fit(program, words, inside)
        script.request("arm", "trigger")
        self._ticks(program.schedule.ticks + 7)

    def _part_of_a_program(self) -> None:
        """Refuse registers and one table: the other table of that bank is of an older program."""
        script, own = self.script, self.loader.own
        script.wait_writable()
        script.write(PROGRAM, program_words(own.schedule, own.x, own.y))
        script.write(Y_TABLE, own.y.words)
        script.come_to_rest()
        script.commit_unfit()
        script.wait(_REFUSAL_CLOCKS)
        script.state("with a part of a program", rests=True)
        script.request("withdraw", "clear_faults")

    def _discards(self, words: list[int], address: int, word: int) -> None:
        """Check that an idle program with an invalid word is discarded."""
        script = self.script
        for discards in ("withdraw", "reset"):
            script.write(PROGRAM, words[:1])
            script.write_unfit(address, word)
            script.wait(_REFUSAL_CLOCKS)
            script.write(PROGRAM, [words[address]], first=address)
            script.commit_unfit()  # a right word over a wrong one is not enough
            script.wait(_REFUSAL_CLOCKS)
            script.request(discards, "clear_faults")
            script.write(PROGRAM, words[1:], first=1)
            script.commit_unfit()  # nor is a program without its beginning
            script.wait(_REFUSAL_CLOCKS)
            script.state(f"after a program that did not fit, and {discards}", rests=True)
            script.request("clear_faults")

    def _unused_addresses(self) -> None:
        """Write to registers and regions that a device does not have; it ignores them."""
        script = self.script
        for page in _UNUSED_PAGES:
            script.write(PROGRAM, [_NONSENSE] * 2, first=page + 3)
        for region in range(Y_TABLE + 1 if not self.placement.fourier else Y_FOURIER + 1, 8):
            script.write(region, [_NONSENSE] * 2)

    def _words_that_just_fit(self, program: DualProgram, words: list[int], inside: list[dict[int, int]]) -> None:
        """Commit words that just fit, and withdraw them again."""
        script = self.script
        self.loader.fill_banks()
        for edge in inside:
            for address, word in edge.items():
                script.write(PROGRAM, [word], first=address)
            self.loader.commit(program)  # in place of what was written: no tick will take it
            script.wait(script.commit_clocks + 1)
            script.state("with words that just fit", rests=True)
            script.request("withdraw")
        script.write(PROGRAM, words)

    def _wide_registers(self) -> None:
        """Play programs that fill their registers: too narrow ones would soon end a line, a frame or a window."""
        script = self.script
        for part in WIDE:
            program = self.loader.load_wide(part)
            self.loader.commit(program)
            self._ticks(2)
            self._ramp()
            script.request("arm", "trigger")
            self._ticks(_WIDE_TICKS)
            script.request("park")
            self._ticks(1)
        self._ramp()
        self._rest("after programs that fill their registers")

    def _long_lines(self) -> None:
        """Play codes that change slowly, near their limits: a device that plays many ticks at a time does so here."""
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
        """Write while the last samples of the program before are on their way, to registers that come late in it."""
        script = self.script
        self._ticks((-script.model.tick) % line)
        for first, words in ((_FAR_REGISTERS[1] + 3, 8), (_FAR_REGISTERS[2] + 3, 8), (_FAR_REGISTERS[1] + 6, 2)):
            script.write_refused(PROGRAM, [_NONSENSE] * words, first)

    def _faults_of_the_clock(self) -> None:
        """Miss samples and tick too early: no pixel is valid until the faults are cleared."""
        script = self.script
        program = self.loader.load("free")
        script.come_to_rest()
        self.loader.commit(program)
        self._with_next_tick("withdraw")  # too late: the tick takes it
        self._ramp()
        self._rest("after a withdrawal that came with its swap")
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
            if clears == "clear_faults":
                self._missed_in_an_image(lines)
        script.request("park")
        self._ramp()

    def _missed_in_an_image(self, frame: int) -> None:
        """Miss a sample in an image: the pixel before it becomes invalid, and so does the missed one."""
        script = self.script
        self._until_valid(frame)
        self._rest("in an image")
        self._until_valid(frame)
        script.come_to_rest()
        script.request("underrun")
        script.wait(1)
        script.state("with a sample missed in an image", rests=True)
        script.request("clear_faults")
        script.wait(_RESTING_TICKS)  # it takes effect with the next tick, whenever that comes
        self._ticks(1)
        self._rest("with an image after a missed sample")
        if self._in_c:
            return
        self._until_valid(frame)
        script.come_to_rest()
        script.missed_with_sample(self.placement.latency)
        script.state("with the sample of this clock missed")
        script.request("clear_faults")
        self._ticks(1)

    def _until_valid(self, most: int) -> None:
        """Play into valid ticks, as there are some in so many of a frame: one more may come before it rests."""
        for _ in range(most):
            if self.script.images(2):
                return
            self._ticks(1)
        raise AssertionError("a variation without an image")

    def _overrun(self) -> None:
        script = self.script
        if self._in_c:
            script.lost_tick(under_way=False)
        elif self.placement.axis == "serial":
            script.pace(self.placement.tick_clocks, self.placement.tick_clocks)
            script.wait_ticks(1)
            script.tick_every(0)
            script.wait(8)
            script.lost_tick(under_way=True)
