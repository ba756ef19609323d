"""The remaining error in words, and what its smooth part varies with."""

from twin.diagnosis.evidence.discrepancy import IN_WORDS
from twin.report.numbers import format_column
from twin.report.sections.section import Section, Story
from twin.report.sentence import remaining_structure


def section(story: Story) -> Section:
    """Return the section on the remaining error."""
    d = story.diagnosis
    parts = sorted(d.structure.items(), key=lambda item: -item[1])
    sizes = format_column([size for _, size in parts], 2)
    strongest = d.strongest if remaining_structure(d) else ()
    weights = format_column([size for _, size in strongest], 2)
    return Section(
        "left",
        "Remaining error",
        "answer/leftover.html",
        {
            "left": remaining_structure(d),
            "description": d.description,
            "worst": d.worst_channel,
            "components": [{"name": IN_WORDS.get(c, c), "size": s} for (c, _), s in zip(parts, sizes, strict=True)],
            "strongest": [{"name": n, "size": s} for (n, _), s in zip(strongest, weights, strict=True)],
        },
    )
