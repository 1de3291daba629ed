"""A crate of Rust without the standard library, whose build compiles the files of the format c."""

from pathlib import Path

from tablegen.base.resources import resource_folder
from tablegen.emit.c_text import literal
from tablegen.emit.constants import is_wide, scan_constants
from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.c import packaged_files, runtime_options
from tablegen.emit.templates import template

ROOM_BYTES = 768  # of a sequencer: 712 with all options on a machine of 64 bits; the bridge does not compile in less


class Cargo(Format):
    """The format cargo: ``Cargo.toml``, ``lib.rs`` and ``build.rs`` make the folder of a build a crate.

    The files stand beside the C and not in ``src``: a folder of that name would be all that Arduino compiles.
    """

    name = "cargo"
    purpose = "crate of Rust (no_std) around the format c: the folder of the build, as a dependency with a path"
    file_names = "Cargo.toml, lib.rs, build.rs"
    needs = ("c",)

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the manifest of the crate, its interface, and the program that compiles the C files."""
        context = _context(content)
        return {
            "Cargo.toml": _manifest(content),
            "lib.rs": template("cargo/lib.rs.j2", context, literal),
            "build.rs": template("cargo/build.rs.j2", context, literal),
        }

    def sources(self) -> list[Path]:
        """Return the templates."""
        return list((resource_folder("firmware_templates") / "cargo").glob("*.j2"))


FORMAT = Cargo()


def _crate(content: Content) -> str:
    """Return the name of the crate; with ``tablegen_`` before it, no scan has that of a keyword or of ``core``."""
    return f"tablegen_{content.name}"


def _manifest(content: Content) -> bytes:
    """Return ``Cargo.toml``; ``links`` lets Cargo refuse a second sequencer before the linker does."""
    names = ["Cargo.toml", "lib.rs", "build.rs", *packaged_files(content)]
    lines = [
        "[package]",
        f'name = "{_crate(content)}"',
        f'version = "{content.version}"',
        'edition = "2021"',
        'rust-version = "1.63"',
        f'description = "Scan {content.name}, played by its sequencer. Build {content.hash}"',
        'build = "build.rs"',
        'links = "dac_sequencer"',
        "publish = false",
        "include = [",
        *(f'    "/{name}",' for name in names),
        "]",
        "",
        "[lib]",
        'path = "lib.rs"',
    ]
    return ("\n".join(lines) + "\n").encode("ascii")


def _context(content: Content) -> dict[str, object]:
    """Return the variables of both templates."""
    options, names = runtime_options(content), packaged_files(content)
    return {
        "version": content.version,
        "name": content.name,
        "NAME": content.name.upper(),
        "crate": _crate(content),
        "hash": content.hash,
        "header_only": content.header_only,
        "sources": [name for name in names if name.endswith(".c")],
        "headers": [name for name in names if name.endswith(".h")],
        "options": list(options.items()),
        "word_bytes": options["DAC_OUTPUT_STORAGE_BITS"] // 8,
        "room": ROOM_BYTES,
        "constants": [(key, value, is_wide(key)) for key, value in scan_constants(content).items()],
    }
