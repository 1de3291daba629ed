"""A crate of Rust without the standard library, whose build compiles the files of the format c."""

from pathlib import Path

from tablegen.base.resources import resource_folder
from tablegen.emit.c_text import literal
from tablegen.emit.constants import is_wide
from tablegen.emit.package import CPackage
from tablegen.emit.package_format import PackageOfC
from tablegen.emit.templates import template

# Of a sequencer on a machine of 64 bits with all options: 768 bytes, 1008 with a slow part. The bridge does not compile
# in less.
_ROOM_BYTES, _ROOM_BYTES_WITH_SLOW_PART = 768, 1024


class Cargo(PackageOfC):
    """The format cargo: ``Cargo.toml``, ``lib.rs`` and ``build.rs`` make the folder of a build a crate.

    The files stand beside the C and not in ``src``: a folder of that name would be all that Arduino compiles.
    """

    name = "cargo"
    purpose = "crate of Rust (no_std) around the format c: the folder of the build, as a dependency with a path"
    file_names = "Cargo.toml, lib.rs, build.rs"

    def package_files(self, package: CPackage) -> dict[str, bytes]:
        """Render the manifest of the crate, its interface, and the program that compiles the C files."""
        context = _context(package)
        return {
            "Cargo.toml": _manifest(package),
            "lib.rs": template("cargo/lib.rs.j2", context, literal),
            "build.rs": template("cargo/build.rs.j2", context, literal),
        }

    def sources(self) -> list[Path]:
        """Return the templates."""
        return list((resource_folder("firmware_templates") / "cargo").glob("*.j2"))


FORMAT = Cargo()


def _crate(package: CPackage) -> str:
    """Return the name of the crate; with ``tablegen_`` before it, no scan has that of a keyword or of ``core``."""
    return f"tablegen_{package.name}"


def _manifest(package: CPackage) -> bytes:
    """Return ``Cargo.toml``; ``links`` lets Cargo refuse a second sequencer before the linker does."""
    names = ["Cargo.toml", "lib.rs", "build.rs", *package.files]
    lines = [
        "[package]",
        f'name = "{_crate(package)}"',
        f'version = "{package.version}"',
        'edition = "2021"',
        'rust-version = "1.63"',
        f'description = "Scan {package.name}, played by its sequencer. Build {package.hash}"',
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


def _context(package: CPackage) -> dict[str, object]:
    """Return the variables of both templates."""
    options, names = package.options, package.files
    return {
        "version": package.version,
        "name": package.name,
        "NAME": package.name.upper(),
        "crate": _crate(package),
        "hash": package.hash,
        "header_only": package.header_only,
        "sequencers": [("", package.name), *([("_z", f"{package.name}_z")] if package.with_z else [])],
        "with_z": package.with_z,
        "sources": [name for name in names if name.endswith(".c")],
        "headers": [name for name in names if name.endswith(".h")],
        "options": list(options.items()),
        "word_bytes": options["DAC_OUTPUT_STORAGE_BITS"] // 8,
        "room": _ROOM_BYTES_WITH_SLOW_PART if "DAC_SLOW_PART" in options else _ROOM_BYTES,
        "constants": [(key, value, is_wide(key)) for key, value in package.constants.items()],
    }
