"""Libraries of a build as the packers of others make them: unpacked, and played by a main program on the host."""

import os
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from pathlib import Path

from building import NAME
from limits import PATIENCE_S
from short_scans import CUBIC, model_ticks

from tablegen.device.dual_program import DualProgram

TICKS = 40
# A scan that needs another value than the default of each option that a package has.
DEMANDING = {"dac.bits": 18, "dac.shaping": "second", "x.table": {**CUBIC, "bits": 18}, "y.table.bits": 18}
MAIN = f"""
#include <stdio.h>
#include <{NAME}.h>
#include <{NAME}_program.h>

int main(void)
{{
    static dac_sequencer sequencer;
    dac_tick now;
    if (!dac_sequencer_init(&sequencer, &{NAME}_x_converter, &{NAME}_y_converter)
        || dac_sequencer_load(&sequencer, &{NAME}_program) != DAC_LOADED || !dac_sequencer_commit(&sequencer))
        return 1;
    dac_sequencer_step(&sequencer, &now);
    dac_sequencer_arm(&sequencer, 0);
    dac_sequencer_trigger(&sequencer);
    for (int i = 0; i < {TICKS}; i++) {{
        dac_sequencer_step(&sequencer, &now);
        printf("%ld %ld\\n", (long)now.x, (long)now.y);
    }}
    return 0;
}}
"""


def run_offline(command: Sequence[str | Path], folder: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    """Run a packer, which can ask nobody."""
    nobody = dict.fromkeys(("https_proxy", "http_proxy"), "http://127.0.0.1:9")
    return subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, **nobody, **settings},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


def pack_platformio(folder: Path, own: Path) -> subprocess.CompletedProcess[str]:
    """Pack a library with PlatformIO into ``own / "packed.tar.gz"``, with nothing of the user."""
    own.mkdir()
    command = [sys.executable, "-m", "platformio", "pkg", "pack", folder, "--output", own / "packed.tar.gz"]
    return run_offline(command, own, PLATFORMIO_CORE_DIR=str(own), PLATFORMIO_SETTING_ENABLE_TELEMETRY="no")


def unpacked(archive: Path, folder: Path) -> set[str]:
    """Write the files of an archive, none of which is in a folder of its own; return their names."""
    folder.mkdir()
    with tarfile.open(archive) as packed:
        for member in filter(tarfile.TarInfo.isfile, packed):
            content = packed.extractfile(member)
            assert content is not None
            (folder / Path(member.name).name).write_bytes(content.read())
            assert Path(member.name).parent == Path()
    return {path.name for path in folder.iterdir()}


def plays_the_model(executable: Path, program: DualProgram) -> bool:
    """Compare what a main program prints with the words of the model."""
    played = subprocess.run([executable], capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    ticks = model_ticks(program, TICKS)[1:]
    expected = [f"{program.x.output.word(tick.x)} {program.y.output.word(tick.y)}" for tick in ticks]
    return played.stdout.splitlines() == expected
