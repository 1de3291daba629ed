"""All files of a certified scan at an angle."""

from collections.abc import Sequence

from tablegen.base.input_errors import Problems, Rejected
from tablegen.certificate.turned_errors import TurnedCertificate
from tablegen.certificate.turned_summary import turned_summary
from tablegen.config.load import Setup
from tablegen.config.schema import SEQUENCER_FORMATS
from tablegen.device.clocks import least_slow_clocks
from tablegen.emit.formats import UnknownFormat, chosen
from tablegen.emit.render import format_rejected
from tablegen.emit.templates import comment_safe
from tablegen.emit.turned import turned_files, turned_runtime
from tablegen.emit.turned_content import TurnedContent
from tablegen.manifest.format import MANIFEST, content_hash
from tablegen.manifest.turned_record import turned_manifest, turned_record
from tablegen.planning.clock import slow_clocks_per_tick
from tablegen.planning.turned_plan import TurnedPlan
from tablegen.version import __version__


def formats_of_turned(setup: Setup, formats: Sequence[str] | None = None) -> tuple[str, ...]:
    """Return the formats of a build, those of the scan file unless they are given, each once.

    Raises
    ------
    Rejected
        For a format that a scan at an angle does not have, or an option of the C that it does not have.
    """
    names = formats or setup.scan.emit.formats or ("c",)
    try:
        needed = tuple(each.name for each in chosen(names))
    except UnknownFormat as error:
        raise format_rejected(setup, str(error), explicit=formats is not None) from None
    for name in names:
        if name not in SEQUENCER_FORMATS:
            why = f"{name!r} holds no scan at an angle, on coupled axes or with drift; formats of one are " + ", ".join(
                SEQUENCER_FORMATS
            )
            raise format_rejected(setup, why, explicit=formats is not None)
    if setup.scan.emit.header_only and "c" in needed:
        why = (
            "true: the tables of a scan at an angle, on coupled axes or with drift are in NAME.c and NAME_program.c, "
            "not in the header; leave this out"
        )
        raise Rejected([setup.scan_file.problem("emit.header_only", why)])
    return needed


def turned_clocks(setup: Setup, plan: TurnedPlan, formats: Sequence[str]) -> int:
    """Return the clocks of a tick of an FPGA, 0 where none plays the scan or its clock is not known.

    Raises
    ------
    Rejected
        If the clock is too slow for the scan.
    """
    if "verilog" not in formats:
        return 0
    programs = [each for each in (plan.program, plan.program_of_z) if each is not None]
    problems = Problems()
    clocks = slow_clocks_per_tick(setup, max(programs, key=least_slow_clocks), problems)
    problems.stop_if_any()
    return clocks


def render_turned(
    plan: TurnedPlan, certificate: TurnedCertificate, formats: Sequence[str], clocks_per_tick: int = 0
) -> dict[str, bytes]:
    """Return every file of a build by its name, the manifest last."""
    names, record = list(formats), turned_record(plan)
    digest = content_hash(record)
    text = tuple(map(comment_safe, turned_summary(plan, certificate)))
    content = TurnedContent(
        plan.name, digest, plan.program, __version__, plan.scanner, text, clocks_per_tick, plan.program_of_z
    )
    files = turned_files(content, names) | turned_runtime(names)
    files[MANIFEST] = turned_manifest(record, digest, names, certificate, files, clocks_per_tick)
    return files
