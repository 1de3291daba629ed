"""PWL sources: a linear interpolation of the file, as a simulator does it, is the voltage that the converter holds."""

from pathlib import Path

import numpy as np
import pytest
from building import EXAMPLE, changed

import tablegen
from tablegen.emit.formats import get
from tablegen.emit.stored import stored_content

SCANNER = EXAMPLE.parent / "scanner.toml"


@pytest.fixture(scope="module")
def scan() -> tablegen.Build:
    short = changed(EXAMPLE, {"timing.lines": 8, "limits": {}})
    return tablegen.build(scan=short, scanner=changed(SCANNER, {}), formats=["pwl"])


@pytest.mark.parametrize("axis", ["x", "y"])
def test_it_holds_each_code_for_its_tick(scan: tablegen.Build, axis: str) -> None:
    time, volts = np.loadtxt(scan.files[f"annexin_200nm_{axis}.pwl"].decode("ascii").splitlines(), unpack=True)
    samples = getattr(scan, axis)
    tick_s = 1 / 500e3
    assert np.all(np.diff(time) > 0.0)
    for share in (0.01, 0.5, 0.99):
        assert np.interp(samples.time_s + share * tick_s, time, volts) == pytest.approx(samples.volts, abs=1e-9)
    assert time[-1] == pytest.approx(len(samples) * tick_s, rel=1e-12)
    assert np.max(np.abs(np.diff(volts))) == pytest.approx(np.max(np.abs(np.diff(samples.volts))))


def test_an_edited_file_is_found(scan: tablegen.Build, tmp_path: Path) -> None:
    scan.write(tmp_path)
    content, path = stored_content(tablegen.read_build(tmp_path)), tmp_path / "annexin_200nm_x.pwl"
    assert get("pwl").check(tmp_path, content)[0].wrong == []
    lines = path.read_text("ascii").splitlines()
    lines[7] = lines[7].replace(" ", " 1")
    path.write_text("\n".join(lines) + "\n", "ascii")
    (wrong,) = get("pwl").check(tmp_path, content)[0].wrong
    assert wrong.startswith(f"{path.name}: line 8 is ")
