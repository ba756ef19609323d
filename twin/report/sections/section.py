"""What a section of the page is: a heading, a template, and what the template needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from twin.diagnose import Diagnosis


@dataclass(frozen=True)
class Story:
    """What every section may draw on."""

    diagnosis: Diagnosis
    provenance: Mapping[str, Any]


@dataclass(frozen=True)
class Section:
    """One section: anchor, heading, template under `templates/`, and the names the template uses."""

    id: str
    title: str
    template: str
    content: Mapping[str, Any]
