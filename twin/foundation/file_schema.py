"""Schemas of a file's tables: which keys they have, of which types. All problems of a table are reported together.

pydantic checks them in strict mode: `true` is not a number, a number is not text, an unknown key is refused.
"""

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, StringConstraints, ValidationError

from twin.foundation.errors import did_you_mean, short_repr


def _check_printable(text: str) -> str:
    if not (text.strip() and text.isprintable()):
        raise ValueError("one line of text, without control characters")
    return text


TextLine = Annotated[str, StringConstraints(max_length=500), AfterValidator(_check_printable)]  # safe to print


Text = Annotated[str, StringConstraints(max_length=2000)]  # may hold control characters: print it quoted only


class TableSchema(BaseModel):
    """A table of a file: every key is declared, all others are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


SchemaT = TypeVar("SchemaT", bound=TableSchema)


def validate_table(schema: type[SchemaT], table: object, where: str, problems: list[str]) -> SchemaT | None:
    """Return `table` as a `schema`, or None with its problems added to `problems`; `where` names the table in them."""
    if not isinstance(table, Mapping):
        problems.append(f"{where or 'the file'} is {short_repr(table)}; a table is needed")
        return None
    try:
        return schema.model_validate(dict(table))
    except ValidationError as error:
        problems += [_describe_fault(schema, where, dict(each)) for each in error.errors(include_url=False)]
        return None


def _describe_fault(schema: type[TableSchema], where: str, error: dict[str, Any]) -> str:
    """Return one of pydantic's errors as: place, value that came, value that is needed."""
    path = [
        str(part)
        for part in error["loc"]
        if isinstance(part, int) or part in schema.model_fields or error["type"] == "extra_forbidden"
    ]
    key = ".".join(path) or "it"
    place = f"{where}: {key}" if where else key
    if error["type"] == "missing":
        return f"{place} is missing"
    if error["type"] == "extra_forbidden":
        known = list(schema.model_fields)
        prefix = f"{where}: " if where else ""
        return f"{prefix}no key {short_repr(key)} is known{did_you_mean(key, known)}; allowed: {', '.join(known)}"
    needed = error["msg"].removeprefix("Value error, ").replace("Input should be ", "").replace("Input ", "")
    return f"{place} is {short_repr(error['input'])}; needed: {needed}"
