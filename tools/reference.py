"""Makes models/README.md, the reference of the three files people write, from the schemas that check them.

python -m tools.reference
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from twin.forms import Form
from twin.measurements.channels import KINDS
from twin.measurements.conditions import SCALARS, VECTORS
from twin.measurements.read import ChannelTable, SetFile
from twin.robots.family import families, family
from twin.robots.robot import RobotFile
from twin.robots.schema import ROOM, Row, Schema
from twin.storage import TwinFile
from twin.units import EXAMPLES

PAGE = Path(__file__).resolve().parent.parent / "models" / "README.md"

HEAD = """\
# What the files say

Made by `python -m tools.reference` from the schemas that check the files; do not edit it.

Anything that is not on this page is refused, with all that is wrong in one message. `twin new NAME --family FAMILY` writes a folder
to begin with, `twin robots FOLDER` draws it. A robot is named by its name, if it ships with the twin, or by the path to its folder:
on the command line from where you are, in a file from that file's folder.

Units are any of the right dimension ("mm", "inch"; an angle needs an angle's unit, temperatures may be in degC or degF). Values are
numbers, not text; `true` is no number.
"""


def main() -> None:
    PAGE.write_text(page(), "utf-8")


def page() -> str:
    """The whole page."""
    parts = [HEAD, _robot(), *(_family(name, family(name).SCHEMA) for name in families()), _set(), _twin()]
    return "\n".join(parts)


def _robot() -> str:
    entry = f"""
Each number is an entry `"name" = {{ value = ..., unit = "...", source = "..." }}`:

| key | meaning |
|---|---|
| `value` | a list with one number for each (disk, tendon, ...), fitted one by one; or one for all, fitted as one |
| `unit` | the unit of `value`, `std`, `low` and `high` |
| `source` | where the number comes from |
| `std` | one standard deviation of what a built robot may differ by; such numbers are fitted to data. Left out: exact |
| `low`, `high` | hard bounds of a fit. Left out: {ROOM:g} `std` to either side, within the range below |
"""
    return "\n## robot.toml\n\n" + _keys(RobotFile) + entry


def _family(name: str, schema: Schema) -> str:
    out = [f'\n### family = "{name}"\n', "```", schema.picture.rstrip("\n"), "```", "", "[structure]", "", _keys(schema.structure)]
    out += ["[parameters]", "", "| name | unit | one | range | default | of | meaning |", "|---|---|---|---|---|---|---|"]
    out += [_row(row) for row in (*schema.rows, schema.accuracy)]
    if any(row.group for row in schema.rows):
        out += ["", "Parameters of one group (springs) are all written, or none."]
    return "\n".join(out) + "\n"


def _row(row: Row) -> str:
    one = " and ".join(f"for each {kind}" for kind in row.shape) + (", or for all" if row.shape and row.for_all else "")
    if row.stated:
        default = "not checked"
    elif row.default is not None:
        default = f"{row.default:g}"
    else:
        default = f"none ({row.group})" if row.group else "required"
    kinds = ", ".join(f"`{kind}`" for kind in sorted(row.only)) or "all"
    name = f"`[{row.name}]`" if row.name == "accuracy" else f"`{row.name}`"
    return f"| {name} | {row.usual} | {one or 'number'} | {row.range()} | {default} | {kinds} | {row.meaning} |"


def _set() -> str:
    units = [f"| `{pattern}` | {EXAMPLES.get(unit, unit)} |" for pattern, unit in KINDS.values()]
    known = [f'| `{name}` | text with a unit, such as "10 {EXAMPLES[unit].split(", ")[-1]}" |' for name, unit in SCALARS.items()]
    known += [f"| `{name}` | [x, y, z] in {unit}, base frame |" for name, unit in VECTORS.items()]
    return "\n".join(
        [
            "\n## measurements.toml\n", _keys(SetFile), "[[channel]]", "", _keys(ChannelTable),
            "A name is one of these, # an index from 1, base to tip, @ one of x, y, z; in a hand each begins with finger_#_:", "",
            "| name | units like |", "|---|---|", *units, "",
            "A tension is that at the base, above zero; a displacement is above zero where the tendon is pulled in.", "",
            "[[trial]]", "", "| key | value |", "|---|---|",
            "| `file` | a CSV or Parquet file in the set's folder: a column `time` in seconds, rising, and one a channel |",
            "| `start` | s since the first trial; needed for what drifts from trial to trial |",
            "| `cloud` | an NPZ of points (M, 3) m, offsets (F + 1,), time (F,) s |", *known,
            "| any other name | a condition of your own: kept, reported, not acted on |", "",
        ]
    )  # fmt: skip


def _twin() -> str:
    text = """
A parameter is a number in SI, or `{ value = ..., unit = "...", std = ... }`; `std` is its standard error, for people; in a
robot's file what is believed of it, and it is fitted with the robot's own. An effect is
`id` and `parameters`; `twin effects` lists them.
"""
    return "\n## twin.toml\n\n" + _keys(TwinFile) + text


def _keys(form: type[Form]) -> str:
    lines = ["| key | what | default | meaning |", "|---|---|---|---|"]
    lines += [
        f"| `{name}` | {_what(field)} | {_default(field)} | {field.description or ''} |"
        for name, field in form.model_fields.items()
    ]
    return "\n".join(lines) + "\n"


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined:
        return "required"
    return (
        ""
        if field.default in (None, [], {})
        else f"`{str(field.default).lower() if isinstance(field.default, bool) else field.default}`"
    )


def _what(field: FieldInfo) -> str:
    """A field's type in words."""
    text = str(field.annotation)
    words: list[str] = []
    for found, word in (
        ("bool", "true or false"),
        ("dict", "table"),
        ("list", "list"),
        ("int", "whole number"),
        ("str", "text"),
    ):
        if found in text:
            words.append("whole number or list" if word == "list" and not text.startswith("list") else word)
            break
    if "Literal" in text:
        choices: Any = field.annotation
        options = [a for a in getattr(choices, "__args__", ()) if isinstance(a, str | int)]
        words = [", ".join(f"`{o!r}`".replace("'", '"') for o in options)] if options else ["text or list"]
    low = next((m.ge for m in field.metadata if hasattr(m, "ge")), None)
    high = next((m.le for m in field.metadata if hasattr(m, "le")), None)
    span = f", {low} to {high}" if low is not None else ""
    return (words[0] if words else "as below") + span


if __name__ == "__main__":
    main()
