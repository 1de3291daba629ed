"""Boots in simulation: what goes in on each clock, what leaves, and the law that holds both together."""

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mutants

from tablegen.base.resources import verilog_runtime
from tablegen.verification.verilog.simulate import Design, compile_design

BOOT = next(path for path in verilog_runtime() if path.name == "dac_boot.v")
AFTER = 6  # clocks of the host before the next reset
Write = tuple[int, int, int]  # region, address, data
COMMIT: Write = (-1, 0, 0)


class Wrong(Exception):
    """What left is not what was to leave."""


@dataclass(frozen=True)
class Setup:
    """The memory files of a program by their parameters, the parameters to go with them, and the writes of a boot.

    A file that is None is not there.
    """

    files: Mapping[str, bytes | None]
    parameters: Mapping[str, int]
    writes: Sequence[Write]


@dataclass(frozen=True)
class Clock:
    """What goes in on a clock."""

    reset: int
    writable: int
    host_write: int
    host_commit: int
    host: Write

    @property
    def word(self) -> int:
        """Return the clock as the bench reads it."""
        flags = self.reset << 3 | self.writable << 2 | self.host_write << 1 | self.host_commit
        region, address, data = self.host
        return flags << 51 | region << 48 | address << 32 | data


def hosts(name: str, levels: Sequence[tuple[int, int]]) -> list[Clock]:
    """Return clocks with these levels of reset and writable, and a host that asks for something on most of them."""
    rng = random.Random(name)
    return [
        Clock(
            reset, writable, rng.getrandbits(1), int(rng.random() < 0.2),
            (rng.getrandbits(3), rng.getrandbits(16), rng.getrandbits(32)),
        )
        for reset, writable in levels
    ]  # fmt: skip


def some_boots(clocks: int) -> Iterator[tuple[int, int]]:
    """Yield reset and writable by clocks: held up at random, reset at each eleventh clock of a boot, and at random."""
    for last in range(0, clocks + AFTER, 11):
        for at in range(last):
            yield 0, int(at % 7 != last % 7)
        yield 1, last % 2
    rng = random.Random(clocks)
    for often in (0.5, 0.1, 0.9):
        for _ in range(6 * clocks):
            yield int(rng.random() < 0.3 / clocks), int(rng.random() < often)


def some_clocks(name: str, setup: Setup, most_idle: int) -> list[Clock]:
    """Return clocks of a setup: `some_boots`, then a whole boot and some clocks of the host."""
    clocks = len(setup.writes) + most_idle
    start = [(int(clock == 10), clock % 2) for clock in range(setup.parameters["START_CLOCKS"])]
    return hosts(name, [*start, *some_boots(clocks), (1, 1), *[(0, 1)] * (clocks + AFTER)])


def hexadecimal(digits: str) -> int:
    """Return what a simulator prints; a level that is none is ``Wrong``."""
    try:
        return int(digits, 16)
    except ValueError:
        raise Wrong(f"undefined: {digits}") from None


def check_word(
    at: int, writes: Sequence[tuple[int, int, int]], writable: bool, write: bool, commit: bool, where: Sequence[str]
) -> None:
    """Hold a word of a boot against the one that is due."""
    word = (-1, 0, 0) if commit else tuple(map(hexadecimal, where))
    if write and commit:
        raise Wrong("two things at once")
    if not writable:
        raise Wrong(f"refused word {at}")
    if at == len(writes) or word != writes[at]:
        raise Wrong(f"word {at}")


def check_start(start: int, lines: Sequence[str]) -> None:
    """Hold the clocks before the first read against the law."""
    if any(line.split()[0] != "4" for line in lines[:start]):  # booting, and nothing else
        raise Wrong("a boot before the memories can be read")


def check_boots(setup: Setup, clocks: Sequence[Clock], lines: Sequence[str], most_idle: int) -> int:
    """Hold what left against the law; return how many boots came to their end.

    A boot waits for ``most_idle`` clocks of its own at most.
    """
    start, writes = setup.parameters["START_CLOCKS"], setup.writes
    if len(lines) != len(clocks):
        raise Wrong("a capture of another length")
    check_start(start, lines)
    ended = at = idle = 0
    for asked, line in zip(clocks[start:], lines[start:], strict=True):
        flags, *where = line.split()
        missing, booting, write, commit = (hexadecimal(flags) >> bit & 1 for bit in (3, 2, 1, 0))
        if missing:
            raise Wrong("a file was taken to be missing")
        if not booting:
            if at < len(writes):
                raise Wrong(f"the host at word {at}")
            got = (write, commit, *map(hexadecimal, where))
            if got != (asked.host_write, asked.host_commit, *asked.host):
                raise Wrong("the host is not heard")
        elif write or commit:
            check_word(at, writes, bool(asked.writable), bool(write), bool(commit), where)
            at += 1
            ended += at == len(writes)
        # A clock without a word is one that was held up, the first one, or after the commit, held up or not, the last.
        elif asked.writable or at == len(writes):
            idle += 1
            if idle > most_idle:
                raise Wrong(f"nothing at word {at}")
        if asked.reset:
            at = idle = 0
    if at != len(writes):
        raise Wrong("the last boot has no end")
    return ended


@dataclass(frozen=True)
class BootMutant(mutants.Mutant):
    """A fault of a module that boots, and in ``where`` the setup that shows it."""

    @property
    def path(self) -> Path:
        return next(BOOT.parent.rglob(self.file))


@dataclass(frozen=True)
class Boots:
    """Setups of a module that boots, at a bench of the same ports as boot_bench.

    ``most_idle`` are the clocks on which a boot that is not held up writes nothing.
    """

    bench: Path
    module: Path
    setups: Mapping[str, Setup]
    stimulus: Callable[[str], list[Clock]]
    most_idle: int

    def mutants(self, faults: Mapping[str, tuple[str, ...]], where: str) -> dict[str, BootMutant]:
        """Return mutants by name; a fault is what is put in place of what, and where it shows if not in ``where``."""
        return {
            name: BootMutant(name, self.module.name, old, new, *(others or [where]))
            for name, (old, new, *others) in faults.items()
        }

    def play(self, folder: Path, found_by: Mapping[str, BootMutant] | None = None) -> dict[str, list[str]]:
        """Return the lines that each setup captures, by its name; with mutants those of each mutant, by its name."""
        if found_by is None:
            return self._play(folder, {name: (one, self.stimulus(name), None) for name, one in self.setups.items()})
        faulty = {
            name: (self.setups[one.where], self.stimulus(one.where), one.source) for name, one in found_by.items()
        }
        return self._play(folder, faulty)

    def check(self, name: str, lines: Sequence[str]) -> int:
        """Hold what left of a setup against the law; return how many boots came to their end."""
        return check_boots(self.setups[name], self.stimulus(name), lines, self.most_idle)

    def flags_without(self, folder: Path, name: str, file: str, words: int | None) -> list[str]:
        """Return the flags on each clock of a boot whose file has only its first words, or is missing."""
        setup = self.setups[name]
        content = setup.files[file]
        assert content is not None
        left = None if words is None else b"".join(content.splitlines(keepends=True)[:words])
        clocks = [Clock(0, 1, 0, 0, (0, 0, 0))] * (len(setup.writes) + 10)
        damaged = replace(setup, files={**setup.files, file: left})
        lines = self._play(folder, {"damaged": (damaged, clocks, None)})["damaged"]
        return [line.split()[0] for line in lines]

    def _play(
        self, folder: Path, played: Mapping[str, tuple[Setup, Sequence[Clock], str | None]]
    ) -> dict[str, list[str]]:
        """Return the lines captured of setups and their clocks, all in one simulation; a source replaces the module."""
        (folder / "build").mkdir(parents=True)
        sources, instances = sorted({self.bench, self.module, BOOT}), []
        for index, (name, (setup, clocks, source)) in enumerate(played.items()):
            top = self.bench.stem
            if source is not None:
                top = f"{self.bench.stem}_{name}"
                for path, text in ((self.bench, self.bench.read_text("utf-8")), (self.module, source)):
                    sources.append(folder / f"{path.stem}_{name}.v")
                    renamed = text.replace(f"{self.module.stem} #(", f"{self.module.stem}_{name} #(")
                    sources[-1].write_text(renamed.replace(f"{self.bench.stem} #(", f"{top} #("), "utf-8")
            for key, content in setup.files.items():
                if content is not None:
                    (folder / "build" / f"{name}_{key}.mem").write_bytes(content)
            (folder / "build" / f"{name}.hex").write_text("".join(f"{each.word:x}\n" for each in clocks), "ascii")
            given = [f".{key}({value})" for key, value in {**setup.parameters, "DEPTH": len(clocks)}.items()]
            given += [f'.{key}("{name}_{key}.mem")' for key in setup.files]
            given += [f'.STIMULUS("{name}.hex")', f'.CAPTURE("{name}.txt")']
            instances.append(f"    {top} #({', '.join(given)}) bench_{index} (.clock(clock), .done(done[{index}]));\n")
        boot_top = folder / "boot_top.v"
        boot_top.write_text(
            "`timescale 1ns / 1ps\nmodule boot_top;\n    reg clock = 0;\n    always #5 clock = !clock;\n"
            f"    wire [{len(instances) - 1}:0] done;\n    wire all_done = &done;\n{''.join(instances)}endmodule\n",
            "ascii",
        )
        compiled = compile_design("icarus", Design([boot_top, *sources], "boot_top"), folder / "build")
        assert compiled.run("cocotb_outputs") == (1, 0)
        return {name: (compiled.folder / f"{name}.txt").read_text("ascii").splitlines() for name in played}
