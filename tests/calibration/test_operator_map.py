"""The map of `calibrate operator --plot`: how large the residual of other scans may be."""

from pathlib import Path

import numpy as np
import pytest
from operator_files import operator_file, write_operator_scan

from tablegen.calibration.operator.advice import possible_rms
from tablegen.compensation.operator.file import read_operator
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.uncertainty import possible_errors

pytestmark = pytest.mark.common


def operator(folder: Path) -> Operator:
    """Of traces at half of v_max alone, each of which the others predict within 0.009 % rms."""
    file = write_operator_scan(folder, operator_file(rms=0.009)).parent / "operator.toml"
    return read_operator(file, "operator.toml")[0]


def test_it_grows_with_the_distance_from_the_offset_of_the_traces(tmp_path: Path) -> None:
    centres = np.array([0.5, 0.6, 0.7, 0.85])
    (rms,) = possible_rms(operator(tmp_path), np.array([0.25, 0.3]), centres)[1:]
    assert np.all(np.diff(rms) > 0.0)
    assert rms[0] < 0.02
    assert rms[3] > 10.0 * rms[0]


def test_it_is_what_a_build_adds_to_its_expectation(tmp_path: Path) -> None:
    strokes, centres = np.linspace(0.1, 0.4, 7), np.linspace(0.3, 0.7, 9)
    shown, one = possible_rms(operator(tmp_path), strokes, centres), operator(tmp_path)
    built = [[possible_errors(one, s, c)[0] for c in centres.tolist()] for s in strokes.tolist()]
    np.testing.assert_allclose(shown, built, rtol=0.05, atol=2e-3)
