"""Types of quantities in the input files, with their ranges. Units are part of the names of keys."""

from typing import Annotated

from msgspec import Meta

Name = Annotated[str, Meta(min_length=1, max_length=64)]
MAXIMUM_FILE_NAME = 1024
FileName = Annotated[str, Meta(min_length=1, max_length=MAXIMUM_FILE_NAME)]
Volts = Annotated[float, Meta(ge=-1e5, le=1e5)]
PositiveVolts = Annotated[float, Meta(ge=1e-3, le=1e5)]
Nanometres = Annotated[float, Meta(ge=1e-6, le=1e9)]
Micrometres = Annotated[float, Meta(ge=1e-9, le=1e6)]
Hertz = Annotated[float, Meta(ge=1e-6, le=1e10)]
Normalised = Annotated[float, Meta(gt=0.0, lt=1.0)]
