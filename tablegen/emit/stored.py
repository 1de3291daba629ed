"""The content of a build from its manifest alone, so that its files can be made again and compared."""

from typing import Literal

from tablegen.emit.content import AxisContent, Content
from tablegen.fixedpoint.program import Program
from tablegen.manifest.read import StoredBuild


def stored_content(stored: StoredBuild) -> Content:
    """Return the content of a build, from its manifest alone."""

    def axis(name: Literal["x", "y"], program: Program) -> AxisContent:
        entry = getattr(stored.manifest.axes, name)
        return AxisContent(name, program, entry.fourier_words, entry.output.v_zero, entry.output.v_per_code)

    name = stored.manifest.name
    return Content(
        name=name,
        hash=stored.manifest.hash,
        program=stored.program,
        x=axis("x", stored.program.x),
        y=axis("y", stored.program.y),
        header_only=f"{name}.c" not in stored.manifest.files,
        clocks_per_tick=stored.manifest.clocks_per_tick,
        version=stored.manifest.tablegen,
        z=stored.program_of_z,
    )
