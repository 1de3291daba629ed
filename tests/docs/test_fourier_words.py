"""What docs/decisions says of the width of Fourier words: tables of the example, rendered from shorter ones."""

import pytest
from building import EXAMPLE, REPOSITORY
from replacing import replace

from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.fixedpoint.rounding import Integer, shift_round
from tablegen.fixedpoint.synthesis import synthesize
from tablegen.planning.line_plan import make_plan

PAGE = REPOSITORY / "docs" / "decisions" / "0013-fourier-words-have-32-bits.md"


def shortened(words: Integer, bits: int) -> Integer:
    """Words of 32 bits, rounded to fewer; the bits below are 0."""
    return words if bits == 32 else shift_round(words, 32 - bits) << (32 - bits)


@pytest.mark.parametrize(
    ("axis", "bits", "error"),
    [("x", 32, 0.57), ("x", 22, 0.57), ("x", 18, 0.96), ("y", 32, 0.74), ("y", 22, 0.74), ("y", 19, 0.97)],
)
def test_errors_of_shorter_words(axis: str, bits: int, error: float) -> None:
    plan = make_plan(load(EXAMPLE))
    line = getattr(plan, axis)
    full = line.fourier
    short = replace(full, a0=shortened(full.a0, bits), a=shortened(full.a, bits), b=shortened(full.b, bits))
    words = synthesize(short, len(line.program.words), line.program.bits)
    shorter = replace(line, fourier=short, program=replace(line.program, words=words))
    found = certify(replace(plan, **{axis: shorter}))[axis].max_error_lsb
    assert found == pytest.approx(error, abs=0.005)
    assert f"{error:.2f}" in PAGE.read_text("utf-8")
