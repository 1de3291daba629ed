"""Images and movies of JPK (.h5-jpk): an HDF5 file with a group for each channel, and a column for each frame.

The grid and the rate are attributes of the measurement, the scale those of the channel. The first row is the bottom
one, unless the grid is reflected.
"""

from functools import partial
from math import degrees

import numpy as np

from tablegen.images.formats.channel import (
    Channel,
    Direction,
    Matrix,
    check_pixels,
    number,
    positive,
    quote,
)
from tablegen.images.formats.hdf5 import Attribute, Hdf5Array, hdf5_array, hdf5_members, hdf5_object, hdf5_root

_MAX_CHANNELS = 1000
_MEASUREMENT, _CHANNEL = "Measurement_", "Channel_"
_GRID, _SCALING = "position-pattern.grid.", "net-encoder.scaling."
_LINEAR = {"type": "linear", "style": "offsetmultiplier"}
_Attributes = dict[str, Attribute]


def h5_jpk_channels(content: bytes, _: str) -> list[Channel]:
    """Return the channels of a JPK file of HDF5, a movie or one image.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    channels: list[Channel] = []
    groups = hdf5_members(content, hdf5_root(content))
    measurements = sorted(one for one in groups if one.startswith(_MEASUREMENT))
    if len(measurements) > _MAX_CHANNELS:
        raise ValueError(f"has {len(measurements)} measurements; at most {_MAX_CHANNELS} are read")
    for name in measurements:
        measurement = hdf5_object(content, groups[name])
        attributes = measurement.attributes()
        members = hdf5_members(content, measurement)
        for own in sorted(one for one in members if one.startswith(_CHANNEL)):
            if len(channels) >= _MAX_CHANNELS:
                raise ValueError(f"has more than {_MAX_CHANNELS} channels")
            channels.append(_channel(content, len(channels), members[own], attributes))
    return channels


def _channel(content: bytes, at: int, address: int, measurement: _Attributes) -> Channel:
    group = hdf5_object(content, address)
    attributes = group.attributes()
    signal = str(attributes.get("channel.name", ""))
    values = _values(content, hdf5_members(content, group), signal)
    columns, planned = (_count(measurement, key) for key in ("ilength", "jlength"))
    check_pixels(columns, planned)
    pixels, frames = values.shape
    rows = pixels // columns
    if pixels % columns or not 0 < rows <= planned or frames < 1:
        raise ValueError(
            f"has {pixels} values x {frames} frames in its channel {quote(signal)} of {columns} x {planned} pixels; "
            "is it damaged?"
        )
    factor, offset, unit = _scale(attributes)
    direction: Direction = "retrace" if str(attributes.get("retrace")).lower() == "true" else "trace"
    in_m = measurement.get(_GRID + "unit.unit", "m") == "m"
    width, height = (positive(measurement.get(_GRID + key), 1e9) if in_m else None for key in ("ulength", "vlength"))
    angle = number(measurement.get(_GRID + "theta"))
    return Channel(
        at,
        f"{signal} {direction}",
        (rows, columns),
        partial(_load, values, (rows, columns), factor, offset),
        signal,
        direction,
        unit,
        width,
        None if height is None else height * rows / planned,  # a stopped scan; the grid is the whole scan's
        positive(measurement.get("timing-settings.scanRate")),
        "top" if str(measurement.get(_GRID + "reflect")).lower() == "true" else "bottom",
        frames,
        None if angle is None else degrees(angle) + 0.0,  # JPK writes -0.0
    )


def _values(content: bytes, members: dict[str, int], signal: str) -> Hdf5Array:
    """Return the array of a channel, which has its name; beside it stands a small picture."""
    for name, address in members.items():
        if name.lower() == signal.lower():
            values = hdf5_array(content, hdf5_object(content, address))
            if values is not None and len(values.shape) == 2:
                return values
    raise ValueError(f"has no array of pixels x frames in its channel {quote(signal)}")


def _count(measurement: _Attributes, key: str) -> int:
    value = measurement.get(_GRID + key)
    if not isinstance(value, int):
        raise ValueError(f"has no whole number as {_GRID}{key}")
    return value


def _scale(attributes: _Attributes) -> tuple[float, float, str]:
    """Return the size of a step, the offset, and the unit; steps of the converter where the file has no scale."""
    linear = all(attributes.get(_SCALING + key) == word for key, word in _LINEAR.items())
    factor, offset = (number(attributes.get(_SCALING + key)) for key in ("multiplier", "offset"))
    if not linear or not factor or offset is None:
        return 1.0, 0.0, "LSB"
    return factor, offset, str(attributes.get(_SCALING + "unit.unit", ""))


def _load(values: Hdf5Array, shape: tuple[int, int], factor: float, offset: float, frame: int) -> Matrix:
    return values.column(frame).astype(np.float64).reshape(shape) * factor + offset
