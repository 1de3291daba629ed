"""The interface of a hysteresis model: the table of the scanner file, and the line that the model makes of it.

Each is one file in ``tablegen/compensation/models/``, or an entry point. Everything else (the decoder, the JSON
Schema, the page of keys, the build, the certificate, ``tablegen show`` and ``simulate``) treats all alike.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from msgspec import Struct

from tablegen.base.reading import file_sha256
from tablegen.compensation.line import LineRequest, LineShape
from tablegen.compensation.model_problems import ModelProblems

if TYPE_CHECKING:
    from tablegen.compensation.dynamics import Response
    from tablegen.compensation.operator.creep import LogarithmicCreep
    from tablegen.compensation.operator.loop import Loop


class Parameters(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the scanner file that checks itself, beyond the types and ranges of its keys."""

    @classmethod
    def contradictions(cls, written: Mapping[str, Any]) -> list[tuple[str, str]]:
        """Return the keys of the written table that contradict each other or are missing, each with the reason."""
        return []

    def faults(self) -> list[tuple[str, str]]:
        """Return the keys whose values contradict each other, each with the reason."""
        return []


class Hysteresis(Parameters, frozen=True, tag_field="model"):
    """Hysteresis of the line, (13)-(22)."""

    purpose: ClassVar[str] = ""
    """The model in a few words or equations, for the list of models."""
    calibration: ClassVar[str] = ""
    """The commands that measure its parameters, in Markdown."""
    order: ClassVar[int] = 9
    """Its place among models that are compared: the simplest is 0."""
    compensates: ClassVar[bool] = True
    """True if the model corrects anything."""
    counts_turns: ClassVar[bool] = False
    """True if its line depends on the real turns of the waveform, not on those of a triangle."""
    identified: ClassVar[bool] = False
    """True if it was identified on traces: ``LineShape.identification`` of its lines has a piezo to simulate."""

    @classmethod
    def model(cls) -> str:
        """Return the name of the model: the tag of the class."""
        return str(cls.__struct_config__.tag)

    @classmethod
    def like(cls, other: "Hysteresis") -> "Self | None":
        """Return this model with the table of another one; None where that does not serve."""
        return other if isinstance(other, cls) else None

    @property
    def calibrated(self) -> bool:
        """True if the table holds a calibration."""
        return True

    def files(self) -> tuple[str, ...]:
        """Return the files that the table names, relative to the scanner file: builds depend on them."""
        return ()

    @property
    def operator_file(self) -> str | None:
        """The operator file among ``files``, for `tablegen compare`."""
        return None

    def line(self, request: LineRequest, problems: ModelProblems) -> LineShape | None:
        """Return the line of one axis; None where it cannot be served, with the reason in ``problems``.

        Raises
        ------
        NotImplementedError
            If a model that compensates does not define it.
        """
        raise NotImplementedError(type(self))

    def loop(
        self, request: LineRequest, low: float, high: float, problems: ModelProblems
    ) -> "tuple[Loop, LogarithmicCreep, Response | None] | None":
        """Return the loop of a settled drive between two shares of v_max, its creep, and the dynamics behind both.

        The mean of the drive is the offset. The loop is ``request.size_nm`` long. None where ``problems`` grew. By
        default it is that of the line's sweeps, without creep.
        """
        from tablegen.compensation.operator.creep import NO_CREEP  # here: a build of a law asks for none
        from tablegen.compensation.operator.loop import POINTS, Loop

        line = self.line(request, problems)
        if line is None:
            return None
        u = np.arange(POINTS) / (POINTS - 1)
        rising, falling = line.forward.inverse(u), 1.0 - line.backward.inverse(1.0 - u)
        return Loop(low, high, rising, falling, request.size_nm), NO_CREEP, request.response

    def described(self, line: LineShape) -> str:
        """Return the applied hysteresis in a line of text."""
        sides = zip(("forward", "backward"), line.peaks, strict=True)
        return f"{self.model()}; " + ", ".join(f"{side} beta {b.beta:.5f} u_peak {b.u_peak:.4g}" for side, b in sides)

    def contents(self, folder: Path) -> list[str]:
        """Return the digests of those files: a refinement belongs to one model with one content."""
        return [file_sha256(folder / name) for name in self.files()]
