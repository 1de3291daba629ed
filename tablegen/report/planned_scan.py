"""From a scan file to the subject of a report, also where a limit of the certificate is exceeded."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.certificate.certificate import broken_limits, certify
from tablegen.certificate.scan_warnings import limit_advice, weighed_warnings
from tablegen.config.load import load
from tablegen.emit.formats import UnknownFormat
from tablegen.emit.render import render
from tablegen.planning.line_plan import make_plan
from tablegen.report.ranking import placed
from tablegen.report.subject import PlannedScan, Subject, of_scan
from tablegen.report.verify_record import VerifyRecord


def planned_scan(
    scan: Path, verified: VerifyRecord | None = None, tell: Callable[[str], None] = lambda _: None
) -> Subject:
    """Plan and certify a scan, and make its files, without writing them. Raises ``Rejected`` for wrong input."""
    tell("shaping the waveforms")
    setup = load(scan)
    plan = make_plan(setup)
    tell("measuring every tick of a line and a frame")
    certificates = certify(plan)
    tell("looking for remedies")
    broken = broken_limits(
        plan, certificates, setup.scan_file, partial(limit_advice, setup, plan, certificates), setup.hardware_problem
    )
    warnings = [(percent, placed(one)) for percent, one in weighed_warnings(setup, plan, certificates)]
    tell("writing the formats")
    try:
        files = render(plan, certificates, list(plan.formats))
    except (UnknownFormat, Unphysical) as error:
        raise Rejected([setup.scan_file.problem("emit.formats", str(error))]) from None
    return of_scan(PlannedScan(setup, plan, certificates, tuple(map(placed, broken)), tuple(warnings)), files, verified)
