"""A plan and its certificates to a map of file name to content; nothing touches the disk here."""

import re
from collections.abc import Sequence
from functools import cache

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.summary import summary
from tablegen.config.names import of_the_runtime
from tablegen.emit.content import AxisContent, Content
from tablegen.emit.format import Format
from tablegen.emit.formats import UnknownFormat, chosen
from tablegen.emit.templates import comment_safe
from tablegen.manifest.fields import MAXIMUM_FILE_NAME
from tablegen.manifest.format import MANIFEST, content_hash
from tablegen.manifest.record import plan_record
from tablegen.manifest.write import manifest_file
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.resources import own_runtime_folders, resource_folder
from tablegen.version import __version__

_FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*(\.[A-Za-z0-9]+)+")  # of plain files, which manifests can list


def render(plan: Plan, certificates: dict[str, Certificate], formats: Sequence[str] | None = None) -> dict[str, bytes]:
    """Every file of a build by name: those of its formats, what goes with them, and the manifest last.

    ``formats`` are those of the plan unless given. Raises ``UnknownFormat``, and ``Unphysical`` for a scan that a
    format cannot hold.
    """
    wanted = chosen(plan.formats if formats is None else formats)
    record = plan_record(plan)
    digest = content_hash(record)
    content = plan_content(plan, certificates, digest)
    files: dict[str, bytes] = {}
    spelt: dict[str, str] = {MANIFEST: MANIFEST}
    for each in wanted:
        for name, text in {**each.files(content), **runtime_files(each)}.items():
            if not _FILE_NAME.fullmatch(name) or len(name) > MAXIMUM_FILE_NAME or name == MANIFEST:
                raise UnknownFormat(f"{each.name!r} writes {name!r}, which cannot be the name of one of its files")
            if of_the_runtime(name) and name not in own_runtime(each):
                raise UnknownFormat(
                    f"{each.name!r} writes {name!r}, a name of the sequencer's files: dac_*, program_loader*"
                )
            if (other := spelt.setdefault(name.lower(), name)) != name:
                raise UnknownFormat(f"{each.name!r} writes {name!r} beside {other!r}, which some disks take for one")
            if files.setdefault(name, text) != text:
                raise UnknownFormat(f"{each.name!r} writes {name}, and so does another format, with other content")
    files[MANIFEST] = manifest_file(record, digest, [each.name for each in wanted], certificates, files)
    return files


def plan_content(plan: Plan, certificates: dict[str, Certificate], digest: str) -> Content:
    """What formats see of a plan."""

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
        version=__version__,
        scanner=plan.scanner,
        summary=tuple(map(comment_safe, summary(plan, certificates))),  # they name files, in any characters
    )


@cache
def runtime_files(of: Format) -> dict[str, bytes]:
    """What goes with a format unchanged, by name: a sequencer, or nothing."""
    return {path.name: path.read_bytes() for path in of.runtime()}


@cache
def own_runtime(of: Format) -> set[str]:
    """The names of those files among ``runtime_files`` that are tablegen's own, whoever's format this is."""
    known, own = own_runtime_folders(), resource_folder("firmware_templates").resolve()
    # Links are followed only where the path does not say it: to follow that of every file is some percent of a build.
    return {path.name for path in of.runtime() if path.parent in known or own in path.resolve().parents}
