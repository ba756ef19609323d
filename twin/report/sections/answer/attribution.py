"""Other explanations: runners-up, explanations that these data cannot distinguish, effects too small to claim."""

from twin.diagnosis import Claim
from twin.foundation.display_names import display_name
from twin.report.numbers import DISPLAY_UNITS, format_column, format_percent, format_with_error
from twin.report.sections.section import Section, Story
from twin.report.sentence import headline_group


def section(story: Story) -> Section:
    """Return the section on other explanations."""
    d = story.diagnosis
    claimed = " and ".join(display_name(c.effect) for c in d.claims) or "no effect"
    return Section(
        "attribution",
        "Other explanations",
        "answer/attribution.html",
        {
            "claimed": claimed,
            "unit": DISPLAY_UNITS[headline_group(d)][0],
            "runners_up": _claim_rows(d.runners_up, headline_group(d)),
            "too_small": [display_name(c.effect) for c in d.below_materiality],
            "ambiguous": [" with ".join(display_name(e) for e in effects) for effects in d.ambiguous],
            "small": _claim_rows(d.below_materiality, headline_group(d)),
        },
    )


def _claim_rows(claims: tuple[Claim, ...], group: str) -> list[dict[str, object]]:
    errors = format_column([DISPLAY_UNITS[group][1] * c.error for c in claims])
    moved = format_column([c.contribution for c in claims], 2)
    return [
        {
            "name": display_name(c.effect),
            "error": error,
            "moved": sigma,
            "probability": format_percent(c.probability),
            "parameters": [f"{n} = {format_with_error(f)}" for n, f in c.parameters.items()],
        }
        for c, error, sigma in zip(claims, errors, moved, strict=True)
    ]
