"""report.html, one self-contained file.

Scripts, styles and figures are inside; a content security policy forbids to load anything else.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from twin.diagnosis import Diagnosis
from twin.foundation.display_names import display_name
from twin.report.sections import SECTIONS, Story
from twin.report.sentence import sentence

TEMPLATES = Path(__file__).resolve().parent / "templates"


@cache
def environment() -> Environment:
    """Return the template environment: every value is escaped, a missing name is an error."""
    return Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )


def page(diagnosis: Diagnosis, provenance: Mapping[str, Any]) -> str:
    """Return the whole report as HTML."""
    story = Story(diagnosis, provenance)
    recording = diagnosis.prepared.recording
    common = {"source": recording.source, "title": recording.title}
    sections = []
    for make in SECTIONS:
        if (section := make(story)) is None:
            continue
        body = environment().get_template(section.template).render({**common, **section.content})
        sections.append({"id": section.id, "title": section.title, "body": Markup(body)})
    return (
        environment()
        .get_template("page.html")
        .render(
            **common,
            robot=diagnosis.prepared.robot,
            suspicions=diagnosis.suspicions,
            sentence=sentence(diagnosis),
            verdict=display_name(diagnosis.verdict),
            date=provenance.get("date", ""),
            sections=sections,
            plotly=Markup(get_plotlyjs()),
        )
    )
