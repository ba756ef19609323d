"""The reference of the three files people write, from the schemas that check them: a page of the documentation site."""

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from tools.benchmarks.table import markdown
from twin.foundation.file_schema import TableSchema
from twin.foundation.units import UNIT_EXAMPLES
from twin.measurements.channels import CHANNEL_KINDS, readable
from twin.measurements.conditions import SCALAR_CONDITIONS, VECTOR_CONDITIONS
from twin.measurements.read import ChannelTable, SetFile
from twin.prediction.twin_file.storage import TwinFile
from twin.robots.family import family_names, load_family
from twin.robots.robot import RobotFile
from twin.robots.schema import BOUND_STDS, Row, Schema

HEAD = """\
# Reference of the files

Anything that is not on this page is refused; one message lists all faults. `twin new NAME --family FAMILY` writes a folder to
begin with, `twin robots FOLDER` draws it. A robot that ships with the twin goes by its name, another by the path to its folder:
relative to the working folder on the command line, relative to the file's folder in a file.

Units may be any of the right dimension ("mm", "inch"; an angle needs an angle's unit, temperatures may be in degC or degF).
Values are numbers, not text; `true` is no number.
"""


def page() -> str:
    """Return the whole page."""
    parts = [HEAD, _robot(), *(_family(name, load_family(name).SCHEMA) for name in family_names()), _set(), _twin()]
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
| `low`, `high` | hard bounds of a fit. Left out: {BOUND_STDS:g} `std` to either side, within the range below |
"""
    return "\n## robot.toml\n\n" + _keys(RobotFile) + entry


def _family(name: str, schema: Schema) -> str:
    out = [f'\n### family = "{name}"\n', "```", schema.diagram.rstrip("\n"), "```", "", "[structure]", "", _keys(schema.structure)]
    out += ["[parameters]", "", "| name | unit | one | range | default | of | meaning |", "|---|---|---|---|---|---|---|"]
    out += [_row(row) for row in (*schema.rows, schema.accuracy)]
    if any(row.group for row in schema.rows):
        out += ["", "Parameters of one group (springs) are all written, or none."]
    return "\n".join(out) + "\n"


def _row(row: Row) -> str:
    one = " and ".join(f"for each {kind}" for kind in row.shape) + (", or for all" if row.shape and row.one_for_all else "")
    if row.checked_only:
        default = "not checked"
    elif row.default is not None:
        default = f"{row.default:g}"
    else:
        default = f"none ({row.group})" if row.group else "required"
    kinds = ", ".join(f"`{kind}`" for kind in sorted(row.for_kinds)) or "all"
    name = f"`[{row.name}]`" if row.name == "accuracy" else f"`{row.name}`"
    return f"| {name} | {row.usual_unit} | {one or 'number'} | {row.range_text()} | {default} | {kinds} | {row.meaning} |"


def _set() -> str:
    units = [f"| `{readable(pattern)}` | {UNIT_EXAMPLES.get(unit, unit)} |" for pattern, unit in CHANNEL_KINDS.values()]
    scalars = {name: UNIT_EXAMPLES[unit].split(", ")[-1] for name, unit in SCALAR_CONDITIONS.items()}
    known = [f'| `{name}` | text with a unit, such as "10 {unit}" |' for name, unit in scalars.items()]
    known += [f"| `{name}` | [x, y, z] in {unit}, base frame |" for name, unit in VECTOR_CONDITIONS.items()]
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
A parameter is a number in SI, or `{ value = ..., unit = "...", std = ... }`. In twin.toml `std` is its standard error, for
information; in a robot's file it is the prior standard deviation, and the parameter is fitted with the robot's own. An effect is
`id` and `parameters`; `twin effects` lists them.
"""
    return "\n## twin.toml\n\n" + _keys(TwinFile) + text


def _keys(form: type[TableSchema]) -> str:
    rows = [(f"`{name}`", _what(f), _default(f), f.description or "") for name, f in form.model_fields.items()]
    return markdown(("key", "what", "default", "meaning"), rows) + "\n"


def _default(field: FieldInfo) -> str:
    value = field.default
    if value is PydanticUndefined:
        return "required"
    return "" if value in (None, [], {}) else f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _what(field: FieldInfo) -> str:
    """A field's type in words."""
    text, kinds = (
        str(field.annotation),
        {"bool": "true or false", "dict": "table", "list": "list", "int": "whole number", "str": "text"},
    )
    word = next((words for kind, words in kinds.items() if kind in text), "as below")
    if word == "list" and not text.startswith("list"):
        word = "whole number or list"
    if "Literal" in text:
        options = [a for a in getattr(field.annotation, "__args__", ()) if isinstance(a, str | int)]
        word = ", ".join(f"`{o!r}`".replace("'", '"') for o in options) or "text or list"
    low = next((m.ge for m in field.metadata if hasattr(m, "ge")), None)
    high = next((m.le for m in field.metadata if hasattr(m, "le")), None)
    return word + (f", {low} to {high}" if low is not None else "")
