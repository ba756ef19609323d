"""Sensors under a hand compared with the measured shapes, a row for each sensor."""

import numpy as np

from twin.report.hand_check import hand_check
from twin.report.numbers import PERCENT, format_number
from twin.report.sections.section import Section, Story
from twin.shape.pushed_trials import PushedTrialCheck

NAMED_SENSOR_RATIO = 2.0  # standard errors of the shape's strain: a sensor further off is named


def section(story: Story) -> Section | None:
    """Return the section; None where no trial has strain readings and a measured shape under a hand."""
    check = hand_check(story.diagnosis)
    if check is None:
        return None
    rows = [
        {
            "sensor": k + 1,
            "before": format_number(PERCENT * b),
            "after": format_number(PERCENT * a),
            "seen": format_number(PERCENT * s),
        }
        for k, (b, a, s) in enumerate(zip(check.rms_before, check.rms_after, check.strain_error, strict=True))
    ]
    return Section(
        "under-hand", "Sensors under a hand", "data/under_hand.html", {"rows": rows, "words": describe_hand_check(check)}
    )


def describe_hand_check(check: PushedTrialCheck) -> str:
    """Say which sensors differ from the measured shapes."""
    error = check.strain_error
    odd = [k for k in range(len(error)) if max(check.rms_before[k], check.rms_after[k]) > NAMED_SENSOR_RATIO * error[k]]
    silent = [k for k in range(len(error)) if not np.isfinite(check.rms_after[k])]
    parts = [
        f"sensor {k + 1} differs from the measured shapes by {PERCENT * check.rms_before[k]:.2f} % strain, with the effects by "
        f"{PERCENT * check.rms_after[k]:.2f} %" for k in odd
    ] + [f"sensor {k + 1} has no readings" for k in silent]  # fmt: skip
    rest = "the others agree with them" if parts else "all sensors agree with the measured shapes"
    if len(odd) + len(silent) < len(error):
        parts.append(f"{rest} to within {PERCENT * float(error.max()):.2f} %")
    return f"Under a hand ({check.frames} frames of {', '.join(check.trials)}, used in no fit): {'; '.join(parts)}."
