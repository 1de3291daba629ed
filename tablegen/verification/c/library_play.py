"""A play of a library in C: its programs are found by name and played in turn by one runtime."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Tick
from tablegen.verification.c.bench import require_compiler
from tablegen.verification.c.host import host_compiler
from tablegen.verification.c.play import compile_line, record, require_headers
from tablegen.verification.c.program import OPTIONS
from tablegen.verification.checks.directory import copies, some
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.library_session import Pick, expected_ticks, make_picks
from tablegen.verification.play.stream import FLAGS

_BENCH = Path(__file__).parent / "library_bench.c"
_NO_NAME = "no_program"
_LEAST_TICKS_A_SECOND = 5000  # a slower program counts as hanging


@dataclass(frozen=True)
class CLibraryPlay:
    """A play of a library whose programs, by number, have ``names`` and ``hashes``; ``options`` are its macros."""

    library: str
    names: Sequence[str]
    hashes: Sequence[str]
    programs: Sequence[DualProgram] = field(repr=False)
    options: dict[str, int]
    most_ticks: int

    def check(self, folder: Path, work: Path) -> Check:
        """Compile and play the library in ``folder``, and compare every tick with the model.

        Parameters
        ----------
        work
            Directory for the program and its record, which is made.

        Raises
        ------
        ToolMissing
            If no compiler is installed.
        """
        work.mkdir(parents=True, exist_ok=True)
        compiler = require_compiler(host_compiler())
        picks = make_picks(self.programs, [Pick(len(self.programs), 0, fails=True)], self.most_ticks)
        files, missing = self._files(folder, work)
        if missing:
            return self._check("nothing", some(missing))
        expected = self._expected(picks)
        program, capture = work / "library_bench", work / "library.bin"
        macros = {
            **self.options,
            "BENCH_LIBRARY_HEADER": f'"{self.library}_library.h"',
            "BENCH_LIBRARY": f"{self.library}_library",
            "BENCH_NUMBER": f"{self.library}_library_number",
            "BENCH_PROGRAMS": f"{self.library.upper()}_LIBRARY_PROGRAMS",
            "BENCH_X": f"{self.library.upper()}_LIBRARY_X",
            "BENCH_Y": f"{self.library.upper()}_LIBRARY_Y",
        }
        line = [*compiler, *OPTIONS, "-w", *(f"-D{key}={value}" for key, value in macros.items()), f"-I{work / 'c'}"]
        ticks = sum(pick.ticks for pick in picks)
        try:
            try:
                compile_line([*line, *(str(path) for path in files), str(_BENCH), "-o", str(program)])
            except SimulationFailed:
                require_headers(compiler)
                raise
            texts = [word for pick in picks for word in (self._name(pick), str(int(pick.restarts)), str(pick.ticks))]
            most = 2 * sum(map(len, expected)) + 1000
            record([str(program), *texts], b"", capture, most, 60.0 + ticks / _LEAST_TICKS_A_SECOND)
            failure = self._difference(picks, expected, read_bytes(capture, BUILD_FILE))
        except SimulationFailed as error:
            return self._check("nothing", str(error))
        return self._check(f"{len(self.programs)} programs, {ticks} ticks", failure)

    def _check(self, compared: str, failure: str | None) -> Check:
        source = f"{self.library}_library.c"
        return Check(f"library {source}", "integer model", compared, failure=failure and f"{source}: {failure}")

    def _files(self, folder: Path, work: Path) -> tuple[list[Path], list[str]]:
        """Copy index, runtime and the folders of the programs; return the C files, and what is missing."""
        runtime = sorted(path.name for path in folder.glob("dac_*.[ch]"))
        copied, missing = copies(folder, [*runtime, *(f"{self.library}_library.{end}" for end in "hc")], work / "c")
        for name in self.names:
            own = sorted(path.name for path in (folder / name).glob(f"{name}*.[ch]"))
            paths, absent = copies(folder / name, own, work / "c" / name)
            copied += paths
            missing += absent
        return [path for path in copied if path.suffix == ".c"], missing

    def _name(self, pick: Pick) -> str:
        return _NO_NAME if pick.fails else self.names[pick.number]

    def _expected(self, picks: Sequence[Pick]) -> list[bytes]:
        """Return the record of each pick by the integer model."""
        parts = []
        for pick, ticks in zip(picks, expected_ticks(self.programs, picks), strict=True):
            if pick.fails:
                parts.append((0xFFFFFFFF).to_bytes(4, "little"))
                continue
            head = pick.number.to_bytes(4, "little") + self.hashes[pick.number].encode("ascii")
            parts.append(head + b"".join(self._tick(self.programs[pick.number], tick) for tick in ticks))
        return parts

    @staticmethod
    def _tick(program: DualProgram, tick: Tick) -> bytes:
        markers = sum(1 << bit for bit, flag in enumerate(FLAGS) if getattr(tick, flag))
        words = program.x.output.word(tick.x), program.y.output.word(tick.y)
        return b"".join(word.to_bytes(4, "little") for word in words) + bytes([markers, tick.faults.value])

    def _difference(self, picks: Sequence[Pick], expected: Sequence[bytes], played: bytes) -> str | None:
        at = 0
        for pick, part in zip(picks, expected, strict=True):
            got = played[at : at + len(part)]
            if got != part:
                head = 4 if pick.fails else 4 + len(self.hashes[pick.number])
                if got[:head] != part[:head]:
                    number = int.from_bytes(got[:4], "little", signed=True)
                    return f"{self._name(pick)} has number {number} and hash {got[4:head].decode('ascii', 'replace')}"
                first = next(
                    (i for i, (one, other) in enumerate(zip(got, part, strict=False)) if one != other), len(got)
                )
                tick = (first - head) // 10
                words = [part[head + 10 * tick :][:10].hex(), got[head + 10 * tick :][:10].hex()]
                return f"tick {tick} after the pick of {self._name(pick)} is {words[1]} in the record, not {words[0]}"
            at += len(part)
        return None if at == len(played) else f"{len(played) - at} bytes more than expected were played"
