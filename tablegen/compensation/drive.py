"""What is applied to one axis, factor by factor: V(t) = V_offset + m g V_scan (w(t) - 1/2)."""

from dataclasses import dataclass
from pathlib import Path

from tablegen.compensation.dynamics import Response, SecondOrder
from tablegen.compensation.frequency import frequency_gain
from tablegen.compensation.hysteresis import BranchShape, LineShape, beta_at
from tablegen.compensation.offset import OffsetLaw, normalised_offset
from tablegen.compensation.response_file import read_response
from tablegen.compensation.size import SizeLaw
from tablegen.config.load import Setup
from tablegen.config.schema import Branch, FastAxis, Hysteresis, Offset, Resonance, ScannerAxis
from tablegen.problems import Problems, Unphysical

# A calibration serves turning points this far beyond the calibrated ones: the paper sees no major difference
# between 0.5 and 0.7 except at large sizes, and 10 % to 25 % between 0.7 and 0.9.
TURN_REACH = 0.1


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
    size_law: SizeLaw
    shape: LineShape
    response: Response | None
    max_boost_db: float

    @property
    def v_amplitude(self) -> float:
        """m g V_scan: volts peak to peak at the piezo for w from 0 to 1."""
        return self.m * self.g * self.v_scan


def compensate(setup: Setup, axis: str, rate_hz: float, problems: Problems) -> Drive | None:
    """Apply the scanner's calibration to one axis ("x" or "y") at its rate; None where ``problems`` grew."""
    scan: FastAxis = getattr(setup.scan, axis)
    scanner: ScannerAxis = getattr(setup.scanner, axis)
    v_max = setup.scanner.v_max
    scan_file, scanner_file = setup.scan_file, setup.scanner_file
    before = len(problems.found)

    offset_law = OffsetLaw()
    if scanner.offset is not None:
        with problems.at(scanner_file, f"{axis}.offset"):
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
                raise Unphysical(f"{v_offset:g} V is outside the driver's 0..{v_max:g} V")
    elif scan.offset_nm is not None:
        with problems.at(scan_file, f"{axis}.offset_nm"):
            v_offset = offset_law.voltage_at(scan.offset_nm, v_max, scanner.size.k_nm_per_v)

    low, high = scan.band_limit.window
    v, size_nm = 0.0, 0.0
    if size_law is not None and scan.size_nm is not None:
        with problems.at(scan_file, f"{axis}.size_nm"):
            size_nm = scan.size_nm / (high - low) if scan.size_of == "window" else scan.size_nm
            v = size_law.voltage(size_nm)
    elif size_law is not None and scan.size_v is not None:
        v = scan.size_v / v_max
        size_nm = size_law.size_nm(v)
        with problems.at(scan_file, f"{axis}.size_v"):
            if v > 1.0:
                raise Unphysical(f"{scan.size_v:g} V is above v_max = {v_max:g} V")

    g = 1.0
    if scanner.frequency is not None:
        with problems.at(scanner_file, f"{axis}.frequency.alpha"):
            g = frequency_gain(rate_hz, scanner.frequency.alpha, scanner.frequency.reference_hz)

    branches = _branches(setup, axis, v, problems)
    response = None
    if scanner.resonance is not None:
        with problems.at(scanner_file, f"{axis}.resonance"):
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
        size_law=size_law,
        shape=shape,
        response=response,
        max_boost_db=scanner.resonance.max_boost_db if scanner.resonance is not None else 0.0,
    )


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

    entries = sorted(enumerate(hysteresis.branches), key=lambda entry: entry[1].turn)
    turns = [entry.turn for _, entry in entries]
    if not turns[0] - TURN_REACH - 1e-9 <= turn <= turns[-1] + TURN_REACH + 1e-9:
        nearest = min(turns, key=lambda t: abs(t - turn))
        problems.add(
            setup.scan_file,
            f"{axis}.turn",
            f"{turn:g} is {abs(turn - nearest):.3g} from the nearest calibrated branch (turn = {nearest:g}); "
            f"{max(turns[0] - TURN_REACH, 0.0):g} to {min(turns[-1] + TURN_REACH, 1.0):g} can be served, "
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
        beta = beta_at(v, _between(one.beta_max, other.beta_max, share), _between(one.rho, other.rho, share))
        with problems.at(setup.scanner_file, f"{key}.u_peak" if hysteresis.model == "harmonic" else f"{key}.beta_max"):
            if hysteresis.model == "harmonic":
                u_peak = _between(one.u_peak or 0.5, other.u_peak or 0.5, share)
                shapes.append(BranchShape.harmonic(beta, u_peak))
            else:
                u_peak = 0.5 + beta  # (16)
                shapes.append(BranchShape.sinusoidal(beta))
            applied.append(AppliedBranch(beta, u_peak))
    if len(shapes) < 2:
        return None
    return (applied[0], applied[1]), LineShape(turn, shapes[0], shapes[1])


def _between(left: float, right: float, share: float) -> float:
    return left + share * (right - left)


def _response(resonance: Resonance, folder: Path) -> Response:
    if resonance.response is None:
        assert resonance.frequency_hz is not None
        assert resonance.quality is not None
        return SecondOrder(resonance.frequency_hz, resonance.quality, resonance.delay_s)
    return read_response(folder / resonance.response)
