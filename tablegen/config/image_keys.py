"""Solve the keys of an image for what a plan needs: sizes of the axes, line periods, turn of y and line rate."""

from collections.abc import Mapping
from fractions import Fraction
from math import floor
from typing import Any

from msgspec import Struct, structs

from tablegen.base.input_errors import Document, Problems
from tablegen.config.frame import RESTING_TURN, ImageFrame, exact, frame_of_image, frame_of_lines, lines_of_image
from tablegen.config.schema import DEFAULT_BITS, FastAxis, Scan, SlowAxis, Table, Timing, WrittenScan

SIZES = ("size_nm", "size_um", "size_v")
OFFSETS = ("offset_v", "offset_nm", "offset_um")
IMAGES = ("image_nm", "image_um")
RATES = ("line_rate_hz", "frame_rate_hz", "speed_um_per_s", "speed_mm_per_s")
_WIDTH = Fraction(4, 5)  # of the default window of x
_FREEDOM = Fraction(1, 20)  # by which the window of x may be wider or narrower, so that pixels are whole ticks
_HARMONICS = 64  # of y, with the margins of a chosen window


class SolvedScan(Struct, frozen=True):
    """A scan as it is planned, the written keys of its values, and the choices of the solution, in sentences.

    ``written_keys`` maps a key of ``scan`` to the key that was written in its place, and the factor to its value.
    """

    scan: Scan
    written_keys: Mapping[str, tuple[str, float]]
    choices: tuple[str, ...]


def check_image_keys(values: Mapping[str, Any], file: Document, problems: Problems) -> None:
    """Report keys of different tables that set the same quantity, or contradict each other.

    ``values`` are those of the scan file as written.
    """
    _Contradictions(values, file, problems).check()


class _Contradictions:
    """The keys of the scan file ``values`` that set the same quantity twice."""

    def __init__(self, values: Mapping[str, Any], file: Document, problems: Problems) -> None:
        self._values, self._file, self._problems = values, file, problems
        self._timing, self._y = self._table("timing"), self._table("y")
        self._off = self._y.get("motion") == "off"
        self._own = [key for key in self._y if f"y.{key}" not in file.inherited]
        self._image = next((key for key in IMAGES if key in values), None)

    def check(self) -> None:
        """Report all of them."""
        if self._off:
            self._check_rest()
        if self._image is not None:
            self._check_sizes(self._image)
        if self._timing.get("frame") is not None:
            self._check_frame()
        self._check_rates()

    def _table(self, name: str) -> Mapping[str, Any]:
        table = self._values.get(name)
        return table if isinstance(table, dict) else {}

    def _refuse(self, key: str, other: str, why: str) -> None:
        line = self._file.line_of(other) if self._file.lines is not None else 0
        at = f" on line {line}" if line else ""
        self._problems.add(self._file, key, f"{other}{at} {why}")

    def _check_rest(self) -> None:
        """Refuse keys that an axis at rest does not have."""
        for key in ("turn", "band_limit", "table", "refinement", *SIZES, "size_of"):
            if key in self._own:
                self._refuse(f"y.{key}", "y.motion", "keeps y where it is; leave this out, or motion = 'off'")
        if "frame" in self._timing:
            self._refuse("timing.frame", "y.motion", "keeps y where it is; leave out one of the two")
        if self._image is not None and isinstance(self._values[self._image], list):
            self._refuse(self._image, "y.motion", "keeps y where it is; give one number, the length of the line scan")

    def _check_sizes(self, image: str) -> None:
        """Refuse sizes of axes beside that of the image; those of an axis at rest are reported already."""
        for axis in ("x",) if self._off else ("x", "y"):
            for key in (*SIZES, "size_of"):
                if key in self._table(axis) and f"{axis}.{key}" not in self._file.inherited:
                    why = "sets the size of both axes already, as that of the imaging windows"
                    self._refuse(f"{axis}.{key}", image, f"{why}; leave out one of the two")

    def _check_frame(self) -> None:
        """Refuse keys that the kind of frame sets."""
        if "turn" in self._own:
            self._refuse("y.turn", "timing.frame", "sets where y turns; leave out one of the two")
        limit = self._y.get("band_limit")
        if isinstance(limit, dict) and "directions" in limit:
            key = "y.band_limit.directions"
            if key not in self._file.inherited:
                self._refuse(key, "timing.frame", "sets the directions of y; leave out one of the two")

    def _check_rates(self) -> None:
        """Refuse a speed without a length, and a line whose length is given twice."""
        timing = self._timing
        speed = next((key for key in RATES[2:] if key in timing), None)
        if speed is not None and "size_v" in self._table("x"):
            why = "gives no length, which a speed needs; give a size in nm, or a line rate"
            self._refuse(f"timing.{speed}", "x.size_v", why)
        ticks = next((key for key in ("ticks_per_line", "ticks_per_pixel") if key in timing), None)
        rate = next((key for key in RATES[1:] if key in timing), None)
        if ticks is not None and rate is not None:
            why = "sets the length of the line already; leave out one of the two"
            self._refuse(f"timing.{rate}", f"timing.{ticks}", why)


def solve_scan(
    written: WrittenScan, update_rate_hz: float, values: Mapping[str, Any], file: Document, problems: Problems
) -> SolvedScan | None:
    """Solve a written scan at an update rate in Hz; ``values`` are the tables as they were written.

    Returns None where ``problems`` grew.
    """
    return _ScanSolver(written, update_rate_hz, values, file, problems).solve()


class _ScanSolver:
    def __init__(
        self, written: WrittenScan, update_rate_hz: float, values: Mapping[str, Any], file: Document, problems: Problems
    ) -> None:
        self._written, self._update_rate_hz = written, update_rate_hz
        self._values, self._file, self._problems = values, file, problems
        self._written_as: dict[str, tuple[str, float]] = {}
        self._choices: list[str] = []

    def solve(self) -> SolvedScan | None:
        before = len(self._problems.entries)
        written = self._written
        x, y = self._sized("x", written.x), self._sized("y", written.y)
        frame = self._frame(y)
        if frame is None:
            return None
        y = self._framed(y, frame)
        line_rate = self._line_rate(x, frame)
        if len(self._problems.entries) > before:
            return None
        x = self._whole_pixels(x, line_rate)
        if self._image is not None:
            sizes = [(axis.size_nm, _width(axis)) for axis in (x, y) if axis.size_nm is not None]
            self._choices.append(
                f"the imaging windows span {_sizes([size for size, _ in sizes])}: the lines are "
                f"{_sizes([size / width for size, width in sizes])} long with their turnarounds"
            )
        timing = Timing(
            **{
                **structs.asdict(written.timing),
                "lines": frame.lines,
                "line_rate_hz": line_rate,
                **dict.fromkeys(("image_lines", "frame", *RATES[1:])),
            }
        )
        rest = {**_fields(written), "image_nm": None, "image_um": None, "timing": timing, "x": x, "y": y}
        return SolvedScan(Scan(**rest), self._written_as, tuple(self._choices))

    @property
    def _image(self) -> str | None:
        return next((key for key in IMAGES if getattr(self._written, key) is not None), None)

    def _sized(self, axis: str, scan: Any) -> Any:
        """Return an axis with size and offset in nm, whatever their unit was, and the defaults of its table."""
        changes: dict[str, Any] = {"size_um": None, "offset_um": None, "table": _table(scan.table)}
        image = self._image
        if image is not None and not (axis == "y" and self._written.y.off):
            image_size = getattr(self._written, image)
            size = image_size[0 if axis == "x" else 1] if isinstance(image_size, list) else image_size
            changes |= {"size_nm": size if image == "image_nm" else _nm(size), "size_of": "window"}
            self._written_as[f"{axis}.size_nm"] = (image, 1.0 if image == "image_nm" else 1e-3)
        for key in ("size", "offset"):
            um = getattr(scan, f"{key}_um")
            if um is not None:
                changes[f"{key}_nm"] = _nm(um)
                self._written_as[f"{axis}.{key}_nm"] = (f"{axis}.{key}_um", 1e-3)
        return structs.replace(scan, **changes)

    def _frame(self, y: SlowAxis) -> ImageFrame | None:
        """Return line periods, turn and window of y; None after a problem."""
        timing = self._written.timing
        if y.off:
            lines = timing.lines or timing.image_lines or 1
            self._choices.append(f"a line scan: y rests, and all {lines} lines of a frame are imaged")
            return ImageFrame(lines, RESTING_TURN, (0.0, 1.0), False)
        limit, mode = y.band_limit, timing.frame
        window = limit.window if "window" in self._written_keys("band_limit") else None
        both = limit.directions == "both"
        plain = "turn" not in self._written_keys() and "directions" not in self._written_keys("band_limit")
        frame = None
        if timing.image_lines is None:
            assert timing.lines is not None
            if mode is None:
                return ImageFrame(timing.lines, y.turn, limit.window, both)
            with self._problems.at(self._file, "timing.lines"):
                frame = frame_of_lines(mode, timing.lines, window)
        else:
            self._written_as["timing.lines"] = ("timing.image_lines", 1.0)
            with self._problems.at(self._file, "timing.image_lines"):
                if mode is None and not plain:
                    frame = lines_of_image(timing.image_lines, y.turn, limit.window, both)
                else:
                    frame = frame_of_image(mode or "up-down", timing.image_lines, window)
        if frame is not None:
            if mode is not None:
                self._written_as |= dict.fromkeys(("y.turn", "y.band_limit.directions"), ("timing.frame", 1.0))
            self._choices.append(_frame_text(frame))
        return frame

    def _framed(self, y: SlowAxis, frame: ImageFrame) -> SlowAxis:
        """Return y with the turn and the window of its frame; short turnarounds take more harmonics."""
        limit = y.band_limit
        if y.off:
            limit = structs.replace(limit, harmonics=1)
        own_window = "window" not in self._written_keys("band_limit") and frame.window != limit.window
        short = own_window and limit.harmonics is None and limit.cutoff_hz is None
        if short and limit.method == "window":
            count = _carried(y, frame.lines)
            limit = structs.replace(limit, harmonics=count)
            self._choices.append(f"y has {count} harmonics of the frame rate, for its short turnarounds")
        limit = structs.replace(limit, window=frame.window, directions="both" if frame.both else "forward")
        return structs.replace(y, turn=frame.turn, band_limit=limit)

    def _line_rate(self, x: FastAxis, frame: ImageFrame) -> float:
        """Return the lines a second, from the rate or speed that was given."""
        timing = self._written.timing
        if timing.line_rate_hz is not None:
            return timing.line_rate_hz
        if timing.frame_rate_hz is not None:
            self._written_as["timing.line_rate_hz"] = ("timing.frame_rate_hz", 1.0 / frame.lines)
            rate = float(exact(timing.frame_rate_hz) * frame.lines)
            text = f"{timing.frame_rate_hz:g} Hz frames of {frame.lines} line periods"
            self._choices.append(f"{text}: {rate:.6g} Hz lines")
            return rate
        key = next(key for key in RATES[2:] if getattr(timing, key) is not None)
        assert x.size_nm is not None
        speed: float = getattr(timing, key)
        nm_per_s = speed * (1e3 if key == "speed_um_per_s" else 1e6)
        line_nm = x.size_nm / _width(x) if x.size_of == "window" else x.size_nm
        rate = nm_per_s * x.turn / line_nm
        self._written_as["timing.line_rate_hz"] = (f"timing.{key}", speed / rate)
        unit = "um/s" if key == "speed_um_per_s" else "mm/s"
        self._choices.append(f"{speed:g} {unit} along lines of {line_nm:.6g} nm: {rate:.6g} Hz lines")
        return rate

    def _whole_pixels(self, x: FastAxis, line_rate: float) -> FastAxis:
        """Return x with a window, near the default one, in which a pixel is a whole number of ticks; or unchanged.

        Only where the size is that of the image, which the window spans whatever it is.
        """
        timing, free = self._written.timing, "window" not in self._written_keys("band_limit", axis="x")
        ticks_written = timing.ticks_per_line or timing.ticks_per_pixel
        speed = timing.speed_um_per_s or timing.speed_mm_per_s
        if self._image is None or not free or ticks_written or speed or not 0.0 < line_rate < 1e9:
            return x
        ticks = floor(exact(self._update_rate_hz) / exact(line_rate) + Fraction(1, 2))
        way = exact(x.turn) * ticks
        of_pixel = round(_WIDTH * way / timing.pixels)
        width = of_pixel * timing.pixels / way if way else Fraction(0)
        if of_pixel < 1 or abs(width - _WIDTH) > _FREEDOM:
            return x
        low = round(float((1 - width) / 2), 12)
        window = (low, round(1.0 - low, 12))
        if window != x.band_limit.window:
            self._choices.append(f"the window of x is {low:.6g}..{window[1]:.6g}, where a pixel is {of_pixel} ticks")
        return structs.replace(x, band_limit=structs.replace(x.band_limit, window=window))

    def _written_keys(self, *path: str, axis: str = "y") -> set[str]:
        """Return the keys that were written in a table of an axis."""
        table: Any = self._values.get(axis, {})
        for name in path:
            table = table.get(name, {})
        return set(table)


def _frame_text(frame: ImageFrame) -> str:
    up, down = frame.up, frame.down
    image = f"{up[1]} image lines" + (f" up and {down[1]} down" if frame.both else "")
    low, high = frame.window
    return (
        f"{image} take {frame.lines} line periods a frame: y turns at {frame.turn:.6g} of it, and images "
        f"{low:.6g}..{high:.6g} of its way"
    )


def _carried(y: SlowAxis, lines: int) -> int:
    """Return as many harmonics as short turnarounds need, if steps and table carry them."""
    carried = [_HARMONICS]
    if y.motion == "step":
        carried.append((lines - 1) // 2)
    if y.table.mode != "direct" and y.table.length is not None:
        carried.append(y.table.length // 2 - 1)
    return max(min(carried), 1)


def _table(table: Table) -> Table:
    """Return a table with its defaults, except one that the build chooses."""
    if table.chosen_by_build:
        return structs.replace(table, mode=table.mode or "auto")
    return structs.replace(table, mode=table.mode or "interpolated", bits=table.bits or DEFAULT_BITS)


def _width(axis: FastAxis) -> float:
    low, high = axis.band_limit.window
    return high - low


def _nm(um: float) -> float:
    """Return the exact nm of a decimal value in micrometres."""
    return float(exact(um) * 1000)


def _sizes(nm: list[float]) -> str:
    return f"{' x '.join(f'{one:.6g}' for one in nm)} nm"


def _fields(struct: Any) -> dict[str, Any]:
    return {name: getattr(struct, name) for name in struct.__struct_fields__}
