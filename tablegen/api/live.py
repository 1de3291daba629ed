"""A scan that is changed while a device plays it: each change is a whole plan, checked before anything is sent."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from msgspec import structs

from tablegen.api.build import Build, build_planned
from tablegen.api.live_preview import LivePreview, PreviewWords, is_accepted, preview_words, program_digest, words_of
from tablegen.api.live_tilt import Z_BEGINS, LiveZ, check_room, followed_offset_v, offset_key, split_table
from tablegen.api.turned import TurnedBuild, build_turned
from tablegen.base.input_errors import Problem, Rejected
from tablegen.certificate.certificate import EmittedPeriods
from tablegen.certificate.certified_scan import breaks_limit
from tablegen.compensation.operator.frame_transient import frame_drift_nm
from tablegen.config.image_keys import IMAGES, SIZES
from tablegen.config.load import Setup
from tablegen.config.variants import Variant, other_settings, variants
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram, ScanProgram
from tablegen.device.schedule import Schedule
from tablegen.device.sequencer import can_keep
from tablegen.link.device import Device
from tablegen.link.errors import LinkError, Refused, Unsuitable
from tablegen.link.messages import AxisWords, DeviceState, Feature, More
from tablegen.link.prepare import PreparedScan, check
from tablegen.planning.driven_frames import driven_frames
from tablegen.planning.line_plan import LinePlan, Plan, make_plan
from tablegen.planning.turned_plan import TurnedPlan
from tablegen.planning.turned_preview import TurnedPreview, turned_preview

AnyPlan = Plan | TurnedPlan
_AXES = "xy"
_START_WAIT_S = 5.0


@dataclass(frozen=True)
class LiveAxis:
    """Where an axis scans: position of the offset above that at 0 V, size of the whole line, voltages at the piezo.

    ``drift_nm`` is how far creep and hysteresis move the image in the frame after the change, by the operator of the
    axis; None without one, and where the scan before is not known.
    """

    position_nm: float
    size_nm: float
    window_nm: float
    offset_v: float
    amplitude_v: float
    drift_nm: float | None = None

    @classmethod
    def of_build(cls, build: Build | TurnedBuild) -> "tuple[LiveAxis, LiveAxis]":
        """Return the places of both axes; at an angle position and sizes are those of the scan at 0 degrees."""
        if isinstance(build, Build):
            x, y = (0.0 if line.drive.resting else line.drive.v_amplitude for line in build.plan.lines)
            return cls._of(build.plan.x, x), cls._of(build.plan.y, y)
        x, y = (
            abs(axis.converter.v_per_code) * (codes.most - codes.least)
            for axis, codes in zip(build.plan.axes, build.certificate.codes, strict=True)
        )
        return cls._of(build.plan.straight.x, x), cls._of(build.plan.straight.y, y)

    @classmethod
    def _of(cls, line: LinePlan, amplitude_v: float) -> "LiveAxis":
        drive = line.drive
        return cls(drive.position_nm, drive.size_nm, drive.window_nm, drive.v_offset, amplitude_v)


@dataclass(frozen=True)
class LiveScan:
    """The scan that a device plays, and how it came to play it.

    ``swap`` is the mode in which it took the place of the scan before: ``keep`` where the frame went on; None where
    the device played it already. ``generation`` counts the programs of the device. ``preview`` is what played first,
    None without one. ``z`` is the output on a tilted sample and ``aux`` the second one, None
    without them.
    """

    name: str
    digest: str
    generation: int
    swap: str | None
    line_rate_hz: float
    lines: int
    angle_deg: float
    x: LiveAxis
    y: LiveAxis
    preview: LivePreview | None = None
    z: LiveZ | None = None
    aux: LiveZ | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, and those of the axes, as plain data."""
        return asdict(self)


@dataclass(frozen=True)
class _Scan:
    """A scan with the values by key that make it of the file.

    Either ``build`` is there, or the ``periods`` of a plan that breaks no limit, which is to be certified.
    """

    settings: dict[str, Any]
    variant: Variant
    setup: Setup
    plan: AnyPlan
    build: Build | TurnedBuild | None
    periods: EmittedPeriods | None = None

    @property
    def straight(self) -> Plan:
        """The plan, of a scan at an angle that at 0 degrees."""
        return self.plan.straight if isinstance(self.plan, TurnedPlan) else self.plan

    @cached_property
    def z(self) -> LiveZ | None:
        """The place of the output z, None without one."""
        return None if self.plan.z is None else LiveZ.of_plan(self.plan.z, self.setup)

    @cached_property
    def aux(self) -> LiveZ | None:
        """The place of the output aux, None without one."""
        return None if self.plan.aux is None else LiveZ.of_plan(self.plan.aux, self.setup)

    @cached_property
    def prepared(self) -> PreparedScan:
        """The program that the device gets."""
        plan = self.plan
        return PreparedScan.of_turned(plan) if isinstance(plan, TurnedPlan) else PreparedScan.of_plan(plan)

    def certified(self) -> Build | TurnedBuild:
        """Certify the plan, unless that is done."""
        if self.build is not None:
            return self.build
        assert self.periods is not None
        return build_planned(self.setup, self.periods)


@dataclass(frozen=True)
class _Playing:
    """What the device plays by its last answer: the scan whose tables it has, their words, and the generation."""

    tables: _Scan
    words: tuple[AxisWords, AxisWords]
    generation: int

    @classmethod
    def of_upload(cls, scan: _Scan, generation: int) -> "_Playing":
        """Return the state after an upload."""
        program = scan.plan.program
        return cls(scan, (words_of(program.x), words_of(program.y)), generation)


class Live:
    """A scan on a device that is moved, zoomed and changed while it plays.

    Every change is planned and certified as a scan of its own, with all corrections for its place and size, and checked
    against the limits of scanner, scan file and device before anything is sent. What one of them refuses raises its
    error, and the scan that plays goes on. A change takes the time of a build without files, and of an upload.

    A change continues the frame if the device can (firmware with ``DAC_COMMIT_MODES``), and ticks and lines stay the
    same. Otherwise it waits for the next frame; a device without modes begins a frame at the next line.

    A scan may be at an angle, if both axes have an operator. Its plan takes seconds; until then a preview plays, if the
    frame can go on: the tables that the device has, with gains and offsets for the new place, size and angle.

    A device with ``DAC_MOVE`` plays a preview first where the schedule stays: the tables that it has, with the gain and
    the offset that come closest to the new plan. It plays when the plan is there and keeps all limits; the plan follows
    at once, certified.

    A scan may have the output z, on a device with ``DAC_LINK_Z``: z, and the second output aux, stay on their planes
    through all moves, so that each gives them another voltage in the centre of the scan. A move beyond their range is
    refused. Such a device has no ``DAC_MOVE``.
    """

    def __init__(
        self,
        device: Device,
        scan: str | Path,
        settings: Mapping[str, Any] | None = None,
        on_preview: Callable[[LivePreview], None] | None = None,
        on_stage: Callable[[str], object] = lambda _: None,
    ) -> None:
        """Read a scan file; nothing is sent before ``start`` or a change.

        Parameters
        ----------
        device
            Device at the end of a serial line.
        scan
            Scan file of one scan.
        settings
            Values by key of the scan file, such as ``{"x.size_nm": 500}``, in place of those of the file.
        on_preview
            Function that is called when a preview plays, before the upload of the plan.
        on_stage
            Function that is called with a text for each stage of a plan at an angle.

        Raises
        ------
        Rejected
            If the file cannot be read, has several scans, or the scan cannot be played or breaks one of its limits.
        """
        self._device, self._path, self._on_stage = device, Path(scan), on_stage
        self._limits = device.limits()
        scan_settings = split_table(settings or {})
        planned = self._planned(scan_settings, *self._variant(scan_settings))
        self._scan = replace(planned, build=planned.certified())
        self._sent: _Scan | None = None  # by an upload whose end is not known
        self._is_sent = False  # the device has taken ``_scan``
        self._on_preview = on_preview
        self._playing: _Playing | None = None
        self._previewed: _Playing | None = None  # what plays if the device has taken the last MOVE
        self._before_move: _Playing | None = None  # what played before a MOVE at an angle

    @property
    def plan(self) -> AnyPlan:
        """The plan of the last change that the device took, or of the scan file before the first."""
        return self._scan.plan

    @property
    def place(self) -> tuple[LinePlan, LinePlan]:
        """Both axes of that plan; of one at an angle, those of the scan at 0 degrees with its sizes and place."""
        return self._scan.straight.lines

    @property
    def z(self) -> LiveZ | None:
        """The output z of that plan: its voltage in the centre, its heights and the room about them; None without z."""
        return self._scan.z

    @property
    def aux(self) -> LiveZ | None:
        """The output aux of that plan, as ``z``; None without it."""
        return self._scan.aux

    @property
    def angle_deg(self) -> float:
        """The scan angle."""
        return self._scan.setup.scan.angle_deg

    @property
    def generation(self) -> int | None:
        """The generation of the program that plays by the last answer of the device; None before the first.

        That of its status is another one if a program plays that is not of this session, or the last answer was lost.
        """
        return None if self._playing is None else self._playing.generation

    def start(self) -> LiveScan:
        """Put the scan of the file into the device, and start it if the device is parked."""
        scan = self._send(self._scan)
        if self._device.status().state != DeviceState.PLAYING:
            self._device.arm()
            self._device.trigger()
            self._device.wait_for(DeviceState.PLAYING, _START_WAIT_S)
        return scan

    def move(self, x_nm: float = 0.0, y_nm: float = 0.0) -> LiveScan:
        """Move the scan by distances in nm from where it is, along the axes of the scanner."""
        self._settle()
        distances = {"x": x_nm, "y": y_nm}
        settings = {
            f"{line.axis}.offset_nm": line.drive.position_nm + distances[line.axis]
            for line in self.place
            if distances[line.axis] != 0.0
        }
        return self.set(settings)

    def zoom(self, factor: float) -> LiveScan:
        """Make the scan larger by a factor, or smaller by one below 1, about its middle."""
        self._settle()
        return self.set(_zoomed(self._scan.variant, factor))

    def rotate(self, by_deg: float) -> LiveScan:
        """Turn the scan by an angle, counterclockwise, about its middle.

        A scan at an angle needs an operator on both axes, and its plan takes seconds.
        """
        self._settle()
        return self.set({"angle_deg": (self.angle_deg + by_deg + 180.0) % 360.0 - 180.0})

    def set(self, settings: Mapping[str, Any]) -> LiveScan:
        """Play the scan with other values of keys of the scan file; those of earlier changes stay.

        Parameters
        ----------
        settings
            Values by key, such as ``{"timing.line_rate_hz": 2.0}``. Slopes of z turn the plane about the centre of the
            scan before. ``z.offset_v`` is the voltage in the new centre; without it the plane gives this voltage.
        """
        self._settle()
        settings, variant, setup = self._followed(split_table(settings))
        preview = self._preview_at_angle(setup)
        try:
            return self._send(self._planned(settings, variant, setup), preview)
        except BaseException as error:  # an interrupted plan too
            lost = isinstance(error, LinkError) and not isinstance(error, Refused | Unsuitable)
            if preview is not None and not lost:
                self._go_back()
            raise

    def _followed(self, settings: dict[str, Any]) -> tuple[dict[str, Any], Variant, Setup]:
        """Return all settings, the variant and the setup of a change, whose z and aux stay on the planes before it.

        Raises
        ------
        Rejected
            If a key is wrong, or the change is a move that leaves the range of an axis, of z or of aux.
        """
        every = other_settings(self._scan.settings, settings)
        variant, setup = self._variant(every)
        before, volts = self._scan.setup, {name: tilt.offset_v for name, tilt in setup.scan.tilts.items()}
        shifts = {
            tilt: offset_v
            for tilt in self._scan.plan.tilts
            if tilt.name in volts and offset_key(tilt.name) not in settings
            if (offset_v := followed_offset_v(before, setup, tilt.name)) != volts[tilt.name]
        }
        if not shifts:
            return every, variant, setup
        every = {**every, **{offset_key(tilt.name): offset_v for tilt, offset_v in shifts.items()}}
        variant, setup = self._variant(every)
        for tilt in shifts:
            check_room(tilt, before, setup, settings)
        return every, variant, setup

    def _variant(self, settings: dict[str, Any]) -> tuple[Variant, Setup]:
        _, scans = variants(self._path, {key: [value] for key, value in settings.items()})
        if len(scans) != 1:
            why = f"has {len(scans)} scans in [[scans]]; a device plays one of them: give the scan a file of its own"
            raise Rejected([Problem(str(self._path), 0, "scans", why)])
        return scans[0], scans[0].setup

    def _planned(self, settings: dict[str, Any], variant: Variant, setup: Setup) -> "_Scan":
        """Plan a scan, and measure what limits are compared with; a preview does not wait for the whole certificate.

        Raises
        ------
        BrokenLimit
            If the scan exceeds a limit.
        """
        if setup.mixes_motions:
            emit = structs.replace(setup.scan.emit, header_only=False)  # it is of files, and none is written here
            unwritten = structs.replace(setup, scan=structs.replace(setup.scan, emit=emit))
            turned = build_turned(unwritten, progress=self._on_stage)
            return _Scan(settings, variant, setup, turned.plan, turned)
        periods = EmittedPeriods(make_plan(setup, sines=True))
        if breaks_limit(setup, periods):
            return _Scan(settings, variant, setup, periods.plan, build_planned(setup, periods))  # raises, with remedies
        return _Scan(settings, variant, setup, periods.plan, None, periods)

    def _preview_at_angle(self, setup: Setup) -> LivePreview | None:
        """Play the tables of a scan at an angle with other gains and offsets, before the plan of a change is there.

        They go as a MOVE, or as a program where the device does not take that. None where neither it nor a limit takes
        them.
        """
        before, device = self.plan, self._device
        if not (self._is_sent and isinstance(before, TurnedPlan) and setup.mixes_motions):
            return None
        if Feature.COMMIT_MODES not in device.info.features:  # it would restart the frame
            return None
        preview = turned_preview(setup, before)
        if preview is None:
            return None
        generation = self._move_at_angle(preview, before)
        if generation is None:
            generation = self._upload_at_angle(preview, before)
        if generation is None:
            return None
        live_preview = LivePreview(generation, preview.x_error_percent, preview.y_error_percent)
        if self._on_preview is not None:
            self._on_preview(live_preview)
        return live_preview

    def _move_at_angle(self, preview: TurnedPreview, before: TurnedPlan) -> int | None:
        """Play a preview by a MOVE; return its generation, None where the device does not take it."""
        device, playing, self._before_move = self._device, self._playing, None
        if playing is None or More.SLOW_MOVE not in device.info.more or before.tilts:
            return None
        x, y = (move.program(axis.program) for move, axis in zip(preview.moves, before.axes, strict=True))
        if not is_accepted(ScanProgram(x, y, before.schedule), self._limits, before.program, device.info.shaping):
            return None
        words = tuple(AxisWords(move.gain_word, move.offset_word, move.factor_word) for move in preview.moves)
        try:
            generation = device.move(words[0], words[1], playing.generation).generation
        except Refused:
            return None
        self._before_move, self._playing = playing, replace(playing, words=(words[0], words[1]), generation=generation)
        return generation

    def _upload_at_angle(self, preview: TurnedPreview, before: TurnedPlan) -> int | None:
        """Play a preview by an upload; return its generation, None where the device does not take it."""
        device = self._device
        if not self._is_accepted(preview, before):
            return None
        digest = program_digest(preview.program, preview.program_of_z)
        scan = PreparedScan(before.name, digest, preview.program, None, None, preview.program_of_z)
        try:
            image = scan.image("table", device.info)
            check(scan, image, device.info, self._limits, swap=CommitMode.KEEP)
            result = device.upload(image, limits=self._limits, swap=CommitMode.KEEP)
        except (Refused, Unsuitable):
            return None
        return result.generation

    def _is_accepted(self, preview: TurnedPreview, before: TurnedPlan) -> bool:
        """Return True if the device accepts the programs of a preview behind those of a plan, by both sequencers."""
        info, of_z, z_before = self._device.info, preview.program_of_z, before.program_of_z
        if not is_accepted(preview.program, self._limits, before.program, info.shaping):
            return False
        if of_z is None or z_before is None:
            return True
        return is_accepted(of_z, (info.of_z.x_limits, info.of_z.y_limits), z_before, info.of_z.shaping)

    def _go_back(self) -> None:
        """Play the scan before a preview whose plan was refused; a lost link leaves the preview."""
        if self._before_move is not None:
            self._move_back(self._before_move)
            return
        with suppress(LinkError):
            image = self._scan.prepared.image("auto", self._device.info)
            result = self._device.upload(image, limits=self._limits, swap=CommitMode.KEEP)
            self._playing = _Playing.of_upload(self._scan, result.generation)

    def _settle(self) -> None:
        """Find out whether the device took the scan of an upload that ended without an answer."""
        if self._sent is None:
            return
        status, previewed = self._device.status(), self._previewed
        if status.hash.hex() == self._sent.prepared.digest:
            self._scan, self._is_sent = self._sent, True
            self._playing = _Playing.of_upload(self._sent, status.generation)
        elif previewed is not None and status.moved and status.generation == previewed.generation:
            self._scan, self._playing = self._sent, previewed
        self._sent = None

    def _send(self, scan: "_Scan", played: LivePreview | None = None) -> LiveScan:
        """Send a scan; ``played`` is the preview at an angle that plays."""
        device, plan, prepared = self._device, scan.plan, scan.prepared
        image = prepared.image("auto", device.info)
        swap = self._swap(plan)
        check(prepared, image, device.info, self._limits, swap=swap)
        self._check_z_begins(plan)
        before, playing = (self.plan if self._is_sent else None), self._playing
        preview = None
        try:
            preview = self._move(plan)
            built = scan.certified()
            result = device.upload(image, limits=self._limits, swap=swap)
        except (Refused, Unsuitable, Rejected):
            if preview is not None and playing is not None:
                self._move_back(playing)
            raise
        except LinkError:
            self._sent = scan
            raise
        self._scan, self._is_sent = scan, True
        self._playing = _Playing.of_upload(scan, result.generation)
        x, y = LiveAxis.of_build(built)
        if before is not None:
            goes_on = swap is CommitMode.KEEP and result.line is not None
            x, y = (
                replace(axis, drift_nm=by_nm)
                for axis, by_nm in zip(
                    (x, y), _drifts_nm(before, plan, (result.line or 0) + 1 if goes_on else 0), strict=True
                )
            )
        return LiveScan(
            name=prepared.name,
            digest=prepared.digest,
            generation=result.generation,
            swap=None if result.already_running else swap.name.lower(),
            line_rate_hz=float(plan.schedule.line_rate),
            lines=plan.schedule.lines,
            angle_deg=self.angle_deg,
            x=x,
            y=y,
            preview=preview or played,
            z=scan.z,
            aux=scan.aux,
        )

    def _check_z_begins(self, plan: AnyPlan) -> None:
        """Check that z does not begin or end to play while a scan plays, which a device refuses behind the upload.

        Raises
        ------
        Unsuitable
            If it does.
        """
        same = self._is_sent and (self.plan.z is None) == (plan.z is None)
        if same or self._device.info.z is None:
            return
        status = self._device.status()
        if status.state == DeviceState.PLAYING and status.z is not None and status.z.plays != (plan.z is not None):
            raise Unsuitable([Z_BEGINS])

    def _move(self, plan: AnyPlan) -> LivePreview | None:
        """Play the preview of a plan that is checked; None where there is none, or the device refuses it."""
        playing, self._previewed = self._playing, None
        words = None if playing is None else self._preview(playing, plan)
        if playing is None or words is None:
            return None
        self._previewed = replace(playing, words=(words.x, words.y), generation=playing.generation + 1)
        try:
            generation = self._device.move(words.x, words.y, playing.generation).generation
        except Refused:
            self._previewed = None
            return None
        self._playing = self._previewed
        preview = LivePreview(generation, words.x_error_percent, words.y_error_percent)
        if self._on_preview is not None:
            self._on_preview(preview)
        return preview

    def _move_back(self, before: _Playing) -> None:
        """Play the words before a preview whose plan was refused; a lost link leaves the preview."""
        assert self._playing is not None
        with suppress(LinkError):
            moved_back = self._device.move(*before.words, self._playing.generation)
            self._playing = replace(before, generation=moved_back.generation)

    def _preview(self, playing: _Playing, plan: AnyPlan) -> PreviewWords | None:
        """Return the words of a preview, if the device takes moves, and accepts them and the plan behind them."""
        info, limits = self._device.info, self._limits
        tables, program = playing.tables.plan.program, plan.program
        if More.MOVE not in info.more or not isinstance(tables, DualProgram) or not isinstance(program, DualProgram):
            return None
        now = PreviewWords(*playing.words, 0.0, 0.0).program(tables)
        words = preview_words(tables, program)
        if words is None or not is_accepted(program, limits, now, info.shaping):
            return None
        return words if is_accepted(words.program(tables), limits, now, info.shaping) else None

    def _swap(self, plan: AnyPlan) -> CommitMode:
        """Return the mode that restarts no frame, if the device has one."""
        if Feature.COMMIT_MODES not in self._device.info.features:
            return CommitMode.LINE
        keeps = self._is_sent and can_keep(self.plan.program, plan.program)
        return CommitMode.KEEP if keeps else CommitMode.FRAME


def _drifts_nm(before: AnyPlan, now: AnyPlan, first_line: int) -> tuple[float | None, float | None]:
    """Return the drift of both axes in the first frame after a change, which comes before ``first_line``."""
    if isinstance(before, Plan) and isinstance(now, Plan):
        x, y = (_drift_nm(last, new, now.schedule) for last, new in zip(before.lines, now.lines, strict=True))
        return x, y
    turned = now if isinstance(now, TurnedPlan) else before
    assert isinstance(turned, TurnedPlan)
    x_frames, y_frames = (
        [frame.from_line(first_line) for frame in pair]
        for pair in zip(driven_frames(before), driven_frames(now), strict=True)
    )
    return frame_drift_nm(turned.x.piezo, *x_frames), frame_drift_nm(turned.y.piezo, *y_frames)


def _drift_nm(before: LinePlan, now: LinePlan, schedule: Schedule) -> float | None:
    """Return the drift of an axis in the first frame after a change; None without an operator."""
    transient = now.drive.shape.identification.transient_from(before.drive.shape.identification)
    if transient is None:
        return None
    return transient.drift_nm(1.0 / float(schedule.line_rate), 0, schedule.lines)


def _zoomed(variant: Variant, factor: float) -> dict[str, Any]:
    """Return the sizes of a scan times a factor, under the keys that it has.

    Raises
    ------
    Rejected
        If the factor is not positive, or the file has no key of a size.
    """
    settings: dict[str, Any] = {}
    for image in IMAGES:
        size = variant.values.get(image)
        if size is not None:
            settings[image] = [factor * one for one in size] if isinstance(size, list) else factor * size
    for axis in _AXES:
        for key in SIZES:
            size = variant.values.get(axis, {}).get(key)
            if size is not None:
                settings[f"{axis}.{key}"] = factor * size
    if not settings or not factor > 0.0:
        why = "has no key of a size that could be zoomed" if factor > 0.0 else f"cannot be zoomed by {factor:g}"
        raise Rejected([Problem(variant.file.name, 0, "", why)])
    return settings
