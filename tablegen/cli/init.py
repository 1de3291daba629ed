"""``tablegen init``: write a commented scanner file and scan file to start from."""

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.shared.common import OutputFolder, fail, finite, written
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.cli.init_files import Wishes

_NUMBER = re.compile(r"([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*([a-zA-Z\u00b5]*)")
_HERTZ = {"": 1.0, "hz": 1.0, "k": 1e3, "khz": 1e3, "m": 1e6, "mhz": 1e6}
_SHORTEST_NM, _LONGEST_NM = 1e-3, 1e9  # of the range of a scanner
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6, "ns": 1e-9}


def _quantity(
    units: dict[str, float], example: str
) -> Callable[[click.Context, click.Parameter, str | None], float | None]:
    """Return a callback of options: a positive number with a unit, in the unit whose factor is 1."""

    def read(_context: click.Context, _option: click.Parameter, value: str | None) -> float | None:
        """Convert the value of the option.

        Raises
        ------
        click.BadParameter
            If it is no positive number with such a unit.
        """
        if value is None:
            return None
        match = _NUMBER.fullmatch(value.strip())
        factor = None if match is None else units.get(match[2].lower())
        try:
            number = float(match[1]) * factor if match is not None and factor is not None else 0.0
        except ValueError:
            number = 0.0
        if not 0.0 < number < 1e12:
            raise click.BadParameter(f"'{value}' is not a number with a unit, such as {example}.")
        return number

    return read


@click.command(short_help="Write a scan file and scanner file to start from.")
@click.argument("folder", type=OutputFolder(), default=Path("."), metavar="[DIR]")
@click.option(
    "--image-nm",
    type=float,
    callback=finite,
    metavar="NM",
    help="Size of the image in nm.  [default: 200; with --nm-per-v, if 200 nm are below 2 or above 50 % of the range,"
    " up to a quarter of it]",
)
@click.option("--image-um", type=float, callback=finite, metavar="UM", help="Size of the image in micrometres.")
@click.option("--pixels", type=int, metavar="N", help="Pixels per line and direction.  [default: 200]")
@click.option("--lines", type=int, metavar="N", help="Lines of the image.  [default: as many as pixels]")
@click.option(
    "--frame",
    type=click.Choice(["flyback", "up-down"]),
    default="flyback",
    show_default=True,
    help="flyback: every image goes up. up-down: images go up and down in turn.",
)
@click.option("--line-rate", type=float, callback=finite, metavar="HZ", help="Lines per second.")
@click.option("--frame-rate", type=float, callback=finite, metavar="HZ", help="Frames per second; or --line-rate.")
@click.option("--bits", type=int, default=16, show_default=True, metavar="N", help="Bits of the DAC.")
@click.option(
    "--clock", callback=_quantity(_HERTZ, "500k or 1MHz"), metavar="HZ", help="Update rate of the DAC.  [default: 500k]"
)
@click.option(
    "--tick", callback=_quantity(_SECONDS, "2us"), metavar="TIME", help="Time between two updates, in place of --clock."
)
@click.option("--v-max", type=float, callback=finite, metavar="V", help="Highest output of your piezo driver.")
@click.option("--v-min", type=float, callback=finite, metavar="V", help="Lowest output of your piezo driver.")
@click.option("--nm-per-v", type=float, callback=finite, metavar="K", help="Sensitivity of your scanner in nm/V.")
@click.option("--gain", type=float, callback=finite, metavar="G", help="Gain of your amplifier.")
@click.option("--name", metavar="NAME", help="Name of the scan, and of its file.  [default: from the size]")
@click.option("--force", is_flag=True, help="Overwrite existing files.")
def init(
    folder: Path,
    image_nm: float | None,
    image_um: float | None,
    pixels: int | None,
    lines: int | None,
    frame: str,
    line_rate: float | None,
    frame_rate: float | None,
    bits: int,
    clock: float | None,
    tick: float | None,
    v_max: float | None,
    v_min: float | None,
    nm_per_v: float | None,
    gain: float | None,
    name: str | None,
    force: bool,
) -> int:
    """Write a scan file and a scanner file with comments to DIR: scanner.toml and annexin_200nm.toml.

    The default of DIR is the current directory. The options set values in the files; the command chooses all
    other values so that the scan can be built. The scanner is an example whose range fits the image: calibrate your own
    scanner, and keep the scan file.

    With --v-max, --v-min, --nm-per-v or --gain the scanner file is that of your scanner. It then has no hysteresis,
    because none has been measured yet, and a comment says how to measure it.

    \b
    Examples:
      tablegen init demo
      tablegen init demo --image-um 2 --pixels 512 --line-rate 1
      tablegen init mine --v-max 150 --nm-per-v 20 --gain 15
      tablegen init demo --bits 12 --clock 100k --pixels 128

    Exit status: 0 done, 2 a file exists already (see --force) or no such scan can be built, 4 cannot write.
    """
    if image_nm is not None and image_um is not None:
        raise click.UsageError("give --image-nm or --image-um, not both")
    if line_rate is not None and frame_rate is not None:
        raise click.UsageError("give --line-rate or --frame-rate, not both")
    if clock is not None and tick is not None:
        raise click.UsageError("give --clock or --tick, not both")
    from tablegen.cli.init_files import Wishes, files, usual_image_nm

    size = image_nm if image_um is None else float(f"{1e3 * image_um:.12g}")
    rates = {"line_rate_hz": line_rate, "frame_rate_hz": frame_rate}
    rate = next(((key, value) for key, value in rates.items() if value is not None), None)
    if not (size is None or size > 0.0) or (pixels is not None and pixels < 1):
        raise click.UsageError("an image has a size above 0, and one pixel at least")
    pixels = 200 if pixels is None else pixels
    wishes = Wishes(
        bits=bits,
        update_rate_hz=clock or (500e3 if tick is None else float(f"{1.0 / tick:.12g}")),
        image_nm=200.0 if size is None else size,
        pixels=pixels,
        image_lines=pixels if lines is None else lines,
        frame=frame,
        rate=rate,
        name=name or "",
        v_min=v_min,
        v_max=v_max,
        nm_per_v=nm_per_v,
        gain=gain,
    )
    low, high = wishes.driver
    if not low < high:
        raise click.UsageError(f"the driver goes from {low:g} to {high:g} V: give a --v-max above --v-min")
    if nm_per_v is not None and not nm_per_v > 0.0:
        raise click.UsageError(f"--nm-per-v {nm_per_v:g} is not above 0")
    if nm_per_v is not None and not _SHORTEST_NM < (high - low) * nm_per_v < _LONGEST_NM:
        reach = f"{high - low:g} V by --nm-per-v {nm_per_v:g} are {(high - low) * nm_per_v:g} nm"
        raise click.UsageError(f"{reach}: no range of a scanner; --nm-per-v is in nm/V at the piezo")
    if size is None:
        wishes = replace(wishes, image_nm=usual_image_nm(wishes.driver, nm_per_v))
    texts = files(wishes)
    there = [folder / name for name in texts if os.path.lexists(folder / name)]
    if there and not force:
        fail([f"{path} exists; --force overwrites it" for path in there], ExitStatus.WRONG_INPUT)
    if wishes != Wishes():
        texts = _checked(wishes)
    written(folder, {name: text.encode("utf-8") for name, text in texts.items()})
    for name in texts:
        click.echo(folder / name)
    return ExitStatus.OK


def _checked(wishes: "Wishes") -> dict[str, str]:
    """Return the files, with tables as long as the scan needs; if no build is possible, end with the reasons."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tablegen.api.build import BrokenLimit, build
    from tablegen.base.input_errors import Rejected
    from tablegen.base.toml import parse_toml
    from tablegen.cli.init_files import SCANNER_FILE, TABLE_LENGTHS, files

    for length in TABLE_LENGTHS:
        texts = files(replace(wishes, table_length=length))
        scan_file = next(name for name in texts if name != SCANNER_FILE)
        values, scanner = (parse_toml(texts[name], name)[0] for name in (scan_file, SCANNER_FILE))
        try:
            built = build(scan=values, scanner=scanner)
        except Rejected as rejected:
            short = all(problem.key == "limits.max_error_lsb" for problem in rejected.problems)
            if isinstance(rejected, BrokenLimit) and short and length != TABLE_LENGTHS[-1]:
                continue
            lines = [f"{problem.key}: {problem.why}" for problem in rejected.problems]
            fail([*lines, "nothing was written; give other options"], ExitStatus.WRONG_INPUT)
        for warning in built.warnings:
            click.echo(f"warning: {scan_file}{warning.removeprefix('scan')}", err=True)
        break
    return texts
