"""The certificate with its limits: the guarantees of a build for both axes, and the errors expected on the scanner."""

from collections.abc import Mapping

from tablegen.certificate.excess import LARGEST_PERCENT
from tablegen.certificate.expectation_checks import RESONANCE_PERCENT
from tablegen.config.schema import Limits
from tablegen.html_report.blocks import Grid, Paragraph, Section, TableCell, row
from tablegen.html_report.number_text import figure
from tablegen.html_report.subject import PlannedScan, Subject
from tablegen.manifest.fields import ManifestAxis, ManifestCertificate, ManifestFigure, ManifestShaped

_HEAD = ("", "figure", "limit", "")


def certificate(subject: Subject) -> Section:
    """Return a table of the certificate for each axis."""
    planned = subject.planned
    limits = Limits() if planned is None else planned.plan.limits
    tables = [
        Grid(
            f"{axis} axis, of the waveform itself, computed over all {entry.line.ticks} ticks",
            _HEAD,
            tuple(_rows(entry, limits, _slew(planned, axis))),
        )
        for axis, entry in subject.axes
    ]
    tables.append(_parts(subject))
    tables += [
        Grid(f"{axis} axis, to expect on the scanner", ("", "figure", "uncertain by, or limit", ""), rows)
        for axis, entry in subject.axes
        if (rows := _expected(entry.certificate, limits.max_scaling_error_percent))
    ]
    lead = "Limits in the third column are those of the scan file, of the converter and of the amplifier."
    if planned is None:
        lead = "The limits of the scan file are not in a build; give the scan file to see them."
    if subject.manifest.axes.x.fourier.place is not None:
        lead += " The waveform of x is a sine: its scaling error is that of its codes; pixels have their own, below."
    return Section(
        "certificate",
        "Certificate",
        (*tables, Paragraph("Scaling errors without a limit of their own are marked above 1 %.", "quiet")),
        lead,
    )


def _slew(planned: PlannedScan | None, axis: str) -> float | None:
    return None if planned is None else planned.setup.hardware(axis).amplifier.max_slew_v_per_s


def _rows(entry: ManifestAxis, limits: Limits, slew: float | None) -> list[tuple[TableCell, ...]]:
    certificate, output = entry.certificate, entry.output
    of = "a code" if certificate.shaped is None else "the position"
    rows = [bounded(f"largest error of {of}", certificate.max_error_lsb, limits.max_error_lsb, "LSB")]
    if certificate.rms_error_lsb is not None:
        rows.append(row(f"rms error of {of}", f"{figure(certificate.rms_error_lsb, 3)} LSB", "", ""))
    if certificate.shaped is not None:
        rows += _shaped(certificate.shaped)
    rows += _scaling(certificate, limits.max_scaling_error_percent)
    for side, changes in (certificate.refinement_percent or {}).items():
        text = f"moves {changes.get('position', 0.0):.3g} % of the line, removes {changes.get('scaling', 0.0):.3g} %"
        rows.append(row(f"refinement {side}", text, "", ""))
    if certificate.largest_step is not None:
        rows.append(bounded("largest step", certificate.largest_step, output.max_step, "codes a tick"))
    if certificate.peak_slew_v_per_s is not None:
        rows.append(bounded("steepest slope at the piezo", certificate.peak_slew_v_per_s, slew, "V/s"))
    if certificate.peak_acceleration is not None:
        rows.append(
            row("largest acceleration", f"{certificate.peak_acceleration:.4g} of the line a period squared", "", "")
        )
    for name, room in (("below", certificate.headroom_low), ("above", certificate.headroom_high)):
        if room is not None:
            tone, sign = ("good", "\u2713 within") if room >= 0 else ("bad", "\u2717 outside")
            rows.append(row(f"room {name}", f"{room} codes", "0", TableCell(sign, tone)))  # type: ignore[arg-type]
    if certificate.beyond_cutoff_db is not None:
        rows.append(row("power beyond the cutoff", f"{certificate.beyond_cutoff_db:.1f} dB", "", ""))
    if certificate.at_resonance_db is not None:
        rows.append(row("power at the resonance", f"{certificate.at_resonance_db:.1f} dB", "", ""))
    return rows


def _scaling(certificate: ManifestCertificate, most: float | None) -> list[tuple[TableCell, ...]]:
    """Return the rows of scaling and size errors, with ``most`` percent as their limit."""
    rows = []
    for side, error in (certificate.scaling_error_percent or {}).items():
        worst = max(error.get("total", 0.0), error.get("band_limit", 0.0))
        rows.append(bounded(f"scaling error {side}, peak to peak", worst, most, "%", LARGEST_PERCENT))
        rows.append(bounded(f"size error {side}", error.get("size", 0.0), most, "%", LARGEST_PERCENT, signed=True))
    if certificate.position is not None:
        for side, value in certificate.position.scaling_error_percent.items():
            rows.append(bounded(f"with the resonance that steps drive, {side}", value, None, "%", RESONANCE_PERCENT))
    return rows


def _shaped(shaped: ManifestShaped) -> list[tuple[TableCell, ...]]:
    """Return the effect and the cost of shaping, beside the same without it."""
    now, before, rounded = shaped.changes, shaped.rounded.changes, shaped.rounded
    rows = [row("the same without shaping", f"{figure(rounded.rms_error_lsb, 3)} LSB rms", "", "")]
    for side, value in rounded.scaling_error_percent.items():
        rows.append(row(f"scaling error {side} without shaping", f"{figure(value, 4)} %", "", ""))
    errors = f"{figure(shaped.max_code_error_lsb, 3)} LSB, rms {figure(shaped.rms_code_error_lsb, 3)} LSB"
    rows.append(row("largest error of a code", errors, "", ""))
    text = f"{now.percent:.3g} % of ticks, by {now.mean_step:.3g} codes; without shaping {before.percent:.3g} %"
    rows.append(row("codes change on", f"{text}, by {before.mean_step:.3g}", "", ""))
    return rows


_PARTS = ("uncompensated", "total", "band_limit", "quantisation", "model")


def _parts(subject: Subject) -> Grid:
    """Return the parts of the scaling errors; their peaks are at different places, and do not add up."""
    rows = []
    for axis, entry in subject.axes:
        for side, error in (entry.certificate.scaling_error_percent or {}).items():
            cells = [figure(error[name], 3) if name in error else "-" for name in _PARTS]
            if entry.fourier.place is not None:
                cells[0] = "-"  # a sine is not a bent line
            rows.append(row(f"{axis} {side}", *cells))
    head = ("", *(name.replace("_", " ") for name in _PARTS))
    return Grid("Scaling errors and their parts taken alone [%, peak to peak]", head, tuple(rows))


def bounded(
    name: str, value: float, limit: float | None, unit: str, advice: float | None = None, signed: bool = False
) -> tuple[TableCell, ...]:
    """Return a figure beside its limit; without one, above the figure of ``advice``, it is marked too."""
    text = f"{figure(value, 4, signed)} {unit}"
    if limit is not None:
        good = abs(value) <= limit
        cell = TableCell("\u2713 within", "good") if good else TableCell("\u2717 exceeded", "bad")
        return row(name, text, f"{figure(limit, 6)} {unit}", cell)
    if advice is not None and abs(value) > advice:
        return row(name, text, "none", TableCell(f"! above {advice:g} {unit}", "warn"))
    return row(name, text, "none" if advice is not None else "", "")


def _expected(certificate: ManifestCertificate, most: float | None) -> tuple[tuple[TableCell, ...], ...]:
    expected = certificate.expected
    if expected is None:
        return ()
    basis = "by the operator" if expected.basis == "traces" else "by the laws"
    rows = []
    sides: tuple[tuple[str, Mapping[str, ManifestFigure]], ...] = (
        ("rms residual", expected.rms_percent),
        ("scaling error", expected.scaling_percent),
    )
    for name, figures in sides:
        rows += [_figure(f"{name} {side}", one, basis) for side, one in figures.items()]
    own = certificate.scaling_error_percent or {}
    for side, one in expected.scaling_percent.items():
        parts = own.get(side, {})
        both = one.value + max(parts.get("total", 0.0), parts.get("band_limit", 0.0))
        rows.append(bounded(f"with the waveform's, {side}", both, most, "%", LARGEST_PERCENT))
    if expected.mismatch_percent is not None:
        rows.append(_figure("trace to retrace", expected.mismatch_percent, basis))
    if expected.size_percent is not None:
        rows.append(_figure("size error", expected.size_percent, basis, signed=True))
    if expected.distance_percent is not None:
        text = f"{expected.distance_percent:.2g} % of v_max"
        rows.append(row("nearest measured line", text, "", basis))
    return tuple(rows)


def _figure(name: str, figure_: ManifestFigure, basis: str, signed: bool = False) -> tuple[TableCell, ...]:
    text = f"{figure(figure_.value, 3, signed)} %"
    by = "not known" if figure_.uncertainty is None else f"\u00b1 {figure_.uncertainty:.2g} %"
    return row(name, text, by, TableCell(basis, "quiet"))
