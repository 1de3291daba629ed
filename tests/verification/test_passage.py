"""The measured response of a manifest, by the check's own cubics, against the one that a build uses."""

from typing import Any

import numpy as np
import pytest

from tablegen.compensation.dynamics import Measured
from tablegen.manifest.fields import ManifestPassage, ManifestResponse
from tablegen.verification.checks.passage import passes


def random_points(count: int) -> tuple[Any, Any, Any]:
    """Frequencies in Hz, gains and phases in turns, some of whose steps are too large to be followed."""
    random = np.random.default_rng(count)
    f = np.sort(random.uniform(10.0, 1e5, count))
    return f, random.uniform(0.3, 3.0, count), np.cumsum(random.uniform(-0.6, 0.3, count))


@pytest.mark.parametrize("count", [2, 3, 5, 40])
def test_a_check_reads_a_response_as_a_build_does(count: int) -> None:
    f, gain, turns = random_points(count)
    at = np.concatenate([[0.0, 0.5 * f[0]], f, np.linspace(f[0], f[-1], 2001)])
    real, imaginary = Measured(f, gain, turns).inverse(at)
    stated = ManifestPassage(response=ManifestResponse(f.tolist(), gain.tolist(), turns.tolist()))
    assert passes(stated, at) * (real + 1j * imaginary) == pytest.approx(np.ones(len(at)), abs=1e-11)
    assert passes(stated, np.array([1.01 * f[-1]])) == 0.0


def test_gains_and_phases_in_lines_would_be_found() -> None:
    f, gain, turns = random_points(40)
    at = np.linspace(f[0], f[-1], 2001)
    stated = ManifestPassage(response=ManifestResponse(f.tolist(), gain.tolist(), turns.tolist()))
    straight = np.interp(at, f, gain) * np.exp(2j * np.pi * np.interp(at, f, turns))
    assert np.max(np.abs(straight / passes(stated, at) - 1.0)) > 0.05
