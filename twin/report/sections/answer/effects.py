"""The missing effects: parameters, probability, and the error without each."""

import sys

from twin.diagnosis import Claim
from twin.effects import effect_class
from twin.foundation.display_names import display_name
from twin.report.numbers import DISPLAY_UNITS, capitalised, format_column, format_percent, format_with_error
from twin.report.sections.section import Section, Story
from twin.report.sentence import explained_share, headline_group


def section(story: Story) -> Section:
    """Return the section on the missing effects."""
    d = story.diagnosis
    share = explained_share(d)
    return Section(
        "effects",
        "Missing effects" if len(d.claims) != 1 else "Missing effect",
        "answer/effects.html",
        {
            "effects": effect_rows(d.claims, headline_group(d)),
            "unit": DISPLAY_UNITS[headline_group(d)][0],
            "verdict": d.verdict,
            "before": f"{d.structure_before:.2f}",
            "after": f"{d.structure_after:.2f}",
            "share": format_percent(share) if share is not None and d.claims else None,
        },
    )


def effect_rows(claims: tuple[Claim, ...], group: str) -> list[dict[str, object]]:
    """Return a row for each effect; errors with equal decimals."""
    errors = format_column([DISPLAY_UNITS[group][1] * c.error for c in claims])
    moved = format_column([c.contribution for c in claims])
    return [
        {
            "name": display_name(c.effect),
            "law": _law_sentence(c.effect),
            "parameters": [{"name": n, "value": format_with_error(f)} for n, f in c.parameters.items()],
            "probability": format_percent(c.probability),
            "error": error,
            "moved": sigma,
        }
        for c, error, sigma in zip(claims, errors, moved, strict=True)
    ]


def _law_sentence(identifier: str) -> str:
    """Return the first line of the docstring of the effect's module, after "Name: "."""
    first = (sys.modules[effect_class(identifier).__module__].__doc__ or "").strip().partition("\n")[0]
    return capitalised(first.partition(": ")[2] or first)
