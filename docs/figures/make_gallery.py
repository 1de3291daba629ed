"""Draw the pictures of docs/gallery.md and write its table, from the scans themselves. Usage: make figures"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from click.testing import CliRunner
from PIL import Image

import tablegen
from tablegen.cli import cli

FOLDER = Path(__file__).parent
PAGE = FOLDER.parent / "gallery.md"
EXAMPLES = FOLDER.parents[1] / "examples"
SCANS = {
    "HS-AFM": EXAMPLES / "gallery" / "hs_afm" / "scan.toml",
    "large range": EXAMPLES / "gallery" / "large_range" / "scan.toml",
    "tube": EXAMPLES / "tube_5um.toml",
    "line": EXAMPLES / "gallery" / "line" / "scan.toml",
    "closed-loop stage": EXAMPLES / "gallery" / "closed_loop" / "scan.toml",
}
HEAD = (
    "| scan | axis | drive [V p-p] | rate [Hz] | ticks | largest error [LSB] | scaling error: plain -> emitted [%] |",
    "|---|---|---|---|---|---|---|",
)
BEGIN, END = "<!-- measured -->\n", "<!-- /measured -->"


def rows(name: str, path: Path) -> list[str]:
    """What the certificate says of each axis."""
    build = tablegen.build(path)
    found = []
    for line in build.plan.moving:
        axis, certificate = line.axis, build.certificates[line.axis]
        errors = ", ".join(
            f"{side}: {one.uncompensated:.1f} -> {one.total:.2f}" for side, one in certificate.scaling.items()
        )
        rate = f"{float(line.rate):.4g}"
        found.append(
            f"| {name} | {axis} | {line.drive.v_amplitude:.2f} | {rate} | {certificate.ticks} | "
            f"{certificate.max_error_lsb:.2f} | {errors} |"
        )
    return found


def draw(path: Path, target: Path) -> None:
    """The drive of a line of x, and its position error without and with the correction, side by side."""
    with TemporaryDirectory() as folder:
        names = ("drive-x", "error-x-without-correction", "error-x-as-built")
        result = CliRunner().invoke(cli, ["report", str(path), "-o", f"{folder}/r.html", "--png", folder])
        if result.exit_code:
            sys.exit(result.output)
        parts = [Image.open(f"{folder}/{name}.png") for name in names if Path(folder, f"{name}.png").exists()]
    width, height = parts[0].size
    whole = Image.new("RGB", (width * len(parts), height), "white")
    for number, part in enumerate(parts):
        whole.paste(part, (number * width, 0))
    whole.thumbnail((1350, 1000))
    whole.quantize(256).save(target, optimize=True)


def picture(name: str) -> Path:
    """Of a scan."""
    return FOLDER / f"gallery_{name.lower().replace(' ', '_').replace('-', '_')}.png"


def main() -> None:
    """Both."""
    table = [*HEAD]
    for name, path in SCANS.items():
        table += rows(name, path)
        draw(path, picture(name))
    text = PAGE.read_text("utf-8")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    PAGE.write_text(before + BEGIN + "\n".join(table) + "\n" + END + after, "utf-8")


if __name__ == "__main__":
    main()
