"""The commands of docs/images.md, run in their order on images that the virtual scanner takes as they are needed."""

import re
import shlex
from pathlib import Path

import numpy as np
from building import REPOSITORY
from editing import Outcome, run
from refining import IMAGED, scanner
from replacing import replace

from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.imaging import FrameImages, Surface, grating, hexagonal, rough, running_frame, triangle_frame

PAGE = REPOSITORY / "docs" / "images.md"
PIXELS = 128
_TRIANGLE = re.compile(r"(?:re)?trace_([xy])_(\d+)v(?:_at(\d+)v)?\.npy")
_RUNNING = re.compile(r"(?:re)?trace_(run|rough)(\d+)(?:_frame(\d+))?\.npy")


def blocks(kind: str) -> list[str]:
    """The code of the page in one language."""
    return re.findall(rf"^```{kind}\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)


def commands() -> list[list[str]]:
    """What is typed, a command each, without ``tablegen``."""
    lines = "\n".join(blocks("sh")).replace("\\\n", " ").splitlines()
    return [shlex.split(line)[1:] for line in lines if line.startswith("tablegen ")]


def typed(folder: Path, words: list[str], plant: str = "default") -> Outcome:
    """A command of the page in a folder, once the images that it names have been taken."""
    for word in words:
        if word.endswith(".npy") and not (folder / word).exists():
            _take(folder, word, plant)
    files = [str(folder / word) if re.fullmatch(r"[\w.]+\.(npy|toml)|build", word) else word for word in words[1:]]
    return run(words[0], *files) if words[0] != "build" else run("build", *files, "-q")


def _take(folder: Path, name: str, plant: str) -> None:
    """Trace and retrace of the scan that the name says."""
    triangle, running = _TRIANGLE.fullmatch(name), _RUNNING.fullmatch(name)
    truth = scanner(plant)
    frame: FrameImages
    if triangle is not None:
        volts, offset = float(triangle[2]), float(triangle[3] or 50.0)
        fast, slow = (truth.x, truth.y) if triangle[1] == "x" else (truth.y, truth.x)
        bars, seed = grating(40.0), int(volts + 3 * offset) + (1000 if triangle[1] == "y" else 0)
        both = (volts, volts), (offset, offset)
        frame = triangle_frame(fast, slow, bars, *both, 100.0, replace(IMAGED, seed=seed), PIXELS, PIXELS)
    elif running is not None:
        plan, number = make_plan(load(folder / "scan.toml")), int(running[3] or 1) - 1
        sample: Surface = hexagonal(35.0) if running[1] == "run" else rough(25.0)
        seen = replace(IMAGED, frame=number, seed=100 * int(running[2]) + number)
        frame = running_frame(plan, truth.x, truth.y, sample, seen)
    else:
        raise ValueError(f"{name} is no image of the page")
    stem = name.removeprefix("re")
    np.save(folder / stem, frame.trace.heights)
    np.save(folder / f"re{stem}", frame.retrace.heights)
