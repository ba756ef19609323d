"""Single channels: dead ones, implausible declared noise, an implausible room temperature."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case, Suspicion, called, rms
from twin.diagnosis.checks.suspicions.stops import ends
from twin.diagnosis.checks.suspicions.units import others
from twin.diagnosis.thresholds import (
    HIDING_NOISE_RATIO,
    LEFT_BY_PATTERN,
    NOMINAL_MOTION_ERROR,
    ROOM_TEMPERATURE_RANGE,
    SUSPECT_NOISE_RATIO,
    UNDERSTATED_NOISE_RATIO,
    UNMISSABLE_MOTION,
)
from twin.foundation.units import unit_scale
from twin.measurements import Channel
from twin.prediction.prepared import ROOM_TEMPERATURE, Inputs


def outputs(case: Case) -> Iterator[Suspicion]:
    """Yield outputs that do not move where the robot as described moves."""
    found = [case.prepared.outputs[j].channel.name for j in case.dead()]
    if found:
        words = f"{', '.join(found)}: one value in all trials, but for noise, where the robot as described moves"
        yield Suspicion("dead channel", words, f"remove the [[channel]] {', '.join(found)}, or log again")


def inputs(case: Case) -> Iterator[Suspicion]:
    """Yield a drive that never changes although the robot moves as if it did."""
    if case.predicted is None or not case.few() or any(ends(case)):
        return
    command = np.concatenate([i.command for i in case.prepared.inputs])
    columns, few = case.columns(case.group), case.few()
    still = np.ptp(command, axis=0) <= UNMISSABLE_MOTION * np.array([c.noise or 0.0 for c in case.prepared.drivers]) * np.abs(
        case.prepared.pull
    )
    left = [case.prepared.measured[k][:, columns] - case.predicted[k][:, columns] for k in case.trials]
    if not rms(np.concatenate(left)) > LEFT_BY_PATTERN * case.motion(columns):
        return
    for i in np.flatnonzero(still):
        top = float(np.abs(command).max())

        def pulled(x: Inputs, i: int = int(i), top: float = top) -> Inputs:
            return replace(x, command=np.where(np.arange(x.command.shape[1]) == i, 0.5 * top, x.command))

        other = case.again(pulled)
        if other is None:
            continue
        whole, rest = [], []
        for k in few:
            along = other[k][:, columns] - case.predicted[k][:, columns]
            r = np.nan_to_num(case.prepared.measured[k][:, columns] - case.predicted[k][:, columns])
            size = (along**2).sum(axis=1)
            share = np.divide((r * along).sum(axis=1), size, out=np.zeros(len(r)), where=size > 0.0)
            whole.append(r)
            rest.append(r - share[:, None] * along)
        if rms(np.concatenate(rest)) < LEFT_BY_PATTERN * rms(np.concatenate(whole)):
            name = case.prepared.drivers[i].name
            words = f"{name} never changes, and the robot moves as if it did"
            yield Suspicion("dead input", words, f"log {name} again, or leave out the trials in which it was pulled")


def noise(case: Case) -> Iterator[Suspicion]:
    """Yield declared noise far from the scatter of neighbouring readings, or larger than everything seen."""
    odd: list[tuple[Channel, float]] = []
    for j, o in enumerate(case.prepared.outputs):
        if case.predicted is not None:
            read, shown = ([v[k][:, j] for k in case.trials] for v in (case.prepared.measured, case.predicted))
            left = [y - p for y, p in zip(read, shown, strict=True)]
            least = min(white(read), white(left)) - NOMINAL_MOTION_ERROR * white(
                shown
            )  # less the robot's errors, where it moves from row to row
            odd += _odd(o.channel, least, _scatter(left, 0.5), HIDING_NOISE_RATIO * rms(np.concatenate(left)))
    for i, c in enumerate(case.prepared.drivers):
        read = [x.command[:, i] / case.prepared.pull[i] for x in case.prepared.inputs]
        odd += _odd(c, white(read), _scatter(read, 0.25), float(np.ptp(np.concatenate(read))) or np.inf)
    for unit in dict.fromkeys(c.unit for c, _ in odd):
        alike = [(c, s) for c, s in odd if c.unit == unit]
        one = alike[0][0].scale.without_offset().to_si(1.0)
        declared, seen = np.median([c.noise or np.nan for c, _ in alike]) / one, np.median([s for _, s in alike]) / one
        names = called([c for c, _ in alike])
        words = f"noise of {names} is declared as {declared:.3g} {unit}, and neighbouring readings scatter by {seen:.3g} {unit}"
        yield Suspicion("declared noise", words, f"noise = {seen:.2g} for {names} (one standard deviation, in {unit})")


def _odd(channel: Channel, least: float, scatter: float, most: float) -> list[tuple[Channel, float]]:
    """Return the channel and its scatter (SI), where its declared noise is implausible.

    That is far below the `least` that it can be, or far above its scatter and the `most` that it may be.
    """
    declared = channel.noise
    if declared is None:
        return []
    if least > UNDERSTATED_NOISE_RATIO * declared:
        return [(channel, least)]
    return [(channel, scatter)] if declared > max(most, SUSPECT_NOISE_RATIO * scatter) else []


def white(columns: list[np.ndarray]) -> float:
    """Return the standard deviation of white noise on a motion.

    The second differences of white noise change sign from row to row, those of a smooth motion keep theirs. Minus the product of
    two neighbours has a median of 1.480 sigma^2 (of 4 million draws).
    """
    product = np.concatenate([(d := np.diff(c, n=2))[1:] * d[:-1] for c in columns])
    product = product[np.isfinite(product)]
    return float(np.sqrt(max(0.0, -np.median(product)) / 1.480)) if product.size else 0.0


def _scatter(columns: list[np.ndarray], quantile: float) -> float:
    """Return the standard deviation of white noise whose second differences have this quantile."""
    second = np.concatenate([np.abs(np.diff(c, n=2)) for c in columns])
    second = second[np.isfinite(second)]
    normal = {0.5: 0.6745, 0.25: 0.3186}[quantile]  # quantiles of |x|, x standard normal
    return float(np.quantile(second, quantile)) / (normal * np.sqrt(6.0)) if second.size else 0.0


def room(case: Case) -> Iterator[Suspicion]:
    """Yield a room temperature at which nobody works."""
    low, high = ROOM_TEMPERATURE_RANGE
    recording = case.prepared.recording
    for channel in (c for c in recording.channels if c.kind == "ambient_temperature"):
        values = np.concatenate([t.values[channel.name] for t in recording.trials])
        seen = float(np.nanmedian(values))
        if not low < seen < high:
            own = channel.scale
            read = (seen - own.offset) * own.denominator / own.numerator
            fit = [u for u in others(channel) if low < unit_scale(u, "K").to_si(read) < high]
            words = f"{channel.name} is {read:.4g} {channel.unit}, which means a room of {seen - 273.15:.0f} degC"
            change = f'unit = "{fit[0]}" instead of "{channel.unit}" for {channel.name}' if fit else f"correct {channel.name}"
            yield Suspicion("temperature unit", words, change)
    odd = {t.name: float(t.conditions.get("ambient_temperature", ROOM_TEMPERATURE)) for t in recording.trials}
    for name, kelvin in odd.items():
        if not low < kelvin < high:
            words = f"ambient_temperature of {name} is {kelvin:.4g} K, {kelvin - 273.15:.0f} degC"
            yield Suspicion("temperature unit", words, "its unit: degC, degF or K")
            return
