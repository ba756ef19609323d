"""How sure the attribution is: runners-up, what these data cannot tell apart, and what was too small to claim."""

from __future__ import annotations

from twin.diagnose import Claim
from twin.report.numbers import SHOWN, column, percent, plus_minus
from twin.report.sections.section import Section, Story
from twin.report.sentence import headline
from twin.wording import in_words


def section(story: Story) -> Section:
    d = story.diagnosis
    claimed = " and ".join(in_words(c.effect) for c in d.claims) or "no effect"
    return Section(
        "attribution",
        "Runners-up",
        "attribution.html",
        {
            "claimed": claimed,
            "unit": SHOWN[headline(d)][0],
            "runners_up": _table(d.runners_up, headline(d)),
            "too_small": [in_words(c.effect) for c in d.below_materiality],
            "ambiguous": [" with ".join(in_words(e) for e in effects) for effects in d.ambiguous],
            "small": _table(d.below_materiality, headline(d)),
        },
    )


def _table(claims: tuple[Claim, ...], group: str) -> list[dict[str, object]]:
    errors = column([SHOWN[group][1] * c.error for c in claims])
    moved = column([c.contribution for c in claims], 2)
    return [
        {
            "name": in_words(c.effect),
            "error": error,
            "moved": sigma,
            "probability": percent(c.probability),
            "parameters": [f"{n} = {plus_minus(f)}" for n, f in c.parameters.items()],
        }
        for c, error, sigma in zip(claims, errors, moved, strict=True)
    ]
