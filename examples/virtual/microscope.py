"""A microscope to try tablegen on: it takes images on the virtual scanner. Everything is a simulation.

    python microscope.py triangle NAME --axis x --volts 60 --grating-nm 40    a plain triangle on both axes
    python microscope.py scan NAME scan.toml --lattice-nm 60                  the emitted integers of a build

Both write NAME_trace.npy, NAME_retrace.npy (heights, a row a line) and NAME.png (the trace), and print how far the
pixels are from where they should be, which no real microscope knows.
"""

import argparse

import numpy as np
from PIL import Image

import tablegen
from tablegen.virtual.imaging import Conditions, FrameImages, grating, hexagonal, running_frame, triangle_frame
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scanner import VirtualScanner

PIXELS = 256
MIDDLE_V = 50.0


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description="Take images on the virtual scanner.")
    parser.add_argument("mode", choices=("triangle", "scan"))
    parser.add_argument("name", help="of the images")
    parser.add_argument("scan", nargs="?", help="the scan file, in the mode scan")
    parser.add_argument("--axis", choices=("x", "y"), default="x", help="the fast axis of a triangle")
    parser.add_argument("--volts", type=float, default=60.0, help="size of a triangle, peak to peak at the piezo")
    parser.add_argument("--rate-hz", type=float, default=100.0, help="lines a second of a triangle")
    parser.add_argument("--lines", type=int, default=256, help="rows of a triangle's image")
    parser.add_argument("--grating-nm", type=float, help="the sample is a grating with this pitch")
    parser.add_argument("--lattice-nm", type=float, default=60.0, help="the sample is a lattice with this constant")
    parser.add_argument(
        "--frame", type=int, default=1, help="number of the frame; the sample drifts from one to the next"
    )
    return parser.parse_args()


def take(options: argparse.Namespace) -> FrameImages:
    """An image, with noise and drift."""
    scanner = VirtualScanner.of(load_truth("default"))
    sample = grating(options.grating_nm) if options.grating_nm else hexagonal(options.lattice_nm)
    disturbed = Conditions(noise=0.04, drift=(0.004, 0.004), frame=options.frame - 1, seed=options.frame)
    if options.mode == "scan":
        return running_frame(tablegen.plan(tablegen.load(options.scan)), scanner.x, scanner.y, sample, disturbed)
    fast, slow = (scanner.x, scanner.y) if options.axis == "x" else (scanner.y, scanner.x)
    sizes, offsets = (options.volts, options.volts), (MIDDLE_V, MIDDLE_V)
    return triangle_frame(fast, slow, sample, sizes, offsets, options.rate_hz, disturbed, PIXELS, options.lines)


def bent(places: np.ndarray, along: int) -> float:
    """How far pixels are from an evenly spaced line, at most, in percent of the line."""
    line = places.mean(axis=1 - along)
    even = np.polyval(np.polyfit(np.arange(len(line)), line, 1), np.arange(len(line)))
    return 100.0 * float(np.abs(line - even).max() / np.ptp(even))


def main() -> None:
    """Take, save, tell."""
    options = arguments()
    try:
        images = take(options)
    except tablegen.Rejected as rejected:
        raise SystemExit(str(rejected)) from None
    for side in ("trace", "retrace"):
        np.save(f"{options.name}_{side}.npy", getattr(images, side).heights)
    low, high = np.percentile(images.trace.heights, [1, 99])
    grey = np.clip((images.trace.heights - low) / (high - low), 0, 1)
    Image.fromarray((255 * grey).astype(np.uint8)).save(f"{options.name}.png")
    x, y = images.trace.x_nm, images.trace.y_nm
    apart = 100.0 * float(np.abs(x - images.retrace.x_nm).max() / np.ptp(x))
    off = f"off by at most {bent(x, 1):.2f} % along the lines, {bent(y, 0):.2f} % across"
    print(f"{options.name}: {np.ptp(x):.0f} x {np.ptp(y):.0f} nm; {off}; trace and retrace {apart:.2f} % apart")


if __name__ == "__main__":
    main()
