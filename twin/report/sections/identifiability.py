"""What these data can tell: which effects their design shows, which it tells apart, and what it lacks for the others."""

from __future__ import annotations

import math

from twin.diagnose.identifiability import Visibility
from twin.quantities import Fitted
from twin.report.numbers import column, percent, rough
from twin.report.sections.section import Section, Story
from twin.report.sentence import needs
from twin.wording import in_words


def section(story: Story) -> Section:
    table = story.diagnosis.identifiability
    lacking = any(v.lacking for v in table if math.isfinite(v.seen))
    return Section("tell", "What these data can tell", "identifiability.html", {"rows": _rows(table), "lacking": lacking})


def _rows(table: tuple[Visibility, ...]) -> list[dict[str, object]]:
    seen, apart = column([v.seen for v in table], 2), column([v.apart for v in table], 2)
    return [
        {
            "name": f"{in_words(v.effect)} ({v.form})" if v.form else in_words(v.effect),
            "never": None if math.isfinite(v.seen) else f"never: {needs(v.lacking)}",
            "seen": a,
            "apart": b,
            "rival": f"{in_words(v.rival)}, {percent(1 - v.share)}" if v.rival else "",
            "smallest": _smallest(v),
            "lacking": "; ".join(v.lacking),
        }
        for v, a, b in zip(table, seen, apart, strict=True)
    ]


def _smallest(v: Visibility) -> str:
    name, value, unit = v.smallest
    return f"{name.replace('_', ' ')} {rough(Fitted(value, None, unit))}"
