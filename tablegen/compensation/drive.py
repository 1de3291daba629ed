"""What is applied to one axis, factor by factor: V(t) = V_offset + m g V_scan (w(t) - 1/2)."""

from dataclasses import dataclass
from pathlib import Path

from tablegen.compensation.dynamics import Response, SecondOrder
from tablegen.compensation.frequency import frequency_gain
from tablegen.compensation.hysteresis import HIGHEST_PEAK, LOWEST_PEAK, BranchShape, LineShape
from tablegen.compensation.offset import OffsetLaw, normalised_offset
from tablegen.compensation.residual import ResidualLaw
from tablegen.compensation.response_file import read_response
from tablegen.compensation.size import SizeLaw
from tablegen.config.figures import at_least, at_most
from tablegen.config.load import Setup
from tablegen.config.schema import Branch, FastAxis, Hysteresis, Offset, Resonance, ScannerAxis
from tablegen.problems import Problems, Unphysical

# A calibration serves turning points this far beyond the calibrated ones: the paper sees no major difference
# between 0.5 and 0.7 except at large sizes, and 10 % to 25 % between 0.7 and 0.9.
TURN_REACH = 0.1
FULL_SCALE_TOLERANCE = 0.02  # relative difference allowed between a measured full scale and v_max


@dataclass(frozen=True, slots=True)
class AppliedBranch:
    """Hysteresis of one branch at this scan size; ``u_peak`` in sweep-aligned coordinates."""

    beta: float
    u_peak: float


@dataclass(frozen=True)
class Drive:
    """The voltages at the piezo, and every factor that went into them.

    ``v_scan`` is from (9)/(12), before ``m`` of (1) and ``g`` of (23). The amplitude played is m g v_scan, peak to
    peak, for w from 0 to 1. ``position_nm`` is that of the offset, above the one at 0 V.
    """

    v_max: float
    v_offset: float
    position_nm: float
    size_nm: float
    window_nm: float
    v_scan: float
    v_scan_normalised: float
    p_offset: float
    m: float
    g: float
    model: str
    turn: float
    forward: AppliedBranch
    backward: AppliedBranch
    offset_law: OffsetLaw
    size_law: SizeLaw
    shape: LineShape
    response: Response | None
    max_boost_db: float

    @property
    def v_amplitude(self) -> float:
        """m g V_scan: volts peak to peak at the piezo for w from 0 to 1."""
        return self.m * self.g * self.v_scan

    def v_amplitude_at(self, v_offset: float) -> float:
        """What ``v_amplitude`` would be at another offset voltage."""
        return self.offset_law.factor(normalised_offset(v_offset, self.v_max)) * self.g * self.v_scan


def compensate(setup: Setup, axis: str, rate_hz: float, problems: Problems) -> Drive | None:
    """Apply the scanner's calibration to one axis ("x" or "y") at its rate; None where ``problems`` grew."""
    scan: FastAxis = getattr(setup.scan, axis)
    scanner: ScannerAxis = getattr(setup.scanner, axis)
    v_max = setup.scanner.v_max
    scan_file, scanner_file = setup.scan_file, setup.scanner_file
    before = len(problems.found)

    offset_law = OffsetLaw()
    if scanner.offset is not None:
        _check_points(setup, axis, problems)
        with problems.at(scanner_file, f"{axis}.offset{'.points' if scanner.offset.points is not None else ''}"):
            offset_law = _offset_law(scanner.offset, v_max)
    size_law = None
    with problems.at(scanner_file, f"{axis}.size.base_nm"):
        s = scanner.size
        size_law = SizeLaw.calibrated(s.k_nm_per_v, v_max, s.beta, s.base_nm, s.v_threshold)

    v_offset = 0.5 * v_max
    if scan.offset_v is not None:
        v_offset = scan.offset_v
        with problems.at(scan_file, f"{axis}.offset_v"):
            if not 0.0 <= v_offset <= v_max:
                raise Unphysical(outside_driver(v_offset, v_max))
    elif scan.offset_nm is not None:
        with problems.at(scan_file, f"{axis}.offset_nm"):
            v_offset = offset_law.voltage_at(scan.offset_nm, v_max, scanner.size.k_nm_per_v)

    low, high = scan.band_limit.window
    v, size_nm = 0.0, 0.0
    if size_law is not None and scan.size_nm is not None:
        with problems.at(scan_file, f"{axis}.size_nm"):
            size_nm = scan.size_nm / (high - low) if scan.size_of == "window" else scan.size_nm
            try:
                v = size_law.voltage(size_nm)
            except Unphysical as reason:
                if scan.size_of == "line":
                    raise
                window_nm = at_most(size_law.size_nm(1.0) * (high - low), 6)
                raise Unphysical(f"its line of {reason}, a window of {window_nm} nm") from None
    elif size_law is not None and scan.size_v is not None:
        with problems.at(scan_file, f"{axis}.size_v"):
            if scan.size_v > v_max:
                raise Unphysical(f"{scan.size_v:g} V is above v_max = {v_max:g} V")
            v = scan.size_v / v_max
            size_nm = size_law.size_nm(v)

    g = 1.0
    if scanner.frequency is not None:
        with problems.at(scanner_file, f"{axis}.frequency.alpha"):
            g = frequency_gain(rate_hz, scanner.frequency.alpha, scanner.frequency.reference_hz)

    branches = _branches(setup, axis, v, problems)
    response = None
    if scanner.resonance is not None:
        key = f"{axis}.resonance.response" if scanner.resonance.response is not None else f"{axis}.resonance"
        with problems.at(scanner_file, key):
            response = _response(scanner.resonance, setup.scanner_folder)
    if len(problems.found) > before or branches is None or size_law is None:
        return None
    applied, shape = branches
    p = normalised_offset(v_offset, v_max)
    return Drive(
        v_max=v_max,
        v_offset=v_offset,
        position_nm=offset_law.position_nm(v_offset, v_max, scanner.size.k_nm_per_v),
        size_nm=size_nm,
        window_nm=size_nm * (high - low),
        v_scan=v * v_max,
        v_scan_normalised=v,
        p_offset=p,
        m=offset_law.factor(p),
        g=g,
        model=scanner.hysteresis.model if scanner.hysteresis is not None else "triangle",
        turn=scan.turn,
        forward=applied[0],
        backward=applied[1],
        offset_law=offset_law,
        size_law=size_law,
        shape=shape,
        response=response,
        max_boost_db=scanner.resonance.max_boost_db if scanner.resonance is not None else 0.0,
    )


def outside_driver(volts: float, v_max: float) -> str:
    """Say that a voltage is outside the driver's range, and by how much."""
    by = max(-volts, volts - v_max)
    return f"{volts:.6g} V is outside the driver's 0..{v_max:g} V, by {by:.4g} V"


def _check_points(setup: Setup, axis: str, problems: Problems) -> None:
    """No point can have been measured where the driver does not reach."""
    v_max = setup.scanner.v_max
    offset: Offset = getattr(setup.scanner, axis).offset
    for i, point in enumerate(offset.points or []):
        if not 0.0 <= point.offset_v <= v_max:
            key = f"{axis}.offset.points[{i}].offset_v"
            problems.add(setup.scanner_file, key, outside_driver(point.offset_v, v_max))


def _check_amplitudes(setup: Setup, axis: str, hysteresis: Hysteresis, problems: Problems) -> None:
    """No hysteresis can have been measured at more than the driver's range, but for the error of a voltage."""
    v_max = setup.scanner.v_max
    for i, entry in enumerate(hysteresis.branches):
        for side, branch in (("forward", entry.forward), ("backward", entry.backward)):
            for j, point in enumerate(branch.points or []):
                if point.size_v > (1.0 + FULL_SCALE_TOLERANCE) * v_max:
                    key = f"{axis}.hysteresis.branches[{i}].{side}.points[{j}].size_v"
                    problems.add(setup.scanner_file, key, f"{point.size_v:g} V is above v_max = {v_max:g} V")


def _offset_law(offset: Offset, v_max: float) -> OffsetLaw:
    if offset.points is not None:
        p = [normalised_offset(point.offset_v, v_max) for point in offset.points]
        return OffsetLaw.fit(p, [point.apparent_nm for point in offset.points])
    if offset.m_minus is not None and offset.m_plus is not None:
        return OffsetLaw.from_ends(offset.m_minus, offset.m_plus)
    return OffsetLaw(offset.alpha or 0.0, offset.beta or 0.0)


def _branches(
    setup: Setup, axis: str, v: float, problems: Problems
) -> tuple[tuple[AppliedBranch, AppliedBranch], LineShape] | None:
    """The shape of both branches at this turn and scan size."""
    turn: float = getattr(setup.scan, axis).turn
    hysteresis: Hysteresis | None = getattr(setup.scanner, axis).hysteresis
    straight = AppliedBranch(0.0, 0.5), BranchShape()
    if hysteresis is None or hysteresis.model == "triangle":
        return (straight[0], straight[0]), LineShape(turn, straight[1], straight[1])

    _check_amplitudes(setup, axis, hysteresis, problems)
    entries = sorted(enumerate(hysteresis.branches), key=lambda entry: entry[1].turn)
    turns = [entry.turn for _, entry in entries]
    if not turns[0] - TURN_REACH - 1e-9 <= turn <= turns[-1] + TURN_REACH + 1e-9:
        nearest = min(turns, key=lambda t: abs(t - turn))
        low = at_least(max(turns[0] - TURN_REACH - 1e-10, 0.0), 6)
        high = at_most(min(turns[-1] + TURN_REACH + 1e-10, 1.0), 6)
        problems.add(
            setup.scan_file,
            f"{axis}.turn",
            f"{turn:.9g} is {abs(turn - nearest):.9g} from the nearest calibrated branch (turn = {nearest:g}); "
            f"{low} to {high} can be served, "
            f"or calibrate one in {setup.scanner_file.name}",
        )
        return None
    right = next((i for i, t in enumerate(turns) if t >= turn), len(turns) - 1)
    left = right if turns[right] <= turn or right == 0 else right - 1
    share = 0.0 if left == right else (turn - turns[left]) / (turns[right] - turns[left])

    applied, shapes = [], []
    for side in ("forward", "backward"):
        one: Branch = getattr(entries[left][1], side)
        other: Branch = getattr(entries[right][1], side)
        key = f"{axis}.hysteresis.branches[{entries[left if share < 0.5 else right][0]}].{side}"
        found = None
        with problems.at(setup.scanner_file, f"{key}.points"):
            found = _residual(one, other, share, v, setup.scanner.v_max)
        if found is None:
            continue
        beta, u_peak, beta_max = found
        peak = u_peak if hysteresis.model == "harmonic" else None
        # Outside the poles of (20) it is the peak that is wrong, elsewhere the residual.
        beyond = peak is not None and not LOWEST_PEAK < peak - beta < HIGHEST_PEAK
        name = "points" if beta_max is None else "u_peak" if beyond else "beta_max"
        with problems.at(setup.scanner_file, f"{key}.{name}"):
            shapes.append(_shape(beta, beta_max, peak))
            applied.append(AppliedBranch(beta, 0.5 + beta if peak is None else peak))  # (16)
    if len(shapes) < 2:
        return None
    return (applied[0], applied[1]), LineShape(turn, shapes[0], shapes[1])


def _residual(one: Branch, other: Branch, share: float, v: float, v_max: float) -> tuple[float, float, float | None]:
    """beta and u_peak between two turns, and the beta_max that they come from where (22) gives both."""
    left, right = ResidualLaw.of(one, v_max), ResidualLaw.of(other, v_max)
    if not left.points and not right.points:
        beta_max, rho = _between(left.beta_max, right.beta_max, share), _between(left.rho, right.rho, share)
        law = ResidualLaw(beta_max, rho, _between(left.u_peak, right.u_peak, share))
        return *law.at(v, v_max), beta_max
    (beta_left, peak_left), (beta_right, peak_right) = left.at(v, v_max), right.at(v, v_max)
    return _between(beta_left, beta_right, share), _between(peak_left, peak_right, share), None


def _shape(beta: float, beta_max: float | None, u_peak: float | None) -> BranchShape:
    """A branch of the harmonic model, or of the sinusoidal one where there is no u_peak."""

    def build(share: float) -> BranchShape:
        return BranchShape.sinusoidal(share * beta) if u_peak is None else BranchShape.harmonic(share * beta, u_peak)

    try:
        return build(1.0)
    except Unphysical as reason:
        text, found = str(reason).partition("; lower it")[:2]
        fits, fails = 0.0, 1.0
        for _ in range(40 if found else 0):
            middle = 0.5 * (fits + fails)
            try:
                build(middle)
                fits = middle
            except Unphysical:
                fails = middle
        if not fits:
            raise
        what, value = ("beta", beta) if beta_max is None else ("beta_max", beta_max)
        raise Unphysical(f"{text}; a {what} up to {at_most(fits * value)} fits, or a smaller scan") from None


def _between(left: float, right: float, share: float) -> float:
    return left + share * (right - left)


def _response(resonance: Resonance, folder: Path) -> Response:
    if resonance.response is None:
        assert resonance.frequency_hz is not None
        assert resonance.quality is not None
        return SecondOrder(resonance.frequency_hz, resonance.quality, resonance.delay_s)
    return read_response(folder / resonance.response)
