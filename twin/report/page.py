"""report.html: one self-contained file. It loads nothing: scripts, styles and figures are inside, and a policy forbids the rest."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from twin.diagnose import Diagnosis
from twin.report.sections import SECTIONS, Story
from twin.report.sentence import sentence

TEMPLATES = Path(__file__).resolve().parent / "templates"


@cache
def environment() -> Environment:
    """Templates with every value escaped; a name a template lacks is an error."""
    return Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )


def page(diagnosis: Diagnosis, provenance: Mapping[str, Any]) -> str:
    """The whole report as HTML."""
    story = Story(diagnosis, provenance)
    recording = diagnosis.bench.recording
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
            robot=diagnosis.bench.robot,
            suspicions=diagnosis.suspicions,
            sentence=sentence(diagnosis),
            verdict=diagnosis.verdict,
            date=provenance.get("date", ""),
            sections=sections,
            plotly=Markup(get_plotlyjs()),
        )
    )
