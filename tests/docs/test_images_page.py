"""docs/images.md: every command of it runs, in its order, on images that the virtual scanner takes."""

import re
from pathlib import Path

import pytest
from page_images import PAGE, blocks, commands, typed
from refining import play, scanner

from tablegen.config.load import load

pytestmark = pytest.mark.common


def errors(folder: Path) -> list[float]:
    """Rms residual and the larger scaling error of x, then of y, of the emitted integers."""
    setup = load(folder / "scan.toml")
    found = []
    for name in ("x", "y"):
        true = play(setup, name, getattr(scanner(), name)).true  # type: ignore[arg-type]
        found += [true.rms_percent, max(true.scaling_percent.values())]
    return found


def table() -> list[list[float]]:
    """The figures of the page, a row a build."""
    rows = PAGE.read_text("utf-8").split("<!-- page -->\n")[1].split("<!-- /page -->")[0].splitlines()[2:]
    return [[float(cell) for cell in re.findall(r"[\d.]+", row.split("|", 2)[2])] for row in rows]


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_every_command_runs_and_the_scan_becomes_straight(tmp_path: Path) -> None:
    (scan,) = blocks("toml")
    (tmp_path / "scan.toml").write_text(scan, encoding="utf-8")
    found, said_of = [], {}
    for words in commands():
        outcome = typed(tmp_path, words)
        assert outcome.status == 0, (words, outcome.err)
        said_of.update({word: outcome.out for word in ("--lattice-nm", "--mismatch") if word in words})
        if words[0] == "build":
            found.append(errors(tmp_path))
    assert found[0][0] > 0.3
    assert found[-1][0] < 0.1
    assert found[-1][2] < 0.1
    assert found[-1][1] < 1.5
    shown = table()
    assert len(shown) == len(found)
    for row, was in zip(shown, found, strict=True):
        assert row == pytest.approx(was, rel=0.25, abs=0.1)
    (size,) = [line for line in said_of["--lattice-nm"].splitlines() if line.startswith("size of x: ")]
    (page_size,) = [line for line in PAGE.read_text("utf-8").splitlines() if line.startswith("size of x: ")]
    assert float(size.split()[3]) == pytest.approx(float(page_size.split()[3]), rel=1e-3)
    assert "an error that both share stays" in " ".join(said_of["--mismatch"].split())
