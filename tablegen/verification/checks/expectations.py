"""The consistency of what a manifest expects on the scanner; the operator behind it is not in the directory.

The traces of an operator, and the laws of a scanner file, are in no build. So the figures themselves are statements.
"""

from collections.abc import Iterator

from tablegen.base.input_errors import shortened
from tablegen.manifest.fields import ManifestAxis, ManifestExpected
from tablegen.verification.checks.scaling import OPERATOR


def wrong_expectations(axis: ManifestAxis) -> list[str]:
    """List expectations that no build of this version states."""
    expected, layer = axis.certificate.expected, axis.fourier.refinement is not None
    if expected is None:
        return ["certificate.expected is missing, and the operator says it"] if _by_operator(axis) and not layer else []
    if layer:
        return ["certificate.expected is there, and the model did not expect the layer"]
    if _by_operator(axis) and expected.basis != "traces":
        return [f"certificate.expected.basis is {expected.basis}, and the axis has an operator"]
    return [f"certificate.expected.{why}" for why in _wrong(axis, expected)]


def _by_operator(axis: ManifestAxis) -> bool:
    return axis.drive.model == OPERATOR


def _wrong(axis: ManifestAxis, expected: ManifestExpected) -> Iterator[str]:
    both, traces = axis.fourier.directions == "both", expected.basis == "traces"
    sides = (["forward", "backward"] if both else ["forward"]) if traces else []
    for name in ("rms_percent", "scaling_percent"):
        figures = getattr(expected, name)
        if sorted(figures) != sorted(sides):
            yield f"{name} has {shortened(', '.join(figures)) or 'no direction'}, not {', '.join(sides) or 'none'}"
        for side, figure in figures.items():
            if figure.value < 0.0 or (figure.uncertainty or 0.0) < 0.0:
                yield f"{name}.{side} is below 0"
    for name, due in (("mismatch_percent", both), ("size_percent", traces), ("distance_percent", traces)):
        if (getattr(expected, name) is not None) != due:
            yield f"{name} is {'missing' if due else 'there, and nothing says it'}"
    if both and traces and expected.mismatch_percent is not None and sorted(expected.rms_percent) == sorted(sides):
        one, other = (figure.value for figure in expected.rms_percent.values())
        # The rms of a difference is below its maximum.
        if abs(one - other) > expected.mismatch_percent.value * (1.0 + 1e-5):
            yield "rms_percent of both directions differ by more than mismatch_percent"
    mismatch, size = expected.mismatch_percent, expected.size_percent
    if mismatch is not None and (mismatch.value < 0.0 or (mismatch.uncertainty or 0.0) < 0.0):
        yield "mismatch_percent is below 0"
    if size is not None and (size.uncertainty or 0.0) < 0.0:
        yield "size_percent.uncertainty is below 0"
    if (expected.distance_percent or 0.0) < 0.0:
        yield "distance_percent is below 0"
