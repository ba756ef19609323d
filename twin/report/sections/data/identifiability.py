"""Identifiability: the effects that the design can show and distinguish, and the data missing for the others."""

import math

from twin.diagnosis.checks.identifiability import Visibility
from twin.foundation.display_names import display_name
from twin.foundation.parameters import FittedValue
from twin.report.numbers import format_column, format_percent, two_significant_digits
from twin.report.sections.section import Section, Story
from twin.report.sentence import describe_missing_data


def section(story: Story) -> Section:
    """Return the section on which effects these data can show."""
    table = story.diagnosis.identifiability
    lacking = any(v.lacking for v in table if math.isfinite(v.seen))
    return Section(
        "identifiability", "What these data can show", "data/identifiability.html", {"rows": _rows(table), "lacking": lacking}
    )


def _rows(table: tuple[Visibility, ...]) -> list[dict[str, object]]:
    seen, apart = format_column([v.seen for v in table], 2), format_column([v.apart for v in table], 2)
    return [
        {
            "name": f"{display_name(v.effect)} ({v.form})" if v.form else display_name(v.effect),
            "undetectable": None if math.isfinite(v.seen) else f"not detectable: {describe_missing_data(v.lacking)}",
            "seen": a,
            "apart": b,
            "rival": f"{display_name(v.rival)}, {format_percent(1 - v.share)}" if v.rival else "",
            "smallest": _smallest(v),
            "lacking": "; ".join(v.lacking),
        }
        for v, a, b in zip(table, seen, apart, strict=True)
    ]


def _smallest(v: Visibility) -> str:
    name, value, unit = v.smallest
    return f"{display_name(name)} {two_significant_digits(FittedValue(value, None, unit))}"
