"""A section of the page and its input."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from twin.diagnosis import Diagnosis


@dataclass(frozen=True)
class Story:
    """The input of every section."""

    diagnosis: Diagnosis
    provenance: Mapping[str, Any]


@dataclass(frozen=True)
class Section:
    """One section: anchor, heading, template under `templates/`, and the values for the template."""

    id: str
    title: str
    template: str
    content: Mapping[str, Any]
