"""Many scans of one scan file: its ``[[scans]]``, and every combination of the values of swept keys."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import msgspec

from tablegen.base.input_errors import Document, Problem, Rejected
from tablegen.config.image_keys import IMAGES, OFFSETS, RATES, SIZES
from tablegen.config.load import Scanners, Setup, assemble_setup, read_scan_file
from tablegen.config.names import why_not_a_name
from tablegen.config.schema import MAXIMUM_NAME
from tablegen.config.settings import MOST_VALUES, Setting, check_repeated_keys


class VariedDocument(Document, frozen=True):
    """A scan file of which some keys were set elsewhere: ``set_by`` has the origin by key."""

    set_by: Mapping[str, str] = msgspec.field(default_factory=dict)

    def problem(self, key: str, why: str) -> Problem:
        """Return a problem of a key, at the option that set it or in the file."""
        problem = super().problem(key, why)
        written = self.inherited.get(problem.key, problem.key)
        for known, origin in self.set_by.items():
            if written == known or written.startswith((f"{known}.", f"{known}[")):
                return problem._replace(file=origin, line=0)
        return problem


@dataclass(frozen=True, repr=False)
class Variant:
    """One scan of many: its name, its differences, and the values of the whole scan file."""

    name: str
    settings: dict[str, Any]
    """The differences from the file, by key: the keys of its ``[[scans]]`` and those that were set."""
    path: Path
    values: dict[str, Any]
    file: VariedDocument
    scanners: Scanners = field(repr=False, compare=False)

    @property
    def setup(self) -> Setup:
        """The setup that can be planned and built.

        Raises
        ------
        Rejected
            With every fault of this scan.
        """
        return assemble_setup(self.path, self.values, self.file, self.scanners)

    def __repr__(self) -> str:
        text = ", ".join(f"{key} = {value}" for key, value in self.settings.items())
        return f"<tablegen variant {self.name!r}: {text or 'as the file has it'}>"


def variants(
    path: str | Path, settings: "Mapping[str, Iterable[Any]] | Sequence[Setting]" = ()
) -> "tuple[str, list[Variant]]":
    """Return the name of the library, and its scans: those of ``[[scans]]`` with each combination of the settings.

    The last setting runs fastest. A name is that of the entry and the values that were set, or a number where that is
    too long.

    Raises
    ------
    Rejected
        If the file cannot be read, or names are invalid or equal.
    """
    path = Path(path)
    swept = _chosen(settings)
    check_repeated_keys(swept)
    if names := [setting for setting in swept if setting.parts[0] in ("name", "scans")]:
        why = f"{names[0].key} is not set: names follow from what is, or stand in [[scans]]"
        raise Rejected([Problem(names[0].origin, 0, "", why)])
    values, file = read_scan_file(path)
    library = values.get("name")
    if not isinstance(library, str) or why_not_a_name(library) or len(library) > MAXIMUM_NAME:
        why = "missing; it names the library" if library is None else "is no name; it names the library"
        raise Rejected([file.problem("name", why)])
    entries = _entries(values.pop("scans", None), file)
    total = max(len(entries), 1)
    for setting in swept:
        total *= len(setting.values)
    if total > MOST_VALUES:
        raise Rejected([file.problem("", f"{total} scans; one sweep takes at most {MOST_VALUES}")])
    scans: list[Variant] = []
    labels, scanners = _labels(swept), Scanners()
    set_by = {setting.key: setting.origin for setting in swept}
    for entry, base, lines, differs in _bases(entries, values, file):
        for combination in product(*(setting.values for setting in swept)):
            swept_values: dict[str, Any] = {}
            settings_of_scan = dict(differs)
            for setting, value in zip(swept, combination, strict=True):
                swept_values = _merged(swept_values, _nested(setting.parts, value))
                settings_of_scan[setting.key] = value
            own = _over(base, swept_values)
            name = _name(entry or library, list(zip(labels, combination, strict=True)), len(scans), total)
            own = {**own, "name": name}
            scans.append(
                Variant(name, settings_of_scan, path, own, VariedDocument(file.name, lines, set_by=set_by), scanners)
            )
    _refuse_clashes(scans, library)
    return library, scans


def _chosen(settings: "Mapping[str, Iterable[Any]] | Sequence[Setting]") -> list[Setting]:
    if not isinstance(settings, Mapping):
        return list(settings)
    if texts := [key for key, values in settings.items() if isinstance(values, str)]:
        raise TypeError(f"{texts[0]}: give the values as a list, [{settings[texts[0]]!r}]")
    return [
        Setting(key, tuple(value.item() if hasattr(value, "item") else value for value in values), "settings")
        for key, values in settings.items()
    ]


def _entries(scans: Any, file: Document) -> list[dict[str, Any]]:
    """Return the tables of ``[[scans]]``; an empty list where there are none."""
    if scans is None:
        return []
    if not isinstance(scans, list) or not scans or not all(isinstance(entry, dict) for entry in scans):
        raise Rejected([file.problem("scans", "is not an array of tables; write [[scans]] above each scan")])
    problems = []
    for at, entry in enumerate(scans):
        if not isinstance(entry.get("name"), str):
            problems.append(file.problem(f"scans[{at}]", "name is missing; each scan of a library has its own"))
        if "scans" in entry:
            problems.append(file.problem(f"scans[{at}].scans", "a scan of a library holds no others"))
    if problems:
        raise Rejected(problems)
    return scans


def _bases(
    entries: Sequence[dict[str, Any]], values: dict[str, Any], file: Document
) -> "Iterator[tuple[str | None, dict[str, Any], dict[str, int], dict[str, Any]]]":
    """Yield each scan of the file before anything is set: name, values, the lines of its keys, and differences."""
    lines = dict(file.lines or {})
    if not entries:
        yield None, values, lines, {}
    for at, entry in enumerate(entries):
        prefix = f"scans[{at}]."
        own = {key.removeprefix(prefix): line for key, line in lines.items() if key.startswith(prefix)}
        differs = {key: value for key, value in _flat(entry) if key != "name"}
        yield entry["name"], _over(values, entry), {**lines, **own}, differs


def _alternatives() -> dict[str, list[str]]:
    """Return the alternatives of each key: setting the one removes the others from the file."""
    sizes = {axis: [f"{axis}.{name}" for name in SIZES] for axis in ("x", "y")}
    groups = [sizes["x"], sizes["y"], list(IMAGES)]
    groups += [[f"{axis}.{name}" for name in OFFSETS] for axis in ("x", "y")]
    groups += [[f"{axis}.band_limit.{name}" for name in ("harmonics", "cutoff_hz")] for axis in ("x", "y")]
    groups += [[f"timing.{name}" for name in names] for names in (RATES, ("lines", "image_lines"))]
    groups += [["timing.ticks_per_line", "timing.ticks_per_pixel"]]
    others_of = {key: [other for other in group if other != key] for group in groups for key in group}
    for image in IMAGES:
        others_of[image] += [*sizes["x"], *sizes["y"]]
    for size in [*sizes["x"], *sizes["y"]]:
        others_of[size] += IMAGES
    return others_of


_ALTERNATIVES = _alternatives()


def other_settings(settings: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings with others in place of their own and of their alternatives, such as ``x.offset_v``."""
    replaced = {other for key in more for other in _ALTERNATIVES.get(key, ())}
    return {key: value for key, value in settings.items() if key not in replaced} | dict(more)


def _over(values: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with others over them, without the alternatives of these."""
    set_keys = {key for key, _ in _flat(more)}
    for key in set_keys:
        for other in _ALTERNATIVES.get(key, ()):
            if other not in set_keys:
                values = _without(values, other.split("."))
    return _merged(values, more)


def _without(values: Mapping[str, Any], parts: Sequence[str]) -> Mapping[str, Any]:
    first, *rest = parts
    inner = values.get(first)
    if first not in values or (rest and not isinstance(inner, Mapping)):
        return values
    if not rest:
        return {key: value for key, value in values.items() if key != first}
    assert isinstance(inner, Mapping)
    return {**values, first: _without(inner, rest)}


def _merged(values: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with others over them, table by table; the arguments are not changed."""
    merged = dict(values)
    for key, value in more.items():
        before = merged.get(key)
        merged[key] = _merged(before, value) if isinstance(before, Mapping) and isinstance(value, Mapping) else value
    return merged


def _nested(parts: Sequence[str], value: Any) -> dict[str, Any]:
    for part in reversed(parts):
        value = {part: value}
    nested: dict[str, Any] = value
    return nested


def _flat(values: Mapping[str, Any], prefix: str = "") -> "Iterator[tuple[str, Any]]":
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _labels(settings: Sequence[Setting]) -> list[str]:
    """Return the label of each key in names: its last part, or all parts where two keys end alike."""
    last = [setting.parts[-1] for setting in settings]
    return [
        setting.parts[-1] if last.count(setting.parts[-1]) == 1 else "_".join(setting.parts) for setting in settings
    ]


def _name(base: str, labelled: "Sequence[tuple[str, Any]]", number: int, total: int) -> str:
    parts = [base]
    for label, value in labelled:
        parts += [label, _spelt(value)]
    name = re.sub(r"_+", "_", "_".join(part.strip("_") for part in parts if part.strip("_")))
    if len(name) <= MAXIMUM_NAME:
        return name
    digits = f"_{number:0{len(str(total - 1))}d}"
    return base[: MAXIMUM_NAME - len(digits)].rstrip("_") + digits


def _spelt(value: Any) -> str:
    """Return a value as a part of an identifier: 1.5 is 1p5, -2 is m2, texts keep their letters and digits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        short = repr(value).removesuffix(".0")
        return short.replace("e-", "em").replace("e+", "e").replace("-", "m").replace(".", "p")
    return re.sub(r"[^A-Za-z0-9]+", "_", str(value))


def _refuse_clashes(scans: Sequence[Variant], library: str) -> None:
    """Refuse names that files or identifiers cannot have, or that two scans share on some disk."""
    problems = []
    spellings: dict[str, str] = {}
    for variant in scans:
        if why := why_not_a_name(variant.name):
            problems.append(variant.file.problem("name", why))
        if variant.name.lower() == f"{library}_library".lower():
            problems.append(variant.file.problem("name", f"{variant.name!r} is the name of the index"))
        other = spellings.setdefault(variant.name.lower(), variant.name)
        if spellings[variant.name.lower()] is not variant.name:
            alike = "is the name of two scans" if other == variant.name else f"and {other!r} are one name on some disks"
            problems.append(variant.file.problem("name", f"{variant.name!r} {alike}"))
    if problems:
        raise Rejected(problems)
