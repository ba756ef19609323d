"""What is left after the verdict, in words, and what its smooth part moves with."""

from __future__ import annotations

from twin.diagnose.evidence import IN_WORDS
from twin.report.numbers import column
from twin.report.sections.section import Section, Story
from twin.report.sentence import structure_left


def section(story: Story) -> Section:
    d = story.diagnosis
    parts = sorted(d.structure.items(), key=lambda item: -item[1])
    sizes = column([size for _, size in parts], 2)
    strongest = d.strongest if structure_left(d) else ()
    weights = column([size for _, size in strongest], 2)
    return Section(
        "left",
        "What is left",
        "leftover.html",
        {
            "left": structure_left(d),
            "description": d.description,
            "worst": d.worst_channel,
            "components": [{"name": IN_WORDS.get(c, c), "size": s} for (c, _), s in zip(parts, sizes, strict=True)],
            "strongest": [{"name": n, "size": s} for (n, _), s in zip(strongest, weights, strict=True)],
        },
    )
