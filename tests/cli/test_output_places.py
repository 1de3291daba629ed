"""A place that cannot be written is refused before any work, by every command: here its inputs are not there."""

import os
from pathlib import Path

import click
import pytest
from editing import run

from tablegen.cli import cli
from tablegen.cli.shared.common import Failure, OutputFile, OutputFolder, check_place

FILE = "a.txt/sub/out.svg"  # a.txt is a file
_CALIBRATE = "--axis x --v-max 100"
WORDS = {
    "build": f"no.toml -o {FILE}",
    "build --depfile": f"no.toml --depfile {FILE}",
    "build --plot": f"no.toml --plot {FILE}",
    "sweep": f"no.toml --set x.size_nm=1 -o {FILE}",
    "show": f"no.toml --plot {FILE}",
    "tables": f"no.toml --plot {FILE}",
    "simulate --plot": f"no.toml --plot {FILE}",
    "simulate --csv": f"no.toml --csv {FILE}",
    "runtime": f"no -o {FILE}",
    "report": f"no.toml -o {FILE}",
    "report --svg": f"no.toml --svg {FILE}",
    "compare": f"no.toml no.toml -o {FILE}",
    "compare --plot": f"no.toml no.toml --plot {FILE}",
    "predict": f"no.toml no.csv --axis x -o {FILE}",
    "predict --plot": f"no.toml no.csv --axis x --plot {FILE}",
    "lattice": f"no.npy --plot {FILE}",
    "drift": f"no.npy no.npy --plot {FILE}",
    "correct": f"no.npy --fit -o {FILE}.npy",
    "correct --each": f"no.npy --fit --each -o {FILE}",
    "correct --plot": f"no.npy --fit --plot {FILE}",
    "refine --report": f"no.toml no.csv --axis x --report {FILE}",
    "refine --plot": f"no.toml no.csv --axis x --plot {FILE}",
    "calibrate size": f"{_CALIBRATE} no.csv --plot {FILE}",
    "calibrate offset": f"{_CALIBRATE} no.csv --report {FILE}",
    "calibrate images": f"{_CALIBRATE} --pair 1 no.npy no.npy --report {FILE}",
    "calibrate coupling": f"no.csv --plot {FILE}",
    "calibrate operator": f"{_CALIBRATE} no.csv --report {FILE}",
    "calibrate hysteresis": f"{_CALIBRATE} no.csv --write --scanner {FILE}",
    "verify --junit": f"no --junit {FILE}",
    "verify --keep": f"no --keep {FILE}",
    "readback": f"-o {FILE} --port no",
    "init": FILE,
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "a.txt").write_text("a file\n", "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", WORDS)
def test_a_place_below_a_file_is_refused_before_the_inputs_are_read(command: str, folder: Path) -> None:
    words = command.split(" --")[0].split() + WORDS[command].split()
    outcome = run(*words)
    assert (outcome.status, outcome.out) == (4, "")
    assert outcome.err.startswith("a.txt/sub/out.svg")
    assert outcome.err.endswith(f"{folder / 'a.txt'} is no directory\n")


def test_every_command_with_an_output_is_in_the_table() -> None:
    def commands(group: click.Command, names: tuple[str, ...] = ()) -> list[tuple[str, click.Command]]:
        if not isinstance(group, click.Group):
            return [(" ".join(names), group)]
        context = click.Context(group)
        found = [(name, group.get_command(context, name)) for name in group.list_commands(context)]
        return [pair for name, one in found if one is not None for pair in commands(one, (*names, name))]

    writing = {
        name
        for name, command in commands(cli)
        if any(isinstance(one.type, OutputFile | OutputFolder) for one in command.params)
    }
    listed = {words.split(" --")[0] for words in WORDS}
    assert writing - listed == {"calibrate frequency", "calibrate resonance"}  # whose options are those of size


def test_a_folder_without_the_right_to_write_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_place(folder / "new" / "out.svg")
    monkeypatch.setattr(os, "access", lambda path, _: path != folder)
    with pytest.raises(Failure) as caught:
        check_place(folder / "new" / "out.svg")
    assert caught.value.message == f"{folder / 'new/out.svg'}: nothing can be written in {folder}: Permission denied"
    assert caught.value.status == 4


def test_a_check_of_a_build_needs_no_place(folder: Path) -> None:
    assert run("build", "no.toml", "-o", FILE, "--check").status == 2
