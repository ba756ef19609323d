"""The form of a file's tables: which keys, of which types. All that is wrong with a table is told at once.

pydantic in strict mode checks it: `true` is no number, a number is no text, an unknown key is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, StringConstraints, ValidationError

from twin.errors import did_you_mean, shown


def _printable(text: str) -> str:
    if not (text.strip() and text.isprintable()):
        raise ValueError("one line of text, without control characters")
    return text


Line = Annotated[str, StringConstraints(max_length=500), AfterValidator(_printable)]  # what reports and terminals show


Text = Annotated[str, StringConstraints(max_length=2000)]  # what is shown as it is by nothing but a quoting printer


class Form(BaseModel):
    """A table of a file: every key is declared, everything else is refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


Filled = TypeVar("Filled", bound=Form)


def fill(form: type[Filled], table: object, where: str, problems: list[str]) -> Filled | None:
    """`table` as a `form`, or None with all that is wrong with it added to `problems`; `where` names the table in them."""
    if not isinstance(table, Mapping):
        problems.append(f"{where or 'the file'} is {shown(table)}; a table is needed")
        return None
    try:
        return form.model_validate(dict(table))
    except ValidationError as error:
        problems += [_words(form, where, dict(each)) for each in error.errors(include_url=False)]
        return None


def _words(form: type[Form], where: str, error: dict[str, Any]) -> str:
    """One of pydantic's errors as name of the place, what came, what is needed."""
    path = [
        str(part)
        for part in error["loc"]
        if isinstance(part, int) or part in form.model_fields or error["type"] == "extra_forbidden"
    ]
    key = ".".join(path) or "it"
    place = f"{where}: {key}" if where else key
    if error["type"] == "missing":
        return f"{place} is missing"
    if error["type"] == "extra_forbidden":
        known = list(form.model_fields)
        return f"{where + ': ' if where else ''}no key {shown(key)} is known{did_you_mean(key, known)}; allowed: {', '.join(known)}"
    needed = error["msg"].removeprefix("Value error, ").replace("Input should be ", "").replace("Input ", "")
    return f"{place} is {shown(error['input'])}; needed: {needed}"
