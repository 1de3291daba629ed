"""A model of somebody else, in one file: a piezo that is one play. Its waveform is found by learning on the play."""

import json
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from tablegen.base.input_errors import Unphysical
from tablegen.base.quantities import FileName
from tablegen.base.reading import RESPONSE, read_text
from tablegen.compensation.line import LineRequest, WholeLine
from tablegen.compensation.model import Hysteresis
from tablegen.compensation.model_problems import ModelProblems
from tablegen.waveform.series import FourierSeries
from tablegen.waveform.window_fit import fit_window

ROUNDS = 4


@dataclass(frozen=True)
class Learning:
    """What the next drive is fitted to: the last one, and what its displacement lacks; w, t and ``play`` as there."""

    turn: float
    play: float
    series: FourierSeries

    def value(self, t):
        line = np.where(t <= self.turn, t / self.turn, (1.0 - t) / (1.0 - self.turn))
        return self.series.value(t) + line - displacement(self.series, self.play, t <= self.turn, self.series.value(t))

    def slope(self, t):
        return np.where(t <= self.turn, 1.0 / self.turn, -1.0 / (1.0 - self.turn))


def displacement(series, play, rising, w):
    """One rise and one fall a period: the play follows a fixed distance behind, once it has been crossed."""
    grid = series.on_grid(32 * series.harmonics)
    return np.where(rising, np.maximum(w - play, np.min(grid) + play), np.minimum(w + play, np.max(grid) - play))


class PlayLine(WholeLine, frozen=True, kw_only=True):
    play: float = 0.0

    def followed(self, side, position, drive, value, slope):
        place = displacement(drive, self.play, side == "forward", value)
        return place - position, slope * (self.turn if side == "forward" else self.turn - 1.0)


class Play(Hysteresis, frozen=True, tag="play"):
    """One play of the half-width that a file names."""

    purpose: ClassVar[str] = "one play"
    operator: Annotated[FileName, Meta(description="JSON file with the half-width of the play, as share of the line")]

    def files(self):
        return (self.operator,)

    def line(self, request: LineRequest, problems: ModelProblems):
        with problems.at("operator"):
            try:
                play = float(json.loads(read_text(request.folder / self.operator, RESPONSE))["play"])
            except (OSError, ValueError, KeyError) as error:
                raise Unphysical(f"{self.operator} cannot be read: {error!r}") from None
            straight = FourierSeries(0.5, np.zeros(1), np.zeros(1))
            series = fit_window(Learning(request.turn, 0.0, straight), request.harmonics, request.window, request.both)
            for _ in range(ROUNDS):
                learning = Learning(request.turn, play, series)
                series = fit_window(learning, request.harmonics, request.window, request.both)
            return PlayLine.of(series, request.turn, play=play)
