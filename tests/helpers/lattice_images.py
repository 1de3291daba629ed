"""Images with and without a lattice, from physics: three sites a cell, terraces, rows that jump, drift, noise."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.virtual.imaging import Surface

_SITES = np.array([[0.0, 0.0], [1.0 / 3.0, 1.0 / 3.0], [2.0 / 3.0, 2.0 / 3.0]])


def three_sites(seed: int, size: int = 128, scale: float = 1.0) -> tuple[Floats, Floats]:
    """Return an image of a lattice whose lowest orders are weak, and its mean cell in pixels, shape (2, 2).

    Three equal sites at thirds of the diagonal would have a cell of a third of the area. They are off by some 5 %, so
    that the lowest orders have some 10 % of the strongest amplitude. Half of the images have a terrace, half have rows
    that jump. All drift. ``scale`` is that of the sites and of the sides, which are 13 to 24 pixels.
    """
    rng = np.random.default_rng(seed)
    side = scale * rng.uniform(13.0, 19.0)
    angle = np.radians(rng.choice([60.0, 90.0, rng.uniform(65.0, 88.0)]))
    other = side * (1.0 if angle in (np.radians(60.0), np.radians(90.0)) else rng.uniform(1.0, 1.25))
    turn = rng.uniform(0.0, np.pi)
    cell = np.array([[side, 0.0], [other * np.cos(angle), other * np.sin(angle)]])
    cell = cell @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    y, x = np.mgrid[:size, :size].astype(np.float64)
    drift = rng.uniform(-1.0, 1.0)
    bent = x + drift * (y / size) ** 2
    at = np.stack([bent, y], axis=-1) @ np.linalg.inv(cell)
    offsets = 0.05 * np.array([[np.cos(t), np.sin(t)] for t in rng.uniform(0.0, 0.5) + np.array([0.0, 2.1, 4.2])])
    heights = np.zeros((size, size))
    for site in _SITES + offsets:
        away = at - site
        heights += np.exp(-np.sum(((away - np.round(away)) @ cell) ** 2, axis=-1) / (2.0 * (0.09 * side) ** 2))
    noise = 0.15 * heights.std()
    if rng.random() < 0.5:
        normal = rng.normal(size=2)
        heights += rng.uniform(1.0, 4.0) * ((x - size / 2) * normal[0] + (y - size / 2) * normal[1] > 0.0)
    if rng.random() < 0.5:
        heights += rng.uniform(0.2, 1.0) * rng.normal(size=(size, 1))
    image = heights + noise * rng.normal(size=heights.shape) + 0.01 * x - 0.01 * y
    return image, cell - np.outer(cell[:, 1], [drift / size, 0.0])


@dataclass(frozen=True, eq=False)
class SitesOnTerrace:
    """A sample for ``calibrating.Scanner``: three sites a cell, as of ``three_sites``, and a terrace.

    Lengths are in lines of 100 V; ``step`` is the height of the terrace, where a site has 1.
    """

    seed: int
    step: float
    pixels: int = 128
    lines: int = 128
    window: tuple[float, float] = (0.0, 1.0)
    lag: float = 1.0
    drift: float = 0.01

    def height(self, x: Floats, y: Floats) -> Floats:
        """At x and y in lines."""
        rng = np.random.default_rng(self.seed)
        side, turn, begins = rng.uniform(0.1, 0.15), rng.uniform(0.0, np.pi), rng.uniform(0.0, 0.5)
        cell = side * np.array([[np.cos(turn + a), np.sin(turn + a)] for a in (0.0, np.pi / 3.0)])
        offsets = 0.05 * np.array([[np.cos(t), np.sin(t)] for t in begins + np.array([0.0, 2.1, 4.2])])
        x, y = np.broadcast_arrays(x, y)
        at = np.stack([x, y], axis=-1) @ np.linalg.inv(cell)
        normal = rng.normal(size=2)
        heights = self.step * ((x - 0.5) * normal[0] + (y - 0.5) * normal[1] > 0.0)
        for site in _SITES + offsets:
            away = at - site
            heights += np.exp(-np.sum(((away - np.round(away)) @ cell) ** 2, axis=-1) / (2.0 * (0.09 * side) ** 2))
        return heights


@dataclass(frozen=True, eq=False)
class OnTerraces:
    """A sample for ``calibrating.Scanner``, in lines of 100 V, on four terraces with steps of this height."""

    sample: "Heights"
    step: float
    angle: float
    pixels: int = 128
    lines: int = 96
    window: tuple[float, float] = (0.0, 1.0)
    lag: float = 1.0
    drift: float = 0.0

    def height(self, x: Floats, y: Floats) -> Floats:
        """At x and y in lines."""
        along = x + np.tan(np.radians(self.angle)) * y
        return self.sample.height(x, y) + self.step * np.sum([along > at for at in (0.2, 0.45, 0.75)], axis=0)


class Heights(Protocol):
    """A surface."""

    def height(self, x: Floats, y: Floats) -> Floats:
        """At x and y in lines."""


def weak_lowest(pitch: float, times: float, turned: float, share: float) -> Surface:
    """Return a hexagonal lattice of this pitch of its densest rows, whose strong waves are finer by ``times``.

    The lowest waves have a ``share`` of the strong ones' height; the strong ones are ``turned`` by degrees.
    """

    def height(x: Floats, y: Floats) -> Floats:
        total = np.zeros(np.broadcast(x, y).shape)
        for n, size in enumerate((1.0, 0.9, 0.8)):
            for length, angle, amplitude, begins in (
                (pitch, 7.0 + 60.0 * n, share * size, 0.1 * n),
                (pitch / times, 7.0 + 60.0 * n + turned, size, 0.3 * n + 0.05),
            ):
                a = np.radians(angle)
                total = total + amplitude * np.cos(2.0 * np.pi * ((x * np.cos(a) + y * np.sin(a)) / length + begins))
        return total

    return height


def without_lattice(seed: int, size: int = 128) -> Floats:
    """Return noise, a rough surface, stripes, steps, or single molecules, by turns."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size].astype(np.float64)
    noise = rng.normal(size=(size, size))
    match seed % 5:
        case 0:
            return noise
        case 1:
            wave = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None]) + 1.0 / size
            rough = np.fft.irfft2(np.fft.rfft2(noise) * wave ** -rng.uniform(1.0, 2.0), (size, size))
            return np.asarray(rough / rough.std() + 0.05 * noise)
        case 2:
            return np.asarray(
                np.cos(2.0 * np.pi * (x * rng.uniform(0.05, 0.2) + y * rng.uniform(0.0, 0.2))) + 0.3 * noise
            )
        case 3:
            places = np.sort(rng.uniform(-size, 2 * size, 8))
            along = x * np.cos(seed) + y * np.sin(seed)
            return np.asarray(np.sum(along[..., None] > places, axis=-1) + 0.1 * noise)
        case _:
            heights = 0.05 * noise
            for _ in range(int(rng.integers(3, 25))):
                u, v, width = rng.uniform(0.0, size), rng.uniform(0.0, size), rng.uniform(2.0, 5.0)
                heights += rng.uniform(0.5, 1.5) * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2.0 * width**2))
            return heights


def narrow_sites(seed: int, size: int = 128) -> tuple[Floats, Floats]:
    """Return an image of a hexagonal lattice whose sites are narrower than a pixel, and its cell in pixels."""
    rng = np.random.default_rng(seed)
    side, width, turn = rng.uniform(4.0, 9.0), rng.uniform(0.3, 0.8), rng.uniform(0.0, np.pi)
    cell = side * np.array([[np.cos(turn + a), np.sin(turn + a)] for a in (0.0, np.pi / 3.0)])
    y, x = np.mgrid[:size, :size].astype(np.float64)
    at = np.stack([x, y], axis=-1) @ np.linalg.inv(cell)
    heights = np.exp(-np.sum(((at - np.round(at)) @ cell) ** 2, axis=-1) / (2.0 * width**2))
    noise = np.random.default_rng(seed).normal(size=heights.shape)
    return heights + 0.1 * heights.std() * noise, cell
