"""A calibration as rows of parameters, as plain data, and as changes of the scanner file."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

from tablegen.base.data_files import Source
from tablegen.calibration.fit_checks import doubts
from tablegen.calibration.laws.frequency import FrequencyFit
from tablegen.calibration.laws.hysteresis import HysteresisFit, TurnFit
from tablegen.calibration.laws.offset import OffsetFit
from tablegen.calibration.laws.offset_sizes import OffsetSizesFit
from tablegen.calibration.laws.points import estimates, measured_points
from tablegen.calibration.laws.resonance import ResonanceFit
from tablegen.calibration.laws.size import SizeFit
from tablegen.calibration.laws.trace import TraceFit
from tablegen.calibration.scanner_file import Change
from tablegen.compensation.branch import LAW, MEASURED
from tablegen.compensation.models.harmonic import HarmonicModel
from tablegen.fitting.estimate import Estimate, Fit, ImageSize
from tablegen.fitting.measured_branch import AmplitudeFit
from tablegen.images.pair_fit import ImageFit

_FACTORS = ("m_minus", "m_plus")
_DIRECTIONS = ("forward", "backward")
_WIDTH = 116  # of a line of a comment


def parameters(fit: Fit) -> list[tuple[str, Estimate, str]]:
    """Return key, estimate and meaning of each parameter; of hysteresis below a row for each turn.

    Raises
    ------
    NotImplementedError
        If the fit is of no known kind.
    """
    match fit:
        case OffsetFit():
            return [
                ("m_minus", fit.m_minus, "amplitude factor at an offset of 0 V"),
                ("m_plus", fit.m_plus, "amplitude factor at an offset of v_max"),
                ("(centre_nm)", fit.centre_nm, "apparent size at the centre"),
            ]
        case OffsetSizesFit():
            return [
                row
                for one in fit.sizes
                for row in (
                    ("size_v", Estimate(one.size_v or 0.0), f"scan voltage of {one.points} images"),
                    *parameters(one),
                )
            ]
        case SizeFit():
            return [
                ("k_nm_per_v", fit.k_nm_per_v, f"at base_nm = {fit.base_nm:g}"),
                ("beta", fit.beta, "0 is the linear scanner"),
                ("v_threshold", fit.v_threshold, "of v_max; linear above"),
            ]
        case FrequencyFit():
            return [
                ("alpha", fit.alpha, "amplitude lost per decade"),
                ("reference_hz", Estimate(fit.reference_hz), "where g is 1"),
            ]
        case ResonanceFit():
            return [
                ("frequency_hz", fit.frequency_hz, "undamped resonance"),
                ("quality", fit.quality, "quality factor"),
                ("delay_s", fit.delay_s, "dead time"),
            ]
        case HysteresisFit():
            return [row for branch in fit.branches for row in _branch_parameters(branch)]
    raise NotImplementedError(type(fit))


def _branch_parameters(branch: TurnFit) -> list[tuple[str, Estimate, str]]:
    amplitudes = ", ".join(f"{trace.v_scan:.4g}" for trace in branch.traces)
    rows = [("turn", branch.turn, f"from {amplitudes} V")]
    for direction in _DIRECTIONS:
        growth = getattr(branch, direction)
        rows += [
            (f"{direction}.beta_max", growth.beta_max, "peak residual at full scale"),
            (f"{direction}.rho", growth.rho, "decay constant of (22)"),
            (f"{direction}.u_peak", growth.u_peak, "where it peaks, along the sweep"),
        ]
    return rows


def change(
    fit: Fit, sources: Sequence[Source], points: bool = False, response: str = "", forced: bool = False
) -> Change:
    """Return the change that the fit makes in the scanner file, and the comment with its origin.

    With ``points`` hysteresis is written as it was measured at each amplitude, in place of (22). With ``response``, the
    name of a file, the measured response takes the place of the resonance. The comment states ``forced``.

    Raises
    ------
    NotImplementedError
        If the fit is of no known kind.
    Unphysical
        With ``points``, if a residual has the wrong sign or makes no branch.
    """
    by_force = ", meaningless, written by --force" if forced else ""
    counted = "images" if fit.images else "points"
    residual = f"{fit.points} {counted}, residual {fit.rms_percent:.2g} % rms{by_force}"
    files = [f"from {_printable(source.name)}, sha256 {source.sha256}" for source in sources]
    from_files = list(files)
    if isinstance(fit, HysteresisFit):
        branches, comments = [], []
        for branch in fit.branches:
            entry: dict[str, Any] = {"turn": float(f"{branch.turn.value:.3g}")}
            for direction in _DIRECTIONS:
                growth = getattr(branch, direction)
                entry[direction] = (
                    {key: measured_points(branch, direction) for key in MEASURED}
                    if points
                    else {key: getattr(growth, key).rounded for key in LAW}
                )
            branches.append(entry)
            count = sum(trace.samples for trace in branch.traces)
            of = "pairs of images" if isinstance(branch.traces[0], ImageFit) else "traces"
            what = "pixels" if isinstance(branch.traces[0], ImageFit) else "samples"
            comments.append(
                [
                    f"{len(branch.traces)} {of}, {count} {what}, residual {fit.rms_percent:.2g} % rms{by_force}",
                    *files,
                    *_errors(_branch_errors(branch, points)),
                ]
            )
        return Change("hysteresis", {"model": HarmonicModel.model()}, (), branches, comments)
    if isinstance(fit, OffsetSizesFit):
        rows = [{key: value.rounded for key, value, _ in parameters(one) if key in _FACTORS} for one in fit.sizes]
        entries = [{"size_v": one.size_v, **row} for one, row in zip(fit.sizes, rows, strict=True)]
        law = ", drive factors by the size law"
        removed = (*_FACTORS, "alpha", "beta", "points")
        pairs = [(f"sizes[{i}].{key}", one) for i, size in enumerate(fit.sizes) for key, one, _ in parameters(size)]
        errors = _errors([(key, one) for key, one in pairs if key.endswith(_FACTORS)])
        return Change("offset", {"sizes": entries}, removed, (), [[residual + law, *files, *errors]])
    files += _errors([(key, estimate) for key, estimate, _ in parameters(fit) if not key.startswith("(")])
    values = {key: estimate.rounded for key, estimate, _ in parameters(fit) if not key.startswith("(")}
    match fit:
        case OffsetFit():
            law = "" if fit.size_v is None else f", drive factors of {fit.size_v:g} V by the size law"
            return Change("offset", values, ("alpha", "beta", "points", "sizes"), (), [[residual + law, *files]])
        case SizeFit():
            return Change("size", {**values, "base_nm": fit.base_nm}, (), (), [[residual, *files]])
        case FrequencyFit():
            return Change("frequency", values, (), (), [[residual, *files]])
        case ResonanceFit() if response:
            as_measured = f"{fit.points} points, as measured"
            return Change("resonance", {"response": response}, tuple(values), (), [[as_measured, *from_files]])
        case ResonanceFit():
            return Change("resonance", values, ("response",), (), [[residual, *files]])
    raise NotImplementedError(type(fit))


def _branch_errors(branch: TurnFit, points: bool) -> list[tuple[str, Estimate]]:
    """Return keys within the entry of a turn, and their estimates."""
    if not points:
        return [(f"{side}.{key}", getattr(getattr(branch, side), key)) for side in _DIRECTIONS for key in LAW]
    return [
        (f"{side}.points[{i}].{key}", one)
        for side in _DIRECTIONS
        for i, (_, *both) in enumerate(estimates(branch, side))
        for key, one in zip(("beta", "u_peak"), both, strict=True)
    ]


def _errors(estimates: Sequence[tuple[str, Estimate]]) -> list[str]:
    """Format lines of the comment: each value with its standard error, if known. `tablegen compare` reads them."""
    texts = [
        f"{key} {one.rounded:.9g} +- {one.standard_error:.2g}"
        for key, one in estimates
        if isfinite(one.standard_error) and one.standard_error > 0.0
    ]
    lines: list[str] = []
    for one in texts:
        if lines and len(lines[-1]) + len(one) < _WIDTH:
            lines[-1] += f", {one}"
        else:
            lines.append(f"standard errors: {one}")
    return lines


def record(fit: Fit, axis: str, sources: Sequence[Source]) -> dict[str, Any]:
    """Return plain data for JSON; an unknown standard error is null."""
    kind = change(fit, sources)
    data: dict[str, Any] = {
        "kind": kind.kind,
        "axis": axis,
        "points": fit.points,
        "sources": [{"name": source.name, "sha256": source.sha256} for source in sources],
        "residual_percent": {
            "before": fit.before_percent,
            "rms": fit.rms_percent,
            "largest": fit.largest_percent,
            "each": fit.residual_percent.tolist(),
        },
        "remarks": list(fit.remarks),
        "doubts": list(doubts(fit)),
        "outliers": list(fit.outliers),
    }
    if fit.images:
        data["images"] = [_image_record(one) for one in fit.images]
    if isinstance(fit, OffsetFit):
        data["size_v"] = fit.size_v
    if isinstance(fit, HysteresisFit):
        data["branches"] = [_branch_record(branch) for branch in fit.branches]
    elif isinstance(fit, OffsetSizesFit):
        data["sizes"] = [
            {"size_v": one.size_v, **{key.strip("()"): _plain(value) for key, value, _ in parameters(one)}}
            for one in fit.sizes
        ]
    else:
        data["parameters"] = {key.strip("()"): _plain(estimate) for key, estimate, _ in parameters(fit)}
    return data


def _image_record(image: ImageSize) -> dict[str, Any]:
    optional = {
        "aspect": image.size.aspect,
        "drift": image.size.drift,
        "open_percent": image.open_percent,
    }
    return {
        "name": image.name,
        "v_scan": image.v_scan,
        "v_offset": image.v_offset,
        "size_nm": _plain(image.size.nm),
        "shared_error": image.size.shared,
        "periods": image.periods,
        "angle_deg": image.size.angle_deg,
        "noise_percent": image.noise_percent,
        **{key: value if isfinite(value) else None for key, value in optional.items()},
    }


def _branch_record(branch: TurnFit) -> dict[str, Any]:
    data: dict[str, Any] = {"turn": _plain(branch.turn)}
    for direction in _DIRECTIONS:
        growth = getattr(branch, direction)
        data[direction] = {key: _plain(getattr(growth, key)) for key in LAW}
    data["traces"] = [_amplitude_record(trace) for trace in branch.traces]
    return data


def _amplitude_record(trace: AmplitudeFit) -> dict[str, Any]:
    data: dict[str, Any] = {"v_scan": trace.v_scan}
    match trace:
        case TraceFit():
            data |= {
                "v_offset": trace.v_offset,
                "rate_hz": 1.0 / trace.triangle.period_s,
                "periods": trace.periods,
                "delay_s": _plain(trace.delay_s),
            }
        case ImageFit():
            data |= {
                "periods": trace.periods,
                "spots": trace.spots,
                "explained": trace.explained,
                "registration_percent": trace.registration_percent,
            }
    return data | {
        "samples": trace.samples,
        "drift_percent": trace.drift_percent,
        "noise_percent": trace.noise_percent,
        "scaling_percent": dict(zip(_DIRECTIONS, trace.scaling_percent, strict=True)),
        **{
            direction: {key: _plain(getattr(getattr(trace, direction), key)) for key in ("beta", "u_peak")}
            for direction in _DIRECTIONS
        },
    }


def _plain(estimate: Estimate) -> dict[str, float | None]:
    error = estimate.standard_error
    return {"value": estimate.value, "standard_error": error if isfinite(error) else None}


def _printable(name: str) -> str:
    return name if name.isprintable() else ascii(name)
