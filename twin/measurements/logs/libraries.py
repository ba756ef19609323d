"""Libraries that only logs need, loaded when one is read or written."""

from importlib import import_module
from typing import Any

from twin.foundation.errors import DataError

INSTALL = 'pip install "tendon-twin[logs]"'


def library(module: str, package: str) -> Any:
    """Return a module. Raises DataError with the command that installs it."""
    try:
        return import_module(module)
    except ImportError:
        raise DataError(f"this needs the library {package}, which is not installed: {INSTALL}") from None
