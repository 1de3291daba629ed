"""The checks as JUnit XML, as continuous integration reads it."""

import re
from collections.abc import Sequence
from xml.sax.saxutils import escape, quoteattr

from tablegen.verification.checks.played_checks import Check

_NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(name: str, checks: Sequence[Check], seconds: float = 0.0, manifest_sha256: str = "") -> str:
    """Write one test case a check; the message of a failure is its first line, the text all of it.

    ``manifest_sha256`` is the digest of the manifest, which identifies the build.
    """
    failures = sum(check.failure is not None for check in checks)
    skipped = sum(check.failure is None and not check.exercised for check in checks)
    suite = (
        f'name={quoteattr(f"tablegen verify {name}")} tests="{len(checks)}" failures="{failures}" errors="0" '
        f'skipped="{skipped}" time="{seconds:.3f}"'
    )
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<testsuites>", f"  <testsuite {suite}>"]
    if manifest_sha256:
        entry = f'name="manifest_sha256" value={quoteattr(manifest_sha256)}'
        lines.append(f"    <properties><property {entry}/></properties>")
    for check in checks:
        case = (
            f"classname={quoteattr(f'{name}.{check.subject}')} name={quoteattr(_plain(check.against))} "
            f'time="{check.seconds:.3f}"'
        )
        if check.failure is None:
            empty = f"    <testcase {case}/>"
            lines.append(empty if check.exercised else f'{empty[:-2]}><skipped message="not exercised"/></testcase>')
            continue
        text = _plain(check.failure)
        lines += [
            f"    <testcase {case}>",
            f"      <failure message={quoteattr(text.splitlines()[0])}>{escape(text)}</failure>",
            "    </testcase>",
        ]
    return "\n".join([*lines, "  </testsuite>", "</testsuites>", ""])


def _plain(text: str) -> str:
    """Replace the characters that XML cannot hold."""
    return _NOT_XML.sub("?", text)
