"""From a plan and its certificates to a map of file name to content, in memory alone."""

import re
from collections.abc import Sequence
from functools import cache
from pathlib import PurePosixPath

from tablegen.base.input_errors import Problem, Problems, Rejected, Unphysical
from tablegen.base.resources import own_runtime_folders, resource_folder
from tablegen.certificate.certificate import Certificate
from tablegen.certificate.summary import summary
from tablegen.config.load import Setup
from tablegen.config.names import of_the_runtime
from tablegen.config.schema import SEQUENCER_FORMATS
from tablegen.emit.content import AxisContent, Content
from tablegen.emit.format import Format
from tablegen.emit.formats import UnknownFormat, chosen, failing_as_format, files_of, runtime_paths
from tablegen.emit.templates import comment_safe
from tablegen.manifest.fields import MAXIMUM_FILE_NAME
from tablegen.manifest.format import MANIFEST, content_hash
from tablegen.manifest.record import plan_record
from tablegen.manifest.write import TooLongManifest, UnreadableManifest, manifest_file, require_readable
from tablegen.planning.clock import slow_clocks_per_tick
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.version import __version__

# Names of plain files that manifests can list; only a file in a sub-folder has a name without a suffix.
_PART = "[A-Za-z0-9_][A-Za-z0-9_-]*"
_SUFFIX = r"(\.[A-Za-z0-9][A-Za-z0-9_]*)"
_FILE_NAME = re.compile(rf"({_PART}/)+{_PART}{_SUFFIX}*|{_PART}{_SUFFIX}+")
_SEQUENCERS = f"one of {', '.join(SEQUENCER_FORMATS)}"


def render(plan: Plan, certificates: dict[str, Certificate], formats: Sequence[str] | None = None) -> dict[str, bytes]:
    """Render every file of a build by name: those of its formats, what goes with them, and the manifest last.

    Parameters
    ----------
    formats
        Names of formats; by default those of the plan.

    Returns
    -------
    dict of str to bytes
        Contents by file name.

    Raises
    ------
    UnknownFormat
        If a format is unknown, or writes a file that another one or the runtime has.
    Unphysical
        If a format cannot hold the scan.
    FormatFailed
        If a format of another distribution fails.
    """
    chosen_formats = chosen(plan.formats if formats is None else formats)
    record = plan_record(plan)
    digest = content_hash(record)
    content = plan_content(plan, certificates, digest)
    files: dict[str, bytes] = {}
    spelt: dict[str, str] = {MANIFEST: MANIFEST}
    for each in chosen_formats:
        if plan.schedule.pixel_table is not None and each.name not in SEQUENCER_FORMATS:
            raise Unphysical(f"{each.name!r} has no table of pixels, which a sine needs; take {_SEQUENCERS}")
        if plan.z is not None and each.name not in SEQUENCER_FORMATS:
            raise Unphysical(f"{each.name!r} plays no output z; leave [z] out, or take {_SEQUENCERS}")
        own_files = files_of(each, content)
        with failing_as_format(each):
            own_files |= runtime_files(each, plan.z is not None)
        for name, text in own_files.items():
            if not _FILE_NAME.fullmatch(name) or len(name) > MAXIMUM_FILE_NAME or name == MANIFEST:
                raise UnknownFormat(f"{each.name!r} writes {name!r}, which cannot be the name of one of its files")
            if any(map(of_the_runtime, name.split("/"))) and name not in own_runtime(each, plan.z is not None):
                raise UnknownFormat(
                    f"{each.name!r} writes {name!r}, a name of the sequencer's files: dac_*, program_loader*"
                )
            for place in (name, *(f"{parent}/" for parent in PurePosixPath(name).parents[:-1])):
                if (other := spelt.setdefault(place.rstrip("/").lower(), place)) != place:
                    raise UnknownFormat(
                        f"{each.name!r} writes {place!r} beside {other!r}, which some disks take for one"
                    )
            if files.setdefault(name, text) != text:
                raise UnknownFormat(f"{each.name!r} writes {name}, and so does another format, with other content")
    names = [each.name for each in chosen_formats]
    tilts = {tilt.name: tilt.errors for tilt in plan.tilts}
    files[MANIFEST] = manifest_file(record, digest, names, certificates, files, plan.clocks_per_tick, tilts)
    return files


def render_scan(
    setup: Setup,
    plan: Plan,
    certificates: dict[str, Certificate],
    formats: Sequence[str] | None = None,
    *,
    explicit: bool = False,
) -> dict[str, bytes]:
    """Render a planned scan, with a fault of a format at its key of the scan file.

    Parameters
    ----------
    setup, plan, certificates
        The scan as it was planned and certified.
    formats
        Names of formats; those of the plan unless given.
    explicit
        The formats stand beside the scan file, as those of ``--format`` do: a fault has no place in it.

    Returns
    -------
    dict
        Content by file name, the manifest last.

    Raises
    ------
    Rejected
        For an unknown format, for a scan that a format cannot hold, for a clock that is too slow for its output z, and
        for a build that could not be read back.
    """
    try:
        names = [each.name for each in chosen(plan.formats if formats is None else formats)]
        if plan.program_of_z is not None and "verilog" in names:
            problems = Problems()
            slow_clocks_per_tick(setup, plan.program_of_z, problems, "z")
            problems.stop_if_any()
        files = render(plan, certificates, formats)
        require_readable(files[MANIFEST])
    except (UnknownFormat, Unphysical) as error:
        raise format_rejected(setup, str(error), explicit=explicit) from None
    except UnreadableManifest as error:
        raise Rejected([_unreadable(setup, plan, error)]) from None
    return files


def _unreadable(setup: Setup, plan: Plan, error: UnreadableManifest) -> Problem:
    """Return the problem of a build that no command could read, at the table that makes its manifest too long."""
    key, why = "", f"manifest.json of this build would be refused when it is read back: {error}"
    longest = max(plan.lines, key=lambda line: len(line.program.words))
    if isinstance(error, TooLongManifest) and longest.program.mode == "direct":
        words = len(longest.program.words)
        key, why = f"{longest.axis}.table.mode", f"'direct' takes {words} words, and {why}; use 'interpolated'"
    return setup.scan_file.problem(key, why)


def format_rejected(setup: Setup, why: str, *, explicit: bool) -> Rejected:
    """Return the rejection of a format, at ``emit.formats`` or, for formats that were ``explicit``, without a place."""
    return Rejected([Problem("formats", 0, "", why) if explicit else setup.scan_file.problem("emit.formats", why)])


def plan_content(plan: Plan, certificates: dict[str, Certificate], digest: str) -> Content:
    """Return what formats see of a plan."""

    def axis(line: LinePlan) -> AxisContent:
        converter = line.converter
        return AxisContent(line.axis, line.program, line.fourier.in_order, converter.v_zero, converter.v_per_code)

    return Content(
        name=plan.name,
        hash=digest,
        program=plan.program,
        x=axis(plan.x),
        y=axis(plan.y),
        header_only=plan.header_only,
        clocks_per_tick=plan.clocks_per_tick,
        version=__version__,
        scanner=plan.scanner,
        summary=tuple(map(comment_safe, summary(plan, certificates))),  # they name files, in any characters
        z=plan.program_of_z,
    )


@cache
def runtime_files(of: Format, with_z: bool = False) -> dict[str, bytes]:
    """Read the files that go with a format unchanged, by name: a sequencer, with what z needs of it, or nothing."""
    return {path.name: path.read_bytes() for path in runtime_paths(of, with_z)}


@cache
def own_runtime(of: Format, with_z: bool = False) -> set[str]:
    """List the names among ``runtime_files`` that are tablegen's own, whoever's format this is."""
    known, own = own_runtime_folders(), resource_folder("firmware_templates").resolve()
    # Links are followed only where the path does not say it: to follow that of every file is some percent of a build.
    paths = runtime_paths(of, with_z)
    return {path.name for path in paths if path.parent in known or own in path.resolve().parents}
