"""Warnings about a fit, in words."""

import numpy as np

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.thresholds import LEAST_CONTRIBUTION, UNLIKELY_PARAMETER_DISTANCE


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
    """Return all of them in one sentence, for the verdict; empty where there are none, or where they hardly move the prediction.

    With many readings an error of a tenth of the noise, of the integration say, drives numbers far that no reading tells apart.
    """
    names = [words.partition(" ")[0] for words in unlikely(found)]
    if not names or (not any(_at_own_bound(found)) and _moved_by_unlikely(found) < LEAST_CONTRIBUTION):
        return ""
    which = names[0] if len(names) == 1 else f"{len(names)} numbers of the robot ({names[0]}, ...)"
    return (
        f"{which} ended at a bound or {UNLIKELY_PARAMETER_DISTANCE:.0f} standard deviations off the description, so the effects "
        "may imitate a wrong description (see the notices)"
    )


def _at_own_bound(found: Fit) -> list[bool]:
    """Return which free parameters are the robot's own at an end of their range."""
    return [
        bool(ended and f.effect is None and f.parameter.std) for f, ended in zip(found.model.free, found.at_bound(), strict=True)
    ]


def _moved_by_unlikely(found: Fit) -> float:
    """Return by how much (sigma, root mean square) the prediction moves with the robot's own parameters back at a likely distance.

    All others follow: d being the way back of those that are unlikely, in steps, and H = J'J and the priors'
    information, the cost rises by d' (H_dd - H_do H_oo^-1 H_od) d.
    """
    free, steps = found.model.free, np.array([f.parameter.step for f in found.model.free])
    off = np.array([0.0 if f.effect or not f.parameter.std else found.model.value(f) - f.parameter.value for f in free])
    likely = UNLIKELY_PARAMETER_DISTANCE * np.hypot([f.parameter.std or np.inf for f in free], found.std())
    back = np.sign(off) * np.maximum(np.abs(off) - likely, 0.0) / steps
    far, H = back != 0.0, found.information()
    others = H[np.ix_(~far, ~far)]
    followed = np.linalg.lstsq(others, H[np.ix_(~far, far)] @ back[far], rcond=None)[0]
    rise = back[far] @ (H[np.ix_(far, far)] @ back[far] - H[np.ix_(far, ~far)] @ followed)
    return float(np.sqrt(max(rise, 0.0) / max(found.z.size, 1)))


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
