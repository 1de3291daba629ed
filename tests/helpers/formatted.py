"""Builds in chosen formats, what stands in their manifests, and damage that their hashes do not show."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from building import NAME, VARIANTS, Variant, write_variant
from editing import run

from tablegen.certificate.certificate import Certificate, certify
from tablegen.config.load import load
from tablegen.emit.render import render
from tablegen.emit.write import write_files
from tablegen.planning.line_plan import Plan, make_plan

# A frame of 2648 ticks; words of 16 bits, and of widths that are no whole bytes; tables of an odd length; y in steps.
SHORT = VARIANTS["short_frame"]
_SMALL = {key: value for key, value in SHORT.scan.items() if key != "emit.header_only"}
_TIMING: Any = SHORT.scan["timing"]
BUILDS: dict[str, Variant] = {
    "short": SHORT,
    "bits_18": Variant({**_SMALL, "x.table.bits": 18, "y.table.bits": 24, "dac.bits": 18}),
    "bits_8": Variant({**_SMALL, "x.table.bits": 8, "y.table.bits": 12, "dac.bits": 12}),
    "direct_steps": Variant(
        {
            **_SMALL,
            "timing": {**_TIMING, "lines": 40},
            "x.table": {"mode": "direct", "bits": 16},
            "y.table": {"mode": "direct", "bits": 8},
            "y.motion": "step",
            "y.size_nm": 50.0,
        }
    ),
    "inverting": Variant({**_SMALL, "dac.coding": "twos-complement", "amplifier.gain": -10.0}),
}

FEW = ("short", "bits_18")


@dataclass(frozen=True, eq=False)
class Formatted:
    """A build in some formats, in memory and on disk."""

    folder: Path
    files: dict[str, bytes]

    @property
    def manifest(self) -> dict[str, Any]:
        """The manifest, read again from its bytes."""
        content: dict[str, Any] = json.loads(self.files["manifest.json"])
        return content

    def file(self, ending: str) -> bytes:
        """The file whose name is the scan's and this."""
        return self.files[f"{NAME}{ending}"]


@cache
def _planned(folder: Path, name: str) -> tuple[Plan, dict[str, Certificate]]:
    plan = make_plan(load(write_variant(folder / name, BUILDS[name])))
    return plan, certify(plan)


def formatted(folder: Path, name: str, *formats: str) -> Formatted:
    """One of ``BUILDS`` in some formats, without limits."""
    plan, certificates = _planned(folder, name)
    files = render(plan, certificates, formats)
    out = folder / "-".join((name, *formats))
    write_files(out, files)
    return Formatted(out, files)


def flipped(content: bytes, at: float) -> bytes:
    """A file with one digit, or in a binary file one bit, changed near a part of its length."""
    changed, place = bytearray(content), int(at * len(content))
    if content.isascii():
        digits = [i for i, code in enumerate(content) if chr(code).isdigit()]
        place = next((i for i in digits if i >= place), digits[-1])
    changed[place] ^= 1
    return bytes(changed)


def replace_file(folder: Path, name: str, content: bytes) -> None:
    """Write another file of a build, and its hash into the manifest."""
    (folder / name).write_bytes(content)
    manifest = json.loads((folder / "manifest.json").read_bytes())
    manifest["files"][name] = sha256(content).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest), "ascii")


def check_finds_a_flip(built: Formatted, format_name: str, names: Sequence[str]) -> None:
    """``verify`` finds one word of each file changed although the manifest's hashes are right again."""
    assert run("verify", "--target", "files", built.folder).status == 0
    for name in names:
        whole = built.files[name]
        try:
            replace_file(built.folder, name, flipped(whole, 0.6))
            outcome = run("verify", "--target", "files", built.folder)
            assert outcome.status == 5, name
            (told,) = [line for line in outcome.messages if name in line]
            assert told.startswith(f"{format_name} files: {name}: "), told
            assert "manifest" in told
        finally:
            (built.folder / name).write_bytes(whole)
            (built.folder / "manifest.json").write_bytes(built.files["manifest.json"])
    if not names:
        pytest.fail("there is nothing to change")


def little_endian(words: Sequence[int], bits: int) -> bytes:
    """Words in whole bytes, 1, 2 or 4, sign-extended, the least significant byte first."""
    size = next(size for size in (1, 2, 4) if 8 * size >= bits)
    return b"".join((word % 2 ** (8 * size)).to_bytes(size, "little") for word in words)
