"""Compensated scan waveforms for piezo scanners, as fixed-point tables in C, Verilog and other formats.

From a scan file to arrays and files in two lines::

    scan = tablegen.build("scan.toml", "build")     # plan, certificate, files
    plot(scan.x.time_s, scan.x.volts)               # numpy arrays of one line, a value a tick

What is public stands in ``tablegen.__all__`` and docs/python.md: ``load``, ``plan``, ``certify`` and ``build`` make a
scan, ``variants`` and ``build_many`` many, ``read_build`` and ``verify`` take one from its directory, ``Device`` talks
to an instrument. ``calibrate``, ``refine`` and ``correct`` take measurements and images; ``Laboratory`` simulates them.
Everything else may change. Names are loaded when they are first used, so that importing tablegen costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from tablegen.version import __version__

if TYPE_CHECKING:
    from tablegen.api.build import BrokenLimit, Build, build, certify, load, plan
    from tablegen.api.calibrate import Calibrated, calibrate
    from tablegen.api.correct import Corrected, correct
    from tablegen.api.laboratory import Laboratory
    from tablegen.api.many import BuildOutcome, build_many, variants
    from tablegen.api.refine import RefinedScan, refine
    from tablegen.api.samples import Samples
    from tablegen.base.input_errors import Problem, Rejected, Unphysical
    from tablegen.certificate.certificate import Certificate
    from tablegen.config.load import Setup
    from tablegen.config.variants import Variant
    from tablegen.emit.content import Content
    from tablegen.emit.format import Format
    from tablegen.emit.write import CannotWrite
    from tablegen.link.device import Device
    from tablegen.link.errors import LinkError
    from tablegen.link.prepare import PreparedScan
    from tablegen.manifest.read import NotABuild, StoredBuild, read_build
    from tablegen.planning.line_plan import Plan
    from tablegen.verification.build_report import Report
    from tablegen.verification.failures import ToolMissing
    from tablegen.verification.run import verify

_HOMES = {
    "load": "tablegen.api.build",
    "plan": "tablegen.api.build",
    "certify": "tablegen.api.build",
    "build": "tablegen.api.build",
    "build_many": "tablegen.api.many",
    "variants": "tablegen.api.many",
    "read_build": "tablegen.manifest.read",
    "verify": "tablegen.verification.run",
    "calibrate": "tablegen.api.calibrate",
    "refine": "tablegen.api.refine",
    "correct": "tablegen.api.correct",
    "Laboratory": "tablegen.api.laboratory",
    "Calibrated": "tablegen.api.calibrate",
    "RefinedScan": "tablegen.api.refine",
    "Corrected": "tablegen.api.correct",
    "Device": "tablegen.link.device",
    "Setup": "tablegen.config.load",
    "Plan": "tablegen.planning.line_plan",
    "Certificate": "tablegen.certificate.certificate",
    "Build": "tablegen.api.build",
    "Samples": "tablegen.api.samples",
    "BuildOutcome": "tablegen.api.many",
    "Variant": "tablegen.config.variants",
    "StoredBuild": "tablegen.manifest.read",
    "Report": "tablegen.verification.build_report",
    "Format": "tablegen.emit.format",
    "Content": "tablegen.emit.content",
    "Rejected": "tablegen.base.input_errors",
    "Problem": "tablegen.base.input_errors",
    "Unphysical": "tablegen.base.input_errors",
    "BrokenLimit": "tablegen.api.build",
    "CannotWrite": "tablegen.emit.write",
    "NotABuild": "tablegen.manifest.read",
    "ToolMissing": "tablegen.verification.verilog.simulate",
    "LinkError": "tablegen.link.errors",
    "PreparedScan": "tablegen.link.prepare",
}

__all__ = [  # noqa: RUF022 - in the order in which they are used
    "load",
    "plan",
    "certify",
    "build",
    "variants",
    "build_many",
    "read_build",
    "verify",
    "calibrate",
    "refine",
    "correct",
    "Laboratory",
    "Device",
    "Setup",
    "Plan",
    "Certificate",
    "Build",
    "Samples",
    "Variant",
    "BuildOutcome",
    "Calibrated",
    "RefinedScan",
    "Corrected",
    "StoredBuild",
    "PreparedScan",
    "Report",
    "Format",
    "Content",
    "Rejected",
    "Problem",
    "Unphysical",
    "BrokenLimit",
    "CannotWrite",
    "NotABuild",
    "ToolMissing",
    "LinkError",
    "__version__",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'tablegen' has no attribute {name!r}; it has {', '.join(_HOMES)}")
    found = getattr(import_module(_HOMES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__doc__"])
