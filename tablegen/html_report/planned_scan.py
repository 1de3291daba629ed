"""Plan a scan file for a report or a comparison, also where a limit of the certificate is exceeded."""

from collections.abc import Callable
from pathlib import Path

from tablegen.certificate.certified_scan import certify_scan
from tablegen.certificate.scan_warnings import weighed_warnings
from tablegen.config.load import Setup, load
from tablegen.emit.render import render_scan
from tablegen.html_report.ranking import without_folder
from tablegen.html_report.subject import PlannedScan, Subject, of_scan
from tablegen.html_report.verify_record import VerifyRecord


def planned_scan(
    scan: Path | Setup,
    verified: VerifyRecord | None = None,
    progress: Callable[[str], object] = lambda _: None,
    *,
    remedies: bool = True,
) -> Subject:
    """Plan and certify a scan and render its files, without writing them.

    Parameters
    ----------
    scan
        Path of the scan file, or a loaded one.
    verified
        The record of `tablegen verify --junit` of its build.
    progress
        Called with each stage, in words.
    remedies
        True to look for warnings, and for remedies of these and of limits that are exceeded, which takes most of the
        time.

    Raises
    ------
    Rejected
        For wrong input.
    """
    setup = scan if isinstance(scan, Setup) else load(scan)
    certified = certify_scan(setup, progress, remedies=remedies)
    plan, certificates = certified.plan, certified.certificates
    warnings = []
    if remedies:
        progress("looking for remedies")
        warnings = [
            (percent, without_folder(problem)) for percent, problem in weighed_warnings(setup, plan, certificates)
        ]
    progress("writing the formats")
    files = render_scan(setup, plan, certificates)
    broken = tuple(map(without_folder, certified.broken))
    return of_scan(PlannedScan(setup, plan, certificates, broken, tuple(warnings)), files, verified)
