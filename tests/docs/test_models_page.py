"""docs/models.md says what the models are."""

import re

import msgspec.inspect as types
from building import HELPERS, REPOSITORY

from tablegen.cli.calibrate.group import calibrate
from tablegen.compensation import models
from tablegen.compensation.identification import Identification
from tablegen.compensation.model import Hysteresis

PAGE = (REPOSITORY / "docs" / "models.md").read_text("utf-8")


def test_the_table_is_what_the_models_say() -> None:
    rows = re.findall(r"^\| `([a-z-]+)` \| (.*?) \| (.*?) \| ?(.*?) ?\|$", PAGE, re.MULTILINE)
    wanted = []
    for kind in models.own():
        described = types.type_info(kind)
        assert isinstance(described, types.StructType)
        keys = ", ".join(f"`{field.encode_name}`" for field in described.fields)
        wanted.append((kind.model(), kind.purpose, keys, kind.calibration))
    assert [row for row in rows if row[0] in models.names()] == wanted


def test_what_measures_them_is_a_command() -> None:
    told = {name for kind in models.own() for name in re.findall(r"`calibrate ([a-z-]+)`", kind.calibration)}
    assert told
    assert told <= set(calibrate.commands)


def test_the_parts_of_a_model_are_documented() -> None:
    for row in re.findall(r"^\| (`[a-z_]+`(?:, `[a-z_]+`)*) \| [^|]* \|$", PAGE, re.MULTILINE):
        for part in re.findall(r"`([a-z_]+)`", row):
            known = hasattr(Hysteresis, part) or hasattr(Identification, part)
            assert known or part in {"tag", *models.names()}, part
    for part in ("contradictions", "faults", "files", "like", "line", "described", "order", "purpose", "calibration"):
        assert f"`{part}`" in PAGE
    for part in (*Identification.__struct_fields__, "piezo", "identified", "operator_file"):
        assert f"| `{part}` |" in PAGE


def test_the_entry_point_in_the_page_is_the_group() -> None:
    assert f'[project.entry-points."{models.GROUP}"]' in PAGE
    assert "class Play(Hysteresis" in (HELPERS / "play_model.py").read_text("utf-8")


def test_the_comment_in_the_example_names_them() -> None:
    scanner = (REPOSITORY / "examples" / "scanner.toml").read_text("utf-8")
    (listed,) = re.findall(r'^model = "harmonic" +# (.*)$', scanner, re.MULTILINE)
    assert sorted(listed.split(" | ")) == models.names()
