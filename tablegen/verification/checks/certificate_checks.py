"""The certificates of a build, compared with its words and its waveform."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tablegen.base.input_errors import shortened
from tablegen.manifest.fields import ManifestAxis, ManifestShaped
from tablegen.manifest.read import StoredBuild
from tablegen.verification.checks.certified import PlayedPeriod, different_figures
from tablegen.verification.checks.directory import some
from tablegen.verification.checks.expectations import wrong_expectations
from tablegen.verification.checks.passage_checks import wrong_passage
from tablegen.verification.checks.pixels import wrong_pixels
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.checks.scaling import (
    knows,
    peak_acceleration,
    refinement_figures,
    rounded_scaling,
    scaling_figures,
)
from tablegen.verification.checks.shaped import stated_shaping
from tablegen.verification.expected_figures import header_texts, wrong_mismatch, wrong_texts
from tablegen.verification.position import wrong_position

_SILENCE_DB = -200.0  # below it is the rounding of the transform alone: a sine has no even harmonics
_ROUNDED = 1.0 + 1e-9  # rounding, since the target is computed again from the series that is played


@dataclass(frozen=True)
class Certificates:
    """A check of each axis, and the largest error of its codes in LSB, as computed here."""

    checks: list[Check]
    limits: dict[str, float]
    unknown_models: list[str]


def check_certificates(stored: StoredBuild, same_version: bool, folder: Path | None = None) -> Certificates:
    """Check every figure of both axes; scaling errors only of this version of tablegen and of its own models.

    What is expected on the scanner is compared with the text of the headers in ``folder``, where that is given.
    """
    checks: list[Check] = []
    limits: dict[str, float] = {}
    unknown: set[str] = set()
    for name, axis in stored.axes:
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                texts = header_texts(folder, stored) if folder is not None and same_version else {}
                check, limits[name] = _check(name, axis, stored, same_version, texts)
                if same_version and not knows(axis.drive.model):
                    unknown.add(axis.drive.model)
        except (ArithmeticError, ValueError) as error:  # figures that no build states, whatever their types allow
            why = f"{name}: axes.{name} makes no certificate: {error}"
            check, limits[name] = Check(name, "its certificate", "0 figures", "all differ", "0", why), 0.0
        checks.append(check)
    return Certificates(checks, limits, sorted(unknown))


def _wrong_rounded(stated: ManifestShaped, sides: dict[str, float] | None, exact: bool) -> list[str]:
    """List the differing scaling errors without shaping; ``sides`` are None where they cannot be known."""
    sides_stated, name = stated.rounded.scaling_error_percent, "shaped.rounded.scaling_error_percent"
    if sides is None:
        return []
    if sides.keys() != sides_stated.keys():
        return [f"certificate.{name} has {shortened(', '.join(sides_stated)) or 'no direction'}"]
    return different_figures(sides_stated, sides, exact, f"{name}.")


def _level_silence(stated: dict[str, float | int | None], computed: dict[str, float | int | None]) -> None:
    """Take two powers that are nothing but the rounding of the transform as equal."""
    if all((figures["at_resonance_db"] or 0.0) < _SILENCE_DB for figures in (stated, computed)):
        computed["at_resonance_db"] = stated["at_resonance_db"]


def _wrong_pixels(name: str, stored: StoredBuild, axis: ManifestAxis) -> tuple[int, list[str]]:
    """Return the number of figures of pixels, and the wrong ones: those of the fast axis."""
    return wrong_pixels(stored.manifest.sequence, axis) if name == "x" else (0, [])


def _check(
    name: str, axis: ManifestAxis, stored: StoredBuild, same_version: bool, texts: dict[str, str]
) -> tuple[Check, float]:
    period = PlayedPeriod(axis)
    schedule = stored.program.schedule
    rate_hz = float(schedule.line_rate if name == "x" else schedule.frame_rate)
    shaped = period.shaped_by(float(schedule.update_rate_hz))
    computed = period.figures(rate_hz, shaped)
    gentle = axis.fourier.max_scaling_error_percent is not None
    if gentle or axis.certificate.peak_acceleration is not None:
        computed["peak_acceleration"] = peak_acceleration(axis) if gentle else None
    stated_figures = {key: getattr(axis.certificate, key) for key in computed}
    _level_silence(stated_figures, computed)
    wrong, count = different_figures(stated_figures, computed, period.is_whole), len(computed)
    figures_of_pixels, others = _wrong_pixels(name, stored, axis)
    count, wrong = count + figures_of_pixels, wrong + others
    misplaced = wrong_passage(axis, rate_hz)
    wrong += misplaced
    if not misplaced and (same_version or axis.certificate.position is not None):
        figures_of_position, others = wrong_position(axis, period, rate_hz, same_version and knows(axis.drive.model))
        count, wrong = count + figures_of_position, wrong + others
    if shaped is not None:
        figures = shaped.figures()
        count += len(figures)
        wrong += different_figures(stated_shaping(axis.certificate.shaped), figures, period.is_whole, "shaped.")
        if same_version and knows(axis.drive.model) and axis.certificate.shaped is not None:
            wrong += _wrong_rounded(axis.certificate.shaped, rounded_scaling(axis, period, shaped), period.is_whole)
    if same_version and knows(axis.drive.model):
        for key, sides in (
            ("scaling_error_percent", scaling_figures(axis, period, shaped)),
            ("refinement_percent", refinement_figures(axis)),
        ):
            stated = getattr(axis.certificate, key)
            if (stated or {}).keys() != (sides or {}).keys():
                wrong.append(f"certificate.{key} has {shortened(', '.join(stated or {})) or 'no direction'}")
                continue
            for side, parts in (sides or {}).items():
                count += len(parts)
                wrong += different_figures(stated[side], parts, period.is_whole, f"{key}.{side}.")
                wrong += [
                    f"certificate.{key}.{side} has {shortened(part)}" for part in stated[side] if part not in parts
                ]
                most = axis.fourier.max_scaling_error_percent
                if key == "scaling_error_percent" and most is not None and parts["band_limit"] > most * _ROUNDED:
                    wrong.append(f"fourier.max_scaling_error_percent is {most}, {side} has {parts['band_limit']:.6g}")
    if same_version:
        wrong += wrong_expectations(axis)
        wrong += wrong_mismatch(axis)
        wrong += wrong_texts(name, axis, texts)
    step = computed["largest_step"]
    if isinstance(step, int) and step > axis.output.max_step:
        wrong.append(f"output.max_step is {axis.output.max_step}, the words step by {step}")
    failure = f"{name}: {some([f'axes.{name}.{one}' for one in wrong])}" if wrong else None
    return Check(
        name, "its certificate", f"{count} figures", f"{len(wrong)} differ", "0", failure
    ), period.largest_code_error()
