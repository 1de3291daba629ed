"""Images of an uncompensated scanner, of lattices with weak lowest orders or of none, and how wrong a correction is."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from correcting import old_frame
from lattice_images import without_lattice
from scipy.ndimage import map_coordinates

from tablegen.base.data_files import Source
from tablegen.base.input_errors import Unphysical
from tablegen.correction.by_fit import by_fit
from tablegen.correction.distortion import Distortion
from tablegen.correction.old_scan import OldScan
from tablegen.correction.scan_images import Images
from tablegen.images.files import ScanImage
from tablegen.numerics.arrays import Floats
from tablegen.virtual.imaging import FrameImages, SweepImage

_PIEZOS = ("default", "duhem", "plays", "bouc-wen", "paper")
_SIZES_V = (45.0, 90.0)
_SITES = np.array([[0.0, 0.0], [1.0 / 3.0, 1.0 / 3.0], [2.0 / 3.0, 2.0 / 3.0]])
_NOTHING = Source("generated", "0" * 64)

Knowledge = Literal["size and constant", "constant", "size", "nothing"]


@dataclass(frozen=True, eq=False)
class DistortedLattice:
    """Trace and retrace of a lattice, the positions of their pixels, and the constant and kind of the lattice."""

    frame: FrameImages
    constant_nm: float
    kind: str


def distorted_lattice(seed: int, pixels: int = 128) -> DistortedLattice:
    """Return a frame with 7 to 10 cells a side, imaged with the hysteresis of one of five piezos and with drift.

    Three sites a cell, off thirds of its diagonal by 5 %, leave the lowest orders some 10 % of the strongest amplitude.
    Half of the samples have a terrace, half of the frames rows that jump, in trace and retrace differently. The sample
    drifts by up to 3 % of the frame, part of it ever faster. Noise is 15 % of the rms of the lattice.
    """
    rng = np.random.default_rng(seed)
    blank = _blank(_PIEZOS[seed % len(_PIEZOS)], _SIZES_V[seed // len(_PIEZOS) % len(_SIZES_V)], pixels)
    across, along = (float(np.ptp(one)) for one in (blank.trace.x_nm, blank.trace.y_nm))
    kind, degrees = (("hexagonal", 60.0), ("square", 90.0))[int(rng.integers(2))]
    side, angle, turn = across * rng.uniform(13.0, 19.0) / 128.0, np.radians(degrees), rng.uniform(0.0, np.pi)
    cell = side * np.array([[np.cos(turn), np.sin(turn)], [np.cos(turn + angle), np.sin(turn + angle)]])
    phases = rng.uniform(0.0, 0.5) + np.array([0.0, 2.1, 4.2])
    sites = _SITES + 0.05 * np.stack([np.cos(phases), np.sin(phases)], axis=1)
    steady, faster = rng.uniform(-0.02, 0.02, 2), rng.uniform(-0.01, 0.01, 2)
    normal, edge = rng.normal(size=2), rng.uniform(1.0, 4.0) * (rng.random() < 0.5)
    jump = rng.uniform(0.2, 1.0) * (rng.random() < 0.5)
    middle = float(np.mean(blank.trace.x_nm)), float(np.mean(blank.trace.y_nm))
    images = []
    for one in (blank.trace, blank.retrace):
        elapsed = (one.y_nm - blank.trace.y_nm.min()) / along
        drift = [
            size * (a * elapsed + b * elapsed**2) for size, a, b in zip((across, along), steady, faster, strict=True)
        ]
        x, y = one.x_nm + drift[0], one.y_nm + drift[1]
        heights = _motifs(x, y, cell, sites)
        noise = 0.15 * float(np.std(heights))
        heights += edge * ((x - middle[0]) * normal[0] + (y - middle[1]) * normal[1] > 0.0)
        heights += jump * rng.normal(size=(len(heights), 1)) + noise * rng.normal(size=heights.shape)
        images.append(SweepImage(heights, one.x_nm, one.y_nm, (drift[0], drift[1])))
    return DistortedLattice(FrameImages(images[0], images[1]), side, kind)


def _motifs(x: Floats, y: Floats, cell: Floats, sites: Floats) -> Floats:
    """Return Gaussians at the sites of each cell."""
    at = np.stack([x, y], axis=-1) @ np.linalg.inv(cell)
    heights = np.zeros(x.shape)
    for site in sites:
        away = at - site
        heights += np.exp(
            -np.sum(((away - np.round(away)) @ cell) ** 2, axis=-1) / (2.0 * (0.09**2) * cell[0] @ cell[0])
        )
    return heights


@lru_cache
def _blank(plant: str, size_v: float, pixels: int) -> FrameImages:
    return old_frame(plant, surface=_level, size_v=size_v, pixels=pixels, lines=pixels, noise=0.0)


def _level(x: Floats, y: Floats) -> Floats:
    return np.zeros(np.broadcast(x, y).shape)


def images_of(trace: Floats, retrace: Floats, size_nm: tuple[float, float] | None) -> Images:
    """Return trace and retrace as read from a file with this size, or without."""
    width, height = size_nm or (None, None)
    channels = tuple(
        ScanImage("generated", _NOTHING, heights, name, number, "Z", direction, width_nm=width, height_nm=height)
        for number, (heights, name, direction) in enumerate(
            ((trace, "Z forward", "trace"), (retrace, "Z backward", "retrace"))
        )
    )
    return Images(channels, (True, False), (0, 1), (), False)


def corrected(lattice: DistortedLattice, known: Knowledge) -> Distortion:
    """Return the correction that `correct --fit` applies.

    Raises
    ------
    Unphysical
        If it refuses the image.
    """
    trace, retrace = lattice.frame.trace, lattice.frame.retrace
    size = (float(np.ptp(trace.x_nm)), float(np.ptp(trace.y_nm))) if "size" in known else None
    images = images_of(trace.heights, retrace.heights, size)
    constant = lattice.constant_nm if "constant" in known else None
    scan, _ = by_fit(images, OldScan(), lattice_nm=constant, kind=None if constant is None else lattice.kind)
    return scan.distortion


@dataclass(frozen=True)
class Deviation:
    """How far a correction is off: the strain of the cell, and a pixel from the best cell, in percent of the width.

    ``displacement`` is that within all but the outermost twentieths of rows and columns, ``outermost`` that of any
    pixel. Without a constant the strain is 0: the frame may then be any affine picture of the sample.
    """

    strain: float
    displacement: float
    outermost: float

    @property
    def wrong(self) -> bool:
        """True if a side is off by 0.5 %, or a pixel by one of 128, or by two at the edge."""
        return self.strain > 0.5 or self.displacement > 100.0 / 128.0 or self.outermost > 200.0 / 128.0


def deviation(distortion: Distortion, lattice: DistortedLattice, known: Knowledge) -> Deviation:
    """Compare the places of all pixels in the corrected picture with those on the sample."""
    places, truths, inner = [], [], []
    for forward, image in ((True, lattice.frame.trace), (False, lattice.frame.retrace)):
        row, column, inside = distortion.sources(forward)
        inside &= (row > 0) & (row < distortion.rows - 1) & (column > 0) & (column < distortion.columns - 1)
        inner.append((np.abs(row / distortion.rows - 0.5) < 0.45) & (np.abs(column / distortion.columns - 0.5) < 0.45))
        inner[-1] = inner[-1][inside]
        x, y = np.meshgrid(*distortion.grid)
        places.append(np.stack([np.ones(np.sum(inside)), x[inside], y[inside]], axis=1))
        true = (image.x_nm + image.drift_nm[0], image.y_nm + image.drift_nm[1])
        truths.append(np.stack([map_coordinates(one, [row, column], order=1)[inside] for one in true], axis=1))
    place, truth = np.concatenate(places), np.concatenate(truths)
    plane = np.linalg.lstsq(place, truth, rcond=None)[0]
    error = np.abs(truth - place @ plane) / np.ptp(truth, axis=0)
    strain = float(np.max(np.abs(np.linalg.svd(plane[1:], compute_uv=False) - 1.0))) if "constant" in known else 0.0
    inside = error[np.concatenate(inner)]
    return Deviation(100.0 * strain, 100.0 * float(np.max(inside)), 100.0 * float(np.max(error)))


def without_period(seed: int) -> Images:
    """Return trace and retrace of a sample without a lattice, in a file with its size."""
    image = without_lattice(seed)
    return images_of(
        image, image + 0.05 * np.std(image) * np.random.default_rng(seed).normal(size=image.shape), (1e3, 1e3)
    )


def accepted_without_period(seed: int) -> bool:
    """Return True if a sample without a lattice is corrected, with its constant and without."""
    for constant in (None, 100.0):
        try:
            by_fit(without_period(seed), OldScan(), lattice_nm=constant)
        except Unphysical:
            continue
        return True
    return False
