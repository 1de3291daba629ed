"""Photograph the page of the example in light and in dark colours, for docs/report.md. Usage: make figures"""

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from click.testing import CliRunner
from PIL import Image

from tablegen.cli import cli

FOLDER = Path(__file__).parent
SCAN = FOLDER.parent.parent / "examples" / "annexin_200nm.toml"
WIDTH, HEIGHT, SHRUNK = 1000, 1500, 700
QUIET = ("--disable-gpu", "--no-first-run", "--host-resolver-rules=MAP * ~NOTFOUND", "--hide-scrollbars")


def photographed(page: Path, scheme: int) -> Image.Image:
    """The upper part of a page; ``scheme`` is 0 for dark and 1 for light colours, as Chromium counts them."""
    target = page.with_name(f"{scheme}.png")
    options = (f"--user-data-dir={page.parent / 'profile'}", f"--blink-settings=preferredColorScheme={scheme}")
    size = (f"--window-size={WIDTH},{HEIGHT}", f"--screenshot={target}", "--virtual-time-budget=2000")
    command = ["chromium", "--headless", "--no-sandbox", *QUIET, *options, *size, page.as_uri()]
    subprocess.run(command, check=True, capture_output=True)
    with Image.open(target) as image:
        return image.convert("RGB").resize((SHRUNK, SHRUNK * HEIGHT // WIDTH), Image.Resampling.LANCZOS)


def main() -> None:
    """Write report.png."""
    with TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        CliRunner().invoke(cli, ["report", str(SCAN), "-o", str(page)], catch_exceptions=False)
        light, dark = (photographed(page, scheme) for scheme in (1, 0))
    both = Image.new("RGB", (2 * SHRUNK, light.height))
    both.paste(light, (0, 0))
    both.paste(dark, (SHRUNK, 0))
    both.quantize(256, kmeans=3, dither=Image.Dither.NONE).save(FOLDER / "report.png", optimize=True)


if __name__ == "__main__":
    main()
