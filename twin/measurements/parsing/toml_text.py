"""Writing of plain values as TOML text; Python's tomllib only reads."""

import json
import math
import re
from collections.abc import Mapping
from datetime import date, datetime, time

from twin.foundation.errors import DataError

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def toml_value(value: object) -> str:
    """Return a value as TOML on one line. Raises DataError for a type that TOML does not have."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(float(value)) if math.isfinite(value) else str(float(value))
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(each) for each in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(name)} = {toml_value(each)}" for name, each in value.items()) + "}"
    raise DataError(f"{type(value).__name__} {value!r} cannot be written as TOML; use numbers, text, lists or tables")


def toml_lines(values: Mapping[str, object]) -> list[str]:
    """Return `key = value` lines, without the values that are None."""
    return [f"{_key(name)} = {toml_value(value)}" for name, value in values.items() if value is not None]


def _key(name: str) -> str:
    return name if _BARE_KEY.fullmatch(name) else toml_value(name)
