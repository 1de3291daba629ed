"""All files of a certified scan at an angle."""

from tablegen.certificate.turned_errors import TurnedCertificate
from tablegen.certificate.turned_summary import turned_summary
from tablegen.emit.templates import comment_safe
from tablegen.emit.turned import TurnedContent, turned_files, turned_runtime
from tablegen.manifest.format import MANIFEST, content_hash
from tablegen.manifest.turned_record import turned_manifest, turned_record
from tablegen.planning.turned_plan import TurnedPlan
from tablegen.version import __version__


def render_turned(plan: TurnedPlan, certificate: TurnedCertificate) -> dict[str, bytes]:
    """Return every file of a build by its name, the manifest last."""
    record = turned_record(plan)
    digest = content_hash(record)
    text = tuple(map(comment_safe, turned_summary(plan, certificate)))
    content = TurnedContent(plan.name, digest, plan.program, __version__, plan.scanner, text)
    files = turned_files(content) | turned_runtime()
    files[MANIFEST] = turned_manifest(record, digest, certificate, files)
    return files
