"""Under a hand: what the sensors felt beside the shapes that were seen, a row a sensor."""

from __future__ import annotations

import numpy as np

from twin.report.numbers import number
from twin.report.sections.section import Section, Story
from twin.shape.under_hand import UnderHand

PERCENT = 100.0
TOLD = 2.0  # standard errors of the seen strain: a sensor further off is named


def section(story: Story) -> Section | None:
    """None where no trial has a hand on a robot that feels strain while its shape is seen."""
    seen = story.diagnosis.under_hand
    if seen is None:
        return None
    rows = [
        {"sensor": k + 1, "before": number(PERCENT * b), "after": number(PERCENT * a), "seen": number(PERCENT * s)}
        for k, (b, a, s) in enumerate(zip(seen.before, seen.after, seen.seen, strict=True))
    ]
    return Section("under-hand", "Sensors under a hand", "under_hand.html", {"rows": rows, "words": words(seen)})


def words(seen: UnderHand) -> str:
    """Which sensors differ from the shapes seen, in a sentence."""
    odd = [k for k in range(len(seen.seen)) if max(seen.before[k], seen.after[k]) > TOLD * seen.seen[k]]
    silent = [k for k in range(len(seen.seen)) if not np.isfinite(seen.after[k])]
    told = [
        f"sensor {k + 1} felt {PERCENT * seen.before[k]:.2f} % strain off the shapes that were seen, with the effects "
        f"{PERCENT * seen.after[k]:.2f} %" for k in odd
    ] + [f"sensor {k + 1} says nothing" for k in silent]  # fmt: skip
    rest = "the others agree with these" if told else "all sensors agree with the shapes that were seen"
    if len(odd) + len(silent) < len(seen.seen):
        told.append(f"{rest} to within {PERCENT * float(seen.seen.max()):.2f} %")
    return f"Under a hand ({seen.frames} frames of {', '.join(seen.trials)}, fitted to nothing): {'; '.join(told)}."
