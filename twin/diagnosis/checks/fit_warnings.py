"""What a fit says against itself, in words."""

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.thresholds import UNLIKELY_PARAMETER_DISTANCE


def unlikely(found: Fit) -> list[str]:
    """The robot's own parameters that were driven far from their description, in words."""
    said = []
    for free in found.model.free:
        p = free.parameter
        value = found.model.twin.values.get(p.name, p.value)
        if free.effect is None and p.std and abs(value - p.value) > UNLIKELY_PARAMETER_DISTANCE * p.std:
            how = abs(value - p.value) / p.std
            said.append(
                f"{p.name} came out {how:.1f} standard deviations of its description away ({value:.4g} {p.unit}, described as "
                f"{p.value:.4g}): check it, or something else hides in it"
            )
    return said


def strained(found: Fit) -> list[str]:
    """Effects whose parameter, one that may go either way, ended at an end of its range, or whose values nothing of that name has,
    in words: another law is behind them."""
    reasons = ((e.id, e.why_implausible()) for e in found.model.twin.effects)
    said = [f"{effect.replace('_', ' ')}: {why}" for effect, why in reasons if why]
    for free, ended in zip(found.model.free, found.at_bound(), strict=True):
        p, value = free.parameter, found.model.value(free)
        if ended and free.effect is not None and p.low == -p.high:
            said.append(
                f"{free.effect.replace('_', ' ')}: {p.name.replace('_', ' ')} came out at the end of its range "
                f"({value:.3g}{'' if p.unit == '1' else ' ' + p.unit}); this law is bent to what it does not describe"
            )
    return said
