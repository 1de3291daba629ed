"""Comma-separated values of one period: for spreadsheets, arbitrary waveform generators, and any script."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.waveforms import Waveform, waveforms


class Csv(Format):
    """The format csv: ``NAME_x.csv``, a line, and ``NAME_y.csv``, a frame."""

    name = "csv"
    purpose = "CSV of a line of x and a frame of y: time in s, volts at the piezo, code, markers as 0 and 1"
    file_names = "NAME_x.csv, NAME_y.csv"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render one file an axis."""
        return {f"{content.name}_{waveform.axis}.csv": _file(waveform) for waveform in waveforms(content)}


FORMAT = Csv()


def _file(waveform: Waveform) -> bytes:
    """Write a header, and a row a tick; floats as the shortest text that reads back as the same float."""
    columns = [
        map(repr, waveform.time_s.tolist()),
        map(repr, waveform.volts.tolist()),
        map(str, waveform.codes.tolist()),
    ]
    columns += [map(str, marker.astype(int).tolist()) for marker in waveform.markers.values()]
    lines = [",".join(("time_s", "volts", "code", *waveform.markers)), *map(",".join, zip(*columns, strict=True))]
    return "\n".join([*lines, ""]).encode("ascii")
