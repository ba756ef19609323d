"""The effects found missing: parameters, how sure, and what each is worth on its own."""

from __future__ import annotations

import sys

from twin.diagnose import Claim
from twin.effects import named
from twin.report.numbers import SHOWN, column, percent, plus_minus, upper_first
from twin.report.sections.section import Section, Story
from twin.report.sentence import explained_share, headline
from twin.wording import in_words


def section(story: Story) -> Section:
    d = story.diagnosis
    share = explained_share(d)
    return Section(
        "effects",
        "Missing effects" if len(d.claims) != 1 else "Missing effect",
        "effects.html",
        {
            "effects": table(d.claims, headline(d)),
            "unit": SHOWN[headline(d)][0],
            "verdict": d.verdict,
            "before": f"{d.structure_before:.2f}",
            "after": f"{d.structure_after:.2f}",
            "share": percent(share) if share is not None and d.claims else None,
        },
    )


def table(claims: tuple[Claim, ...], group: str) -> list[dict[str, object]]:
    """Rows of effects in words; errors with common decimals."""
    errors = column([SHOWN[group][1] * c.error for c in claims])
    moved = column([c.contribution for c in claims])
    return [
        {
            "name": in_words(c.effect),
            "law": _in_words(c.effect),
            "parameters": [{"name": n, "value": plus_minus(f)} for n, f in c.parameters.items()],
            "probability": percent(c.probability),
            "error": error,
            "moved": sigma,
        }
        for c, error, sigma in zip(claims, errors, moved, strict=True)
    ]


def _in_words(identifier: str) -> str:
    """What the law is, as the first line of its file says it: "Name: what happens." """
    first = (sys.modules[named(identifier).__module__].__doc__ or "").strip().partition("\n")[0]
    return upper_first(first.partition(": ")[2] or first)
