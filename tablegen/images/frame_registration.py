"""Register the frames of a movie by phase correlation, and return their mean."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablegen.images.lattice_filters import filtered_images
from tablegen.numerics.arrays import Complexes, Floats

_FURTHEST = 0.1  # of the image: drift from a frame to the next
_BESIDE = 1.5  # pixels: neighbours of the maximum of the phases
_LEAST_FRAMES = 0.5  # of all frames: pixels that fewer have are missing in the mean


@dataclass(frozen=True, eq=False)
class RegisteredFrames:
    """The mean of frames, NaN where few have a pixel, and the shift x, y of each against the first, in pixels."""

    mean: Floats
    shifts: Floats


def registered(
    frames: Sequence[Floats], shifts: Floats | None = None, least_frames: float = _LEAST_FRAMES
) -> RegisteredFrames:
    """Shift frames onto the first one, by whole pixels, and average them.

    Parameters
    ----------
    frames
        Heights, shape (rows, columns) each.
    shifts
        Shifts of another channel of the same frames, shape (frames, 2); by default they are found.
    least_frames
        Share of the frames that have to have a pixel; with 0 the first frame, which has all, makes it complete.
    """
    shifts = _shifts(frames) if shifts is None else shifts
    padded = [_moved(frame, shift) for frame, shift in zip(frames, shifts, strict=True)]
    stack = np.array(padded)
    count = np.sum(np.isfinite(stack), axis=0)
    mean = np.sum(np.where(np.isfinite(stack), stack, 0.0), axis=0) / np.maximum(count, 1)
    return RegisteredFrames(np.where(count >= least_frames * len(frames), mean, np.nan), shifts)


def _shifts(frames: Sequence[Floats]) -> Floats:
    """Return the shift of each frame against the first one, in whole pixels, shape (frames, 2)."""
    spectra = [_spectrum(frame) for frame in frames]
    shape = frames[0].shape
    shifts = np.zeros((len(frames), 2))
    total = spectra[0].copy()
    for number in range(1, len(frames)):
        shifts[number] = _shift(total, spectra[number], shape, shifts[number - 1])
        total += spectra[number] * _turn(shape, shifts[number])
    return shifts


def _spectrum(frame: Floats) -> Complexes:
    image = filtered_images(frame)[0]
    return np.asarray(np.fft.rfft2(image.values * image.weight), dtype=np.complex128)


def _turn(shape: tuple[int, ...], shift: Floats) -> Complexes:
    v, u = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :]
    return np.asarray(np.exp(2j * np.pi * (u * shift[0] + v * shift[1])))


def _shift(reference: Complexes, spectrum: Complexes, shape: tuple[int, ...], near: Floats) -> Floats:
    """Return the shift of a frame against a reference, near the shift of the frame before.

    Phases alone tell a shift from those by a period of the lattice, and noise may move their maximum by a pixel: the
    correlation itself, in which the strong waves count most, decides between the neighbours.
    """
    cross = np.conj(reference) * spectrum
    phase = cross / np.sqrt(np.maximum(np.abs(cross), 1e-300))
    match = np.fft.irfft2(phase, (shape[0], shape[1]))
    y = (np.arange(shape[0]) + shape[0] // 2) % shape[0] - shape[0] // 2
    x = (np.arange(shape[1]) + shape[1] // 2) % shape[1] - shape[1] // 2
    far = np.hypot(x[None, :] - near[0], y[:, None] - near[1]) > _FURTHEST * min(shape)
    row, column = np.unravel_index(int(np.argmax(np.where(far, -np.inf, match))), match.shape)
    beside = np.hypot(x[None, :] - x[column], y[:, None] - y[row]) < _BESIDE
    correlation = np.fft.irfft2(cross, (shape[0], shape[1]))
    row, column = np.unravel_index(int(np.argmax(np.where(beside, correlation, -np.inf))), match.shape)
    return np.array([x[column], y[row]], dtype=np.float64)


def _moved(frame: Floats, shift: Floats) -> Floats:
    """Return a levelled frame, moved back by its shift; NaN where nothing comes from."""
    x, y = (round(one) for one in shift.tolist())
    rows, columns = frame.shape
    level = frame - np.nanmedian(frame, axis=1, keepdims=True)
    moved = np.full(frame.shape, np.nan)
    moved[max(-y, 0) : rows - max(y, 0), max(-x, 0) : columns - max(x, 0)] = level[
        max(y, 0) : rows - max(-y, 0), max(x, 0) : columns - max(-x, 0)
    ]
    return moved
