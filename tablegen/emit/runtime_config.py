"""The options of one C runtime that plays several builds: the highest that any of them needs."""

from collections.abc import Mapping
from pathlib import Path

from tablegen.base.reading import MANIFEST as MANIFEST_KIND
from tablegen.base.reading import read_bytes
from tablegen.emit.c_text import option_lines
from tablegen.emit.formats.c import runtime_options
from tablegen.emit.stored import stored_content
from tablegen.emit.turned import turned_options
from tablegen.manifest.format import MANIFEST
from tablegen.manifest.read import DamagedManifest, ForeignManifest, NotABuild
from tablegen.manifest.turned import StoredTurned, parse_any

Options = dict[str, int]


def options_of_builds(folders: list[Path]) -> dict[str, Options]:
    """Read the options that each build needs from its manifest.

    Parameters
    ----------
    folders
        Directories of builds, at an angle or not, each of which has the format ``c``.

    Returns
    -------
    dict
        The options ``DAC_...`` of each build, by the name of its scan.

    Raises
    ------
    NotABuild
        A directory holds no build, or one without C, or two have scans of the same name.
    """
    places: dict[str, Path] = {}
    needed: dict[str, Options] = {}
    for folder in folders:
        name, options = _options(folder)
        if name in places:
            raise NotABuild(
                f"{folder}: its scan has the name {name!r}, as that of {places[name]}; names of files and of objects "
                "begin with it, so give one of them another name"
            )
        places[name], needed[name] = folder, options
    return needed


def highest_options(needed: Mapping[str, Options]) -> Options:
    """Return the options of a runtime that plays every one of these scans."""
    highest: Options = {}
    for options in needed.values():
        for key, value in options.items():
            highest[key] = max(value, highest.get(key, value))
    return highest


def config_header(needed: Mapping[str, Options]) -> bytes:
    """Write the options of a runtime that plays every one of these scans, for ``DAC_CONFIG_FILE``."""
    lines = [
        "/* The options of one runtime that plays all of these scans. Do not edit; run tablegen runtime again.",
        " *",
        *(f" * {name}: {_told(options)}" for name, options in needed.items()),
        " *",
        " * All files are compiled with -DDAC_CONFIG_FILE naming this header, which dac_config.h then includes.",
        " */",
        *option_lines(highest_options(needed)),
    ]
    return ("\n".join(lines) + "\n").encode("ascii")


def _told(options: Options) -> str:
    """Return options on one line of a comment."""
    return ", ".join(f"{key.removeprefix('DAC_')} {value}" for key, value in options.items())


def _options(folder: Path) -> tuple[str, Options]:
    """Return the name of a build's scan, and the options that it needs."""
    path = folder / MANIFEST
    try:
        stored = parse_any(read_bytes(path, MANIFEST_KIND))
    except OSError as error:
        raise NotABuild(
            f"{path}: cannot be read: {error.strerror or error}; the directory is the one of `tablegen build -o DIR`"
        ) from None
    except ForeignManifest:
        raise NotABuild(f"{path}: is not a manifest of tablegen") from None
    except DamagedManifest as damage:
        raise NotABuild("\n".join(f"{path}: is damaged: {why}; build it again" for why in damage.reasons)) from None
    name = stored.manifest.name
    if isinstance(stored, StoredTurned):
        return name, turned_options(stored.program, stored.z)
    if f"{name}.h" not in stored.manifest.files:
        raise NotABuild(f'{folder}: has no C; add "c" to emit.formats of its scan, and build it again')
    return name, runtime_options(stored_content(stored))
