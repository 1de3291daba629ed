"""A round of refinement for the terminal, and as plain data."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tablegen.base.data_files import Source
from tablegen.base.remedies import FindingCode
from tablegen.base.warnings import of_remarks, worst_first
from tablegen.certificate.error_answer import ErrorAnswer, Of, measured_answer
from tablegen.config.frame import lines_inside
from tablegen.refinement.departure import Departure
from tablegen.refinement.image_round import ImageRound, MismatchRound
from tablegen.refinement.round import Round, TraceRound


def refine_text(result: Round, name: str, sources: Sequence[Source]) -> list[str]:
    """Format a round for the terminal."""
    update = result.update
    lines = [
        str(round_answer(result)),
        "",
        f"{name}, {result.line.axis}: {_what(result, sources)}",
        "",
        "                        residual [% of the line]   scaling error",
        "direction                    rms      largest      [% peak to peak]",
    ]
    for label, departure in (("measured", update.before), ("predicted", update.after)):
        for side, (rms, largest) in departure.residual_percent.items():
            scaling = departure.scaling_percent[side]
            lines.append(f"{side:<9}  {label:<11}  {rms:8.4f}     {largest:8.4f}      {scaling:8.3f}")
    lines += [
        f"its noise{'':<14}{update.noise_percent:8.4f}{'':<20}{update.chord_noise_percent:8.3f} rms of a chord",
        "",
        *_size(result),
        *_learnt(result),
        *_bound(result),
        "",
    ]
    return lines


def round_answer(result: Round) -> ErrorAnswer:
    """Return the error of the axis that the measurement of a round shows, and the next step."""
    code: FindingCode = "learnt-round"
    if result.worse:
        code = "worse-round"
    elif result.stopped:
        code = "stopped-round" if result.best is not None else "useless-layer"
    elif not result.update.harmonics:
        code = "noise-limit"
    scan = result.setup.scan
    limit, line_count = scan.y.band_limit, scan.timing.lines
    rows = lines_inside(scan.y.turn, limit.window, limit.directions == "both", line_count)[0][1]
    of: Of = "trace to retrace, rms" if isinstance(result, MismatchRound) else "rms"
    count = scan.timing.pixels if result.line.axis == "x" else max(rows, 1)
    return measured_answer(result.line, count, of, result.update.before.rms_percent, "measured (refine)", code)


def _what(result: Round, sources: Sequence[Source]) -> str:
    """Name the measurement and its sources."""
    names = " and ".join(source.name for source in sources[:2]) + (" and others" if len(sources) > 2 else "")
    return f"{result.recorded}{'' if isinstance(result, TraceRound) else ','} of {names}"


def _size(result: Round) -> list[str]:
    """Format the length of x's line by the constant of the sample."""
    if not isinstance(result, ImageRound) or result.size is None:
        return []
    size, requested_nm = result.size.nm, result.requested_nm
    by = 100.0 * (size.value / requested_nm - 1.0)
    return [
        f"size of x: {size.value:.5g} +- {size.standard_error:.2g} nm from turn to turn, requested "
        f"{requested_nm:.5g} nm: {by:+.3g} +- {100.0 * size.standard_error / requested_nm:.2g} %"
    ]


def _learnt(result: Round) -> list[str]:
    update = result.update
    if not update.harmonics:
        return ["learnt: nothing"]
    change, layer = (100.0 * float(np.max(np.abs(s.on_grid(1024)))) for s in (update.change, update.layer))
    return [
        f"learnt: harmonics 1 to {update.harmonics} of {result.bound.used}, up to {change:.3g} % of the line; "
        f"the layer is now up to {layer:.3g} %"
    ]


def _bound(result: Round) -> list[str]:
    b = result.bound
    lines = [
        f"bound: at a gain of {b.gain:g} it converges while the scanner's response at harmonics 1 to {b.used} is below "
        f"{b.largest_gain:.3g} times the modelled one, or off by less than {b.phase_deg:.3g} degrees, a delay of "
        f"{1e6 * b.delay_s:.3g} us"
    ]
    if b.dynamics:
        lines.append(
            f"with the dynamics of the scanner file off by a quarter a round leaves {100.0 * b.remaining:.3g} % at "
            f"worst; up to {b.harmonics} harmonics converge"
        )
    else:
        lines.append("the scanner file has no dynamics: keep the resonance and the delay away from these harmonics")
    return lines


def refine_record(result: Round, name: str, sources: Sequence[Source]) -> dict[str, Any]:
    """Return the round as plain data, for JSON."""
    line, update, b = result.line, result.update, result.bound

    def errors(departure: Departure) -> dict[str, Any]:
        sides = departure.residual_percent
        return {
            "residual_rms_percent": departure.rms_percent,
            **{
                side: {
                    "residual_rms_percent": rms,
                    "residual_largest_percent": largest,
                    "scaling_error_peak_to_peak_percent": departure.scaling_percent[side],
                }
                for side, (rms, largest) in sides.items()
            },
        }

    return {
        "scan": name,
        "axis": line.axis,
        "answer": round_answer(result).record(),
        **_measurement(result, sources),
        "measured": errors(update.before),
        "predicted": errors(update.after),
        "harmonics": update.harmonics,
        "bound": {
            "gain": b.gain,
            "harmonics": b.harmonics,
            "used": b.used,
            "left_of_error": b.remaining,
            "largest_gain": b.largest_gain,
            "phase_deg": b.phase_deg,
            "delay_s": b.delay_s,
            "dynamics_known": b.dynamics,
        },
        "layer": {"a": update.layer.a.tolist(), "b": update.layer.b.tolist()},
        "worse": result.worse or None,
        "stopped": result.stopped or None,
        "remarks": list(result.remarks),
        "findings": [one.record() for one in worst_first(of_remarks(result.remarks))],
    }


def _measurement(result: Round, sources: Sequence[Source]) -> dict[str, Any]:
    """Return the fields that differ between a trace and images."""
    plain = [{"name": source.name, "sha256": source.sha256} for source in sources]
    line, update = result.line, result.update
    if isinstance(result, TraceRound):
        measured = result.displacement
        return {
            "source": plain[0],
            "period_s": result.phase.period_s,
            "periods": measured.periods,
            "samples": measured.samples,
            "left_out": measured.left_out,
            "size_nm": abs(update.before.size_nm),
            "asked_nm": line.drive.size_nm,
            "noise": {"reading_nm": measured.noise_nm, "position_percent": update.noise_percent},
            "drift_nm": measured.drift_nm,
        }
    if isinstance(result, ImageRound | MismatchRound):
        geometry = result.frames[0].geometry
        shared = {
            "images": [{"trace": trace, "retrace": retrace} for trace, retrace in zip(*[iter(plain)] * 2, strict=True)],
            "rows": geometry.rows,
            "columns": geometry.columns,
            "noise": {"position_percent": update.noise_percent},
        }
    if isinstance(result, MismatchRound):
        return {**shared, "mismatch": True, "match": min(frame.match for frame in result.frames)}
    if isinstance(result, ImageRound):
        first = result.frames[0]
        return {
            **shared,
            "mismatch": False,
            "periods_of_the_sample": result.periods,
            "waves": len(first.fit.state.q),
            "periodic_share": min(first.fit.explained),
            "asked_nm": result.requested_nm,
            "size_nm": None if result.size is None else result.size.nm.value,
            "size_standard_error_nm": None if result.size is None else result.size.nm.standard_error,
        }
    raise TypeError(type(result).__name__)
