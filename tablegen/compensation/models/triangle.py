"""No hysteresis: the drive is the triangle itself."""

from typing import ClassVar

from tablegen.compensation.branches import WithBranches
from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import AppliedBranch, LineRequest, LineShape
from tablegen.compensation.model_problems import ModelProblems


class TriangleModel(WithBranches, frozen=True, tag="triangle"):
    """A linear piezo, or a line that is not compensated. Branches may stay in the table."""

    purpose: ClassVar[str] = "not compensated"
    order: ClassVar[int] = 0
    compensates: ClassVar[bool] = False

    def line(self, request: LineRequest, problems: ModelProblems) -> LineShape:
        """Return a straight line each way."""
        straight, none = BranchShape(), AppliedBranch(0.0, 0.5)
        return LineShape(request.turn, straight, straight, (none, none))

    def described(self, line: LineShape) -> str:
        """Return the model in a line of text."""
        return f"{self.model()}, hysteresis not compensated"


MODEL = TriangleModel
