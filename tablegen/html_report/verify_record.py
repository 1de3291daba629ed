"""The record of `tablegen verify --junit`: its checks, and the build that they verify."""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from tablegen.base.reading import RECORD, read_text

_MOST_CHECKS = 1000


@dataclass(frozen=True)
class RecordedCheck:
    """One check; ``failure`` is empty if it passed, ``exercised`` is false if it had no stimulus."""

    name: str
    failure: str
    exercised: bool


@dataclass(frozen=True)
class VerifyRecord:
    """A record: ``digest`` is the SHA-256 of the verified manifest, empty if the record does not have it."""

    name: str
    digest: str
    checks: tuple[RecordedCheck, ...]


def read_record(path: Path) -> VerifyRecord:
    """Read a JUnit file of `tablegen verify`.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is no such record; the message has the reason.
    """
    try:
        text = read_text(path, RECORD)  # in no other encoding, whatever its declaration
    except UnicodeDecodeError:
        raise ValueError("is no UTF-8") from None
    if "<!" in text:  # entity declarations could expand without limit, and a record has none
        raise ValueError("is no record of `tablegen verify --junit`: it has declarations")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"is no XML: {error}") from None
    suite = root.find("testsuite")
    if suite is None or not suite.get("name", "").startswith("tablegen verify "):
        raise ValueError("is no record of `tablegen verify --junit`")
    digest = ""
    for entry in suite.iterfind("properties/property"):
        digest = entry.get("value", "") if entry.get("name") == "manifest_sha256" else digest
    checks = []
    for case in suite.iterfind("testcase"):
        failure = case.find("failure")
        message = "" if failure is None else (failure.get("message") or "failed")
        subject = case.get("classname", "").rpartition(".")[2]
        checks.append(RecordedCheck(f"{subject}: {case.get('name', '')}", message, case.find("skipped") is None))
    if len(checks) > _MOST_CHECKS:
        raise ValueError(f"has {len(checks)} checks, more than the {_MOST_CHECKS} of any build")
    return VerifyRecord(suite.get("name", "").removeprefix("tablegen verify "), digest, tuple(checks))
