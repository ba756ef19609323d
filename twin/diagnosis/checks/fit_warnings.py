"""Warnings about a fit, in words."""

import numpy as np

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.thresholds import UNLIKELY_PARAMETER_DISTANCE


def unlikely(found: Fit) -> list[str]:
    """Return, in words, the robot's own parameters that are far from their description or at an end of their range.

    A number is known no better than by its standard error: where trials disagree about it, it may come out far off by that alone.
    """
    warnings = []
    for free, ended, error in zip(found.model.free, found.at_bound(), found.std(), strict=True):
        p = free.parameter
        value = found.model.twin.values.get(p.name, p.value)
        if free.effect is not None or not p.std:
            continue
        if ended:
            warnings.append(
                f"{p.name} came out at an end of its range ({value:.4g} {p.unit}, allowed {p.low:.4g} to {p.high:.4g}): the true "
                "one may lie beyond it, and effects imitate the difference; widen the range in robot.toml if it may"
            )
        elif abs(value - p.value) > UNLIKELY_PARAMETER_DISTANCE * np.hypot(p.std, error):
            how = abs(value - p.value) / p.std
            warnings.append(
                f"{p.name} came out {how:.1f} standard deviations of its description away ({value:.4g} {p.unit}, described as "
                f"{p.value:.4g}): check it; it may hide another error"
            )
    return warnings


def far_from_description(found: Fit) -> str:
    """Return all of them in one sentence, for the verdict; empty where there are none."""
    names = [words.partition(" ")[0] for words in unlikely(found)]
    if not names:
        return ""
    which = names[0] if len(names) == 1 else f"{len(names)} numbers of the robot ({names[0]}, ...)"
    return (
        f"{which} ended at a bound or {UNLIKELY_PARAMETER_DISTANCE:.0f} standard deviations off the description, so the effects "
        "may imitate a wrong description (see the notices)"
    )


def strained(found: Fit) -> list[str]:
    """Return, in words, effects with a signed parameter at an end of its range, or with implausible values.

    Such an effect imitates another cause.
    """
    reasons = ((e.id, e.why_implausible()) for e in found.model.twin.effects)
    warnings = [f"{effect.replace('_', ' ')}: {why}" for effect, why in reasons if why]
    for free, ended in zip(found.model.free, found.at_bound(), strict=True):
        p, value = free.parameter, found.model.value(free)
        if ended and free.effect is not None and p.low == -p.high:
            warnings.append(
                f"{free.effect.replace('_', ' ')}: {p.name.replace('_', ' ')} came out at the end of its range "
                f"({value:.3g}{'' if p.unit == '1' else ' ' + p.unit}); this effect is fitted to something it does not describe"
            )
    return warnings
